"""A clause's parts as what is wanted of each: how much, how much more or less, and what is denied."""

from __future__ import annotations

import re
from collections.abc import Sequence

import attrs

from memo_llm.offline.composition import NEUTRAL, Part

OPPOSITE = {"up": "down", "down": "up", "left": "right", "right": "left", "away": "towards", "towards": "away"}
_OTHER_MANNER = {"slow": "fast", "fast": "slow", "gentle": "firm", "firm": "gentle"}


@attrs.frozen
class Meant:
    """One edit: its kind and value in the vocabulary, the words of its amount, and the verb it is about."""

    kind: str
    value: str = ""
    amount: str = ""
    verb: str = ""
    lifted: bool = False


@attrs.define
class Item:
    """A part that carries meaning, with what is said of its degree."""

    part: Part
    too: bool
    enough: bool
    denied: bool
    more: bool
    less: bool
    amount: str


@attrs.frozen
class Clause:
    """A clause of a request: its items, the classes of its verbs, the kinds of its parts, the hand or fingers where it
    names them, and the kind of subtask."""

    items: list[Item]
    verbs: frozenset[str]
    said: frozenset[str]
    hand: frozenset[str]
    kind: str


def items_of(parts: Sequence[Part]) -> list[Item] | None:
    """The parts that carry meaning, each with what is said of its degree."""
    found: list[Item] = []
    too = denied = more = less = False
    amount = ""
    verb: Part | None = None
    for part in parts:
        if part.kind == "verb":
            verb = part
        if part.kind in NEUTRAL or part.kind in ("verb", "thing", "other", "pronoun", "hand") or _belongs(part, verb):
            continue
        if part.kind == "not":
            denied = True
        elif part.kind == "too":
            too = True
        elif part.kind == "more":
            more, less = part.value == "more", part.value == "less"
            if found and found[-1].part.kind in ("amount", "dir") and not found[-1].more:
                found[-1].more, found[-1].less = more, less
        elif part.kind == "enough":
            if not found:
                return None
            found[-1].enough = True
        elif part.kind == "amount" and (too or denied) and part.said in ("far", "much", "wide"):
            if too and part.said == "far" and found and found[-1].part.kind == "dir":
                found[-1].too = True  # "down too far"
                too = False
                continue
            found.append(Item(Part("extent", "far", part.said), too, False, denied, False, False, ""))
            too = False
        elif (
            part.kind == "amount"
            and found
            and found[-1].part.kind in ("dir", "manner", "when")
            and not found[-1].amount
        ):
            found[-1].amount = part.said
        elif part.kind == "amount":
            amount = part.said
            found.append(Item(part, too, False, denied, more, less, part.said))
        elif part.kind not in ("dir", "manner", "when"):
            if more or less:
                found.append(Item(Part("amount", "", "more"), False, False, denied, more, less, ""))
            found.append(Item(part, too, False, denied, False, False, ""))
            too = more = less = False
        else:
            if found and found[-1].part.kind == "amount":
                found.pop()
            else:
                amount = ""
            found.append(Item(part, too, False, denied, more, less, amount))
            too = more = less = False
            amount = ""
    if too:
        return None
    if more or less:
        if not found:
            found.append(Item(Part("amount", "", "more" if more else "less"), False, False, denied, more, less, ""))
        elif found[-1].part.kind not in ("amount", "dir", "manner"):
            return None
    return found


def _belongs(part: Part, verb: Part | None) -> bool:
    """Whether a way only belongs to the verb: "put it down", "pick it up"."""
    if verb is None or part.kind != "dir":
        return False
    down = part.said == "down" and bool(verb.classes & {"put", "stand", "lower"})
    return down or (part.said == "up" and bool(verb.classes & {"lift", "stand"}))


def way_of(item: Item) -> str | None:
    """The value that is asked for, turned round where a fault is named; None where that is not clear."""
    others = OPPOSITE if item.part.kind == "dir" else _OTHER_MANNER
    value = item.part.value
    if item.enough and not item.denied:
        return None  # "high enough" is praise
    if item.denied and not (item.too or item.enough):
        return None  # what not to do does not say what to do
    if item.too or item.less:
        return others.get(value)
    return value


def bare(item: Item) -> bool:
    """Whether a way says no more than where the motion goes anyway."""
    plain = re.fullmatch(r"(?:straight )?(?:up|down)|upwards?|downwards?|low|high|deep", item.part.said)
    return plain is not None and not (item.amount or item.more or item.too or item.enough)
