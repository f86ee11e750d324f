"""A book and subtasks with graded relevance, for measuring what retrieval serves. The labels are written by hand in
``retrieval_labels.toml`` (verbs by meaning, things by how they are worked); no code that scores or filters uses them.

Grades of an entry for a subtask: 3 the same thing done to the same objects · 2 done to what is worked the same way ·
1 of some use (the same kind of thing worked another way; put: the same thing to another kind of place, or another thing
to the same kind) · 0 else. Exchanged roles are 0. An entry whose action undoes the subtask's is an *opposite*.
"""

from __future__ import annotations

import itertools
import tomllib
from functools import cache
from importlib import resources
from typing import Any, Literal

import attrs

from memo_core.skillbook.model.keys import Key

Half = Literal["choose", "report"]
HALVES: tuple[Half, Half] = ("choose", "report")


@attrs.frozen
class Meaning:
    """What a subtask asks for or an entry is about."""

    sense: str  # a name of the table of senses; "" for what is related to nothing
    objects: tuple[str, ...]


@attrs.frozen
class Query:
    """A subtask, in somebody's words, and what it means."""

    subtask: Key
    meaning: Meaning
    half: Half


@cache
def _labels() -> dict[str, Any]:
    text = resources.files("memo_benchmarks").joinpath("retrieval_labels.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def _way(sense: str, thing: str) -> str:
    return str(_labels()["things"].get(thing, {}).get(sense, ""))


def grade(asked: Meaning, taught: Meaning) -> int:
    """How relevant an entry is to a subtask, 0 to 3."""
    if not asked.sense or asked.sense != taught.sense or len(asked.objects) != len(taught.objects):
        return 0
    if asked.objects == taught.objects:
        return 3
    if asked.sense == "put":
        same_grasp = _alike("pick", asked.objects[0], taught.objects[0]) == 2
        same_place = _way("put", asked.objects[1]) == _way("put", taught.objects[1])
        if asked.objects[::-1] == taught.objects:
            return 0
        return same_grasp + same_place
    return _alike(asked.sense, asked.objects[0], taught.objects[0])


def _alike(sense: str, one: str, other: str) -> int:
    """2: worked the same way (or the same thing); 1: of the same kind; 0."""
    if one == other:
        return 2
    way, another = _way(sense, one), _way(sense, other)
    if not way or not another:
        return 0
    return 2 if way == another else int(way.split("/")[0] == another.split("/")[0])


def undoes(asked: Meaning, taught: Meaning) -> bool:
    """Whether an entry's action undoes the subtask's."""
    senses = _labels()["senses"]
    return bool(asked.sense) and (
        senses.get(asked.sense, {}).get("undone_by") == taught.sense
        or senses.get(taught.sense, {}).get("undone_by") == asked.sense
    )


def _verbs(sense: str, half: Half) -> list[str]:
    row = _labels()["senses"][sense]
    return [*row["both"], *row[half]]


def _senses_of(thing: dict[str, Any]) -> list[str]:
    return [sense for sense in _labels()["senses"] if sense in thing and sense != "put"]


def taught() -> dict[Key, Meaning]:
    """The keys of the book and what their entries are about. Of a sense's verbs the first ones are used in turn."""
    labels, found = _labels(), {}
    for half in HALVES:
        turn = itertools.count()
        for thing, row in labels["things"].items():
            if row["half"] != half or not row.get("taught", True):
                continue
            for sense in _senses_of(row):
                verbs = labels["senses"][sense]["both"]
                found[Key.make(verbs[next(turn) % len(verbs)], thing)] = Meaning(sense, (thing,))
        for pair in labels["put"][half]:
            verbs = labels["senses"]["put"]["both"]
            found[Key.make(verbs[next(turn) % len(verbs)], *pair)] = Meaning("put", tuple(pair))
    for text in labels["distractors"]["taught"]:
        key = Key.parse(text)
        found[key] = Meaning("", key.objects)
    return found


def queries(half: Half) -> list[Query]:
    """The subtasks of a half. Every thing and sense, in the words of this half by turns; the exchanged roles; what
    nothing in the book is of use for."""
    labels, found = _labels(), []
    turn = dict.fromkeys(labels["senses"], 0)

    def ask(sense: str, *objects: str) -> None:
        verbs = _verbs(sense, half)
        verb = verbs[turn[sense] % len(verbs)]
        turn[sense] += 1
        found.append(Query(Key.make(verb, *objects), Meaning(sense, objects), half))

    for _ in range(2):  # in two ways of saying it
        for thing, row in labels["things"].items():
            for sense in _senses_of(row) if row["half"] == half else ():
                ask(sense, thing)
        for group in (half, f"{half}_asked", f"{half}_swapped"):
            for pair in labels["put"][group]:
                ask("put", *pair)
    for text in labels["distractors"][half]:
        key = Key.parse(text)
        found.append(Query(key, Meaning("", key.objects), half))
    return list({query.subtask: query for query in found}.values())


def taught_texts() -> list[tuple[Key, str, Meaning]]:
    """Everything that is in the book: key, text and what it is about."""
    said, found = _labels()["said"], []
    for key, meaning in taught().items():
        first, sense = meaning.objects[0], meaning.sense
        way = f"put/{_way('put', meaning.objects[1])}" if sense == "put" else _way(sense, first) or "other"
        found += [(key, text, meaning) for text in said[way]]
        found.append((key, f"{' and '.join(meaning.objects)}: watch what you touch.", meaning))
    return found
