"""Reading what a model says it sees: prose around JSON, things without a place, boxes outside of the picture, two
things in one place. Nothing here raises: what is wrong is told in words, so that the model can be asked again, and what
is usable is kept; a thing that stays doubtful carries a flag, and one without a place is left out.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from typing import Any, get_args

import attrs

from memo_core.llm.readers import json_objects
from memo_perception.cameras.detectors.detector import State
from memo_perception.cameras.inventory import Kind

Box = tuple[float, float, float, float]

SURE = 0.9  # probability that the name is right, where nothing is known against it
DOUBTFUL = 0.4
_MOST_THINGS = 60
_LONGEST = 60  # characters of a label
_SAME = 0.85  # overlap (intersection over union) from which on two boxes are one
_KINDS = set(get_args(Kind))
_SPELLINGS: dict[State, str] = {
    "open": "open opened ajar half-open partly-open",
    "closed": "closed shut",
    "unclear": "unclear unknown",
}
_STATES = {word: state for state, words in _SPELLINGS.items() for word in words.split()}
_LABELS = ("label", "name", "object")
_PLACES = ("marks", "mark", "numbers", "box", "box_2d", "bbox_2d", "bbox", "point", "point_2d")
_LISTS = ("things", "objects", "detections", "items")
_MOLMO = re.compile(r"<points?\b([^>]*)>(.*?)</points?>", re.DOTALL | re.IGNORECASE)
_ATTRIBUTE = re.compile(r"([a-z]+)(\d*)\s*=\s*[\"']([^\"']*)[\"']", re.IGNORECASE)


@attrs.frozen
class Thing:
    """One thing as a model names it. It has marks, a box (left, top, right, bottom; px) or a point (px)."""

    label: str
    kind: Kind = "object"
    part_of: str | None = None  # the label of another thing of the answer
    state: State | None = None
    marks: frozenset[int] = frozenset()
    box: Box | None = None
    point: tuple[float, float] | None = None
    flag: str = ""

    @property
    def confidence(self) -> float:
        return DOUBTFUL if self.flag else SURE


@attrs.frozen
class Reading:
    """What could be read of an answer, and what was wrong with it, in words for the model."""

    things: tuple[Thing, ...]
    problems: tuple[str, ...] = ()


Place = Callable[[dict[str, Any]], tuple[dict[str, Any], str]]  # of one thing: fields of ``Thing``, and what is wrong


def read_things(text: str, place: Place) -> Reading:
    """The things of an answer. ``place`` reads where one of them is: fields of ``Thing`` (none if it is nowhere), and
    what is wrong with it, in words."""
    found, problems = _said(text)
    things: list[Thing] = []
    for number, said in enumerate(found[:_MOST_THINGS], start=1):
        thing, wrong = _thing(said, place)
        called = f"thing {number}" + (f" ({thing.label})" if thing is not None else "")
        problems += [f"{called}: {one}" for one in wrong]
        if thing is not None:
            things.append(thing)
    if len(found) > _MOST_THINGS:
        problems.append(f"it names {len(found)} things; at most {_MOST_THINGS}")
    for settle in (_apart, _named_apart, _owned):
        things, wrong = settle(things)
        problems += wrong
    return Reading(tuple(things), tuple(dict.fromkeys(problems)))


def numbers_of(value: Any) -> list[float]:
    """Finite numbers in a list, in a string or alone; empty if anything in it is none."""
    if isinstance(value, str):
        value = re.findall(r"-?\d+(?:\.\d+)?|nan|inf", value.lower())
    if isinstance(value, dict):
        value = [value[key] for key in ("x1", "y1", "x2", "y2", "x", "y") if key in value]
    if not isinstance(value, (list, tuple)):
        value = [value]
    if len(value) == 1 and isinstance(value[0], (list, tuple)):  # a list in a list
        value = value[0]
    found = []
    for one in value:
        try:
            number = math.nan if isinstance(one, bool) else float(one)
        except (TypeError, ValueError, OverflowError):
            return []
        if not math.isfinite(number):
            return []
        found.append(number)
    return found


def overlap(a: Box, b: Box) -> float:
    """Intersection over union of two boxes."""
    wide = min(a[2], b[2]) - max(a[0], b[0])
    high = min(a[3], b[3]) - max(a[1], b[1])
    if wide <= 0 or high <= 0:
        return 0.0
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    return wide * high / (sum(areas) - wide * high)


# -- one thing ---------------------------------------------------------------------------------------------------------


def _said(text: str) -> tuple[list[dict[str, Any]], list[str]]:
    """The objects of an answer that describe things, in order."""
    objects = list(json_objects(text))
    found: list[dict[str, Any]] = []
    wholes = [one[key] for one in objects for key in _LISTS if isinstance(one.get(key), list) and one[key]]
    if wholes:  # of a draft and an answer the last counts
        objects = [one for one in wholes[-1] if isinstance(one, dict)]
    for one in objects:
        described = any(key in one for key in _LABELS) or any(key in one for key in _PLACES)
        if described and not any(one is other or one == other for other in found):
            found.append(one)
    problems = []
    if not found:
        found = list(_pointed(text))
    empty = any(one.get(key) == [] for one in json_objects(text) for key in _LISTS) or re.fullmatch(
        r"\W*\[\s*\]\W*", text
    )
    if not found and not empty:
        problems.append("it holds no JSON with things")
    elif _breaks_off(text):
        problems.append("it breaks off")
    return found, problems


def _pointed(text: str) -> Iterator[dict[str, Any]]:
    """Molmo's own way of pointing: ``<point x="10.5" y="20.0" alt="cup">cup</point>``."""
    for tag in _MOLMO.finditer(text):
        numbered: dict[str, dict[str, str]] = {}
        label = tag[2].strip()
        for name, number, value in _ATTRIBUTE.findall(tag[1]):
            if name.lower() in ("x", "y"):
                numbered.setdefault(number, {})[name.lower()] = value
            elif name.lower() == "alt" and not label:
                label = value
        for point in numbered.values():
            if set(point) == {"x", "y"}:
                yield {"label": label, "point": [point["x"], point["y"]], "xy": True}


