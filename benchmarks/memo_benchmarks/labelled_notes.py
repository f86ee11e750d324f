"""Notes with subtasks whose relevance people graded, from any source: what `memo bench retrieval-quality` compares on.

Three sources: the templated book (``labelled_book``), notes in people's words (``people_labels.toml``), and any book
with a file of labels. Such a file is TOML:

    [[asked]]
    subtasks = ["OPEN(oven)", "PULL_OPEN(oven door)"]                 # as a planner may word one subtask
    grades = {"OPEN(microwave)" = 3, "Mind the hinge." = 2}           # keys of the book, or the text of one entry
    undone = ["CLOSE(microwave)"]                                     # keys whose action undoes the subtasks'

Grades are 1 to 3; what is not named is irrelevant. Only corrections are graded.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import attrs

from memo_benchmarks.labelled_book import Half, grade, queries, taught_texts, undoes
from memo_core.errors import MemoError
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.keys import Key, NotAKey


@attrs.define(auto_exc=True, eq=False)
class BadLabels(MemoError):
    """A file of labels that cannot be used."""

    file: str
    problem: str

    exit_code = 2

    def __str__(self) -> str:
        return f"{self.file}: {self.problem}"


@attrs.frozen
class Note:
    """One correction."""

    key: Key
    text: str


@attrs.frozen
class Asked:
    """A subtask; of each note its grade, and whether its action undoes the subtask's."""

    subtask: Key
    grades: tuple[int, ...]
    undone: tuple[bool, ...]


@attrs.frozen
class LabelledNotes:
    """Notes and subtasks. All notes are in one book, also those that no subtask of this half is about."""

    name: str
    notes: tuple[Note, ...]
    asked: tuple[Asked, ...]


def templated(half: Half) -> LabelledNotes:
    """The book of ``labelled_book``: many keys, a few texts for each way of working a thing."""
    said = taught_texts()
    asked = [
        Asked(
            query.subtask,
            tuple(grade(query.meaning, meaning) for _, _, meaning in said),
            tuple(undoes(query.meaning, meaning) for _, _, meaning in said),
        )
        for query in queries(half)
    ]
    return LabelledNotes(f"templated, {half}", tuple(Note(key, text) for key, text, _ in said), tuple(asked))


def people(half: Half) -> LabelledNotes:
    """Notes as people phrase them; of a topic several, each with words of its own."""
    labels = _people()
    topics, notes = [], []
    for said in labels["said"]:
        for under, several in zip(said["under"], said["notes"], strict=True):
            notes += [Note(Key.parse(under), text) for text in several]
            topics += [said["topic"]] * len(several)
    of_half = [one for one in labels["asked"] if one["half"] == half]
    return LabelledNotes(f"in people's words, {half}", tuple(notes), tuple(_asked(of_half, topics)))


def of_book(book: Skillbook, labels: Path, name: str) -> LabelledNotes:
    """Any book's corrections with a file of labels. Raises ``BadLabels``."""
    notes = [Note(entry.key, entry.text) for entry in book.entries("correction")]
    try:
        table = tomllib.loads(labels.read_text(encoding="utf-8"))
        groups = table["asked"]
        for one in groups:
            one["grades"] = {_name(label, notes): value for label, value in one.get("grades", {}).items()}
            one["undone"] = [_name(label, notes) for label in one.get("undone", [])]
        both = [(str(note.key), note.text) for note in notes]
        return LabelledNotes(name, tuple(notes), tuple(_asked(groups, both)))
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise BadLabels(str(labels), str(error)) from None
    except (KeyError, TypeError, AttributeError):
        problem = "it has no [[asked]] with subtasks = [...] and grades = {...}"
        raise BadLabels(str(labels), problem) from None
    except (NotAKey, ValueError) as error:
        raise BadLabels(str(labels), str(error)) from None


def _name(label: str, notes: Sequence[Note]) -> str:
    """A label as it is compared: a key's own spelling, or a text. Raises ``ValueError`` for what the book has not."""
    if any(note.text == label for note in notes):
        return label
    try:
        key = str(Key.parse(label))
    except NotAKey:
        key = ""
    if not any(str(note.key) == key for note in notes):
        raise ValueError(f"{label!r} is neither a key of the book nor the text of one of its corrections")
    return key


def _asked(groups: Iterable[dict[str, Any]], labels: Sequence[Any]) -> Iterable[Asked]:
    """``labels``: of each note the name, or names, that grades go by."""
    for group in groups:
        wrong = [value for value in group["grades"].values() if value not in (1, 2, 3)]
        if wrong:
            raise ValueError(f"grade {wrong[0]!r} is not 1, 2 or 3")
        names = [label if isinstance(label, tuple) else (label,) for label in labels]
        grades = tuple(max(group["grades"].get(name, 0) for name in some) for some in names)
        undone = tuple(any(name in group.get("undone", ()) for name in some) for some in names)
        for subtask in group["subtasks"]:
            yield Asked(Key.parse(subtask), grades, undone)


def _people() -> dict[str, Any]:
    text = resources.files("memo_benchmarks").joinpath("people_labels.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