def _breaks_off(text: str) -> bool:
    bare = re.sub(r'"(?:[^"\\\n]|\\.)*"', "", text)
    return bare.count("{") > bare.count("}") or bare.count("[") > bare.count("]")


def _thing(said: dict[str, Any], place: Place) -> tuple[Thing | None, list[str]]:
    problems: list[str] = []
    label = next((_label(said[key]) for key in _LABELS if key in said), "")
    if not label:
        return None, ["it has no label"]
    where, wrong = place(said)
    if not where:
        kind = said.get("kind")
        if kind != "space":  # the place of an inside follows from what it is inside of
            return None, [wrong or "it has no place"]
    elif wrong:
        problems.append(wrong)
    flags = [wrong] if wrong and where else []
    kind = _word(said.get("kind")) or "object"
    if kind not in _KINDS:
        problems.append(f"{kind!r} is no kind; one of {', '.join(sorted(_KINDS))}")
        flags.append(f"its kind was said to be {kind!r}")
        kind = "object"
    state, owner = said.get("state"), said.get("part_of")
    told = Thing(
        label=label,
        kind=kind,  # type: ignore[arg-type]
        part_of=_label(owner) or None,
        state=_STATES.get(_word(state).replace(" ", "-")) if state is not None else None,
        flag="; ".join(flags),
        **where,
    )
    return told, problems


def _label(value: Any) -> str:
    """A label in one line, without a number at its end; empty if there is none."""
    if not isinstance(value, str):
        return ""
    plain = "".join(one if one.isprintable() else " " for one in value)
    plain = " ".join(plain.replace("_", " ").split()).strip("\"'.,:;<>[]{}()*` ")
    plain = re.sub(r"\s*[#(]?\b\d+\)?$", "", plain).strip()
    if plain.lower() in ("", "none", "null", "unknown", "n/a", "object", "thing") or len(plain) > _LONGEST:
        return ""
    return plain


def _word(value: Any) -> str:
    return value.strip().lower() if isinstance(value, str) else ""


# -- several things ----------------------------------------------------------------------------------------------------


def _apart(things: list[Thing]) -> tuple[list[Thing], list[str]]:
    """Of things in one place only the first stays: the same thing said twice, or two names for one, which is flagged. A
    part may be where its owner is."""
    kept: list[Thing] = []
    problems = []
    for thing in things:
        for number, other in enumerate(kept):
            if _related(thing, other) or thing.kind == "space" or other.kind == "space":
                continue
            shared = thing.marks & other.marks
            same = bool(thing.box and other.box and overlap(thing.box, other.box) > _SAME) or (
                thing.point is not None and thing.point == other.point
            )
            if not shared and not same:
                continue
            if thing.label.lower() != other.label.lower():
                where = f"mark {min(shared)}" if shared else "one place"
                problems.append(f"{thing.label!r} and {other.label!r} are both said to be at {where}")
                kept[number] = attrs.evolve(other, flag=_also(other.flag, f"it may be a {thing.label!r}"))
            thing = attrs.evolve(
                thing, marks=thing.marks - shared, box=None if same else thing.box, point=None if same else thing.point
            )
        if thing.marks or thing.box or thing.point or thing.kind == "space":
            kept.append(thing)
    return kept, problems


def _related(one: Thing, other: Thing) -> bool:
    owners = {(one.part_of or "").lower(), (other.part_of or "").lower()}
    return one.label.lower() in owners or other.label.lower() in owners


def _named_apart(things: list[Thing]) -> tuple[list[Thing], list[str]]:
    """Two things may have one label, but then nothing can be a part of that label."""
    labels = [thing.label.lower() for thing in things]
    owners = {thing.part_of.lower() for thing in things if thing.part_of}
    several = sorted({label for label in owners if labels.count(label) > 1})
    problems = [f"something is part of {label!r}, and there are several: tell them apart" for label in several]
    told = [
        attrs.evolve(thing, flag=_also(thing.flag, "it may be part of another one"))
        if thing.part_of and thing.part_of.lower() in several
        else thing
        for thing in things
    ]
    return told, problems


def _owned(things: list[Thing]) -> tuple[list[Thing], list[str]]:
    """Owners that are there. A part without one is an object, and flagged; an inside without one is left out."""
    labels = {thing.label.lower(): thing.label for thing in things}
    owners = {thing.label.lower(): (thing.part_of or "").lower() for thing in things}
    kept: list[Thing] = []
    problems: list[str] = []
    for thing in things:
        owner = (thing.part_of or "").lower()
        own = thing.label.lower()
        wrong = ""
        if owner and owner not in labels:
            wrong = f"it is said to be part of {thing.part_of!r}, which is not named"
        elif owner and (owner == own or _circular(own, owners)):
            wrong = "it is said to be part of itself"
        elif not owner and thing.kind in ("part", "space"):
            wrong = "it is not said what it is part of"
        if not wrong:
            kept.append(attrs.evolve(thing, part_of=labels[owner]) if owner else thing)
            continue
        problems.append(f"{thing.label}: {wrong}")
        if thing.kind != "space":
            kind: Kind = "object" if thing.kind == "part" else thing.kind
            kept.append(attrs.evolve(thing, part_of=None, kind=kind, flag=_also(thing.flag, wrong)))
    return kept, problems


def _circular(label: str, owners: dict[str, str]) -> bool:
    seen, at = {label}, owners.get(label, "")
    while at and at not in seen:
        seen.add(at)
        at = owners.get(at, "")
    return at == label


def _also(flag: str, further: str) -> str:
    return f"{flag}; {further}" if flag else further


def schema(place: dict[str, Any]) -> dict[str, Any]:
    """The JSON Schema of an answer whose things have these properties beside label, kind, part_of and state."""
    properties = {
        "label": {"type": "string"},
        **place,
        "kind": {"type": "string", "enum": sorted(_KINDS)},
        "part_of": {"type": ["string", "null"]},
        "state": {"type": ["string", "null"], "enum": ["open", "closed", "unclear", None]},
    }
    thing = {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}
    whole = {"things": {"type": "array", "items": thing}}
    return {"type": "object", "properties": whole, "required": ["things"], "additionalProperties": False}
