"""Data of the Why pages: what an entry was made of, where it was tested, and what came of it where it was retrieved."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import attrs

from memo_core.plugin import InvalidArgument, read_events
from memo_core.skillbook import Entry, Skillbook

EVENTS = "events.jsonl"
LONGEST_SEARCH = 200  # characters
NOT_OVER = "not over"


@attrs.frozen
class Use:
    """One retrieval of an entry in a run, and what came of it.

    Attributes:
        run: id of the run.
        task: instruction of the task.
        subtask: subtask that the entry was retrieved for, as planned.
        attempt: number of the attempt, from 1; 0 if it was retrieved for a plan.
        time: when it was retrieved, in s since the epoch.
        score: what it was ranked by.
        outcome: ``approved``, ``corrected``, ``unobserved`` (nobody said anything), or ``not over``.
        words: what the person said was wrong.
        code: the program that was written with it.
        error: how the program ended, if by an error.
    """

    run: str
    task: str
    subtask: str
    attempt: int
    time: float
    score: float
    outcome: str = NOT_OVER
    words: tuple[str, ...] = ()
    code: str = ""
    error: str = ""


class RunRecords:
    """Retrievals in the runs that a book knows of. A run is read again only when its events have grown."""

    def __init__(self) -> None:
        self._read: dict[Path, tuple[tuple[int, int], dict[int, list[Use]]]] = {}

    def of(self, book: Skillbook, entry: int) -> list[Use]:
        """Retrievals of an entry, oldest first. Runs that could only read the book are unknown to it.

        Args:
            book: the open book.
            entry: id of the entry.

        Returns:
            One use for each attempt that the entry was retrieved for.
        """
        found = [use for folder in run_folders(book) for use in self._uses(folder).get(entry, ())]
        return sorted(found, key=lambda use: use.time)

    def _uses(self, folder: Path) -> dict[int, list[Use]]:
        try:
            about = (folder / EVENTS).stat()
        except OSError:
            return {}
        state = (about.st_mtime_ns, about.st_size)
        if folder not in self._read or self._read[folder][0] != state:
            self._read[folder] = (state, uses_in(read_events(folder)))
        return self._read[folder][1]


def run_folders(book: Skillbook) -> list[Path]:
    """Folders of the runs that a book knows of, in the order in which they began."""
    return [place.path for place in book.places() if place.kind == "run"]


def uses_in(events: Iterable[dict[str, Any]]) -> dict[int, list[Use]]:
    """The retrievals of a run, by entry, from its events (``memo_core.events``) as dictionaries."""
    found: dict[int, list[Use]] = {}
    served: dict[int, float] = {}
    at = Use("", "", "", 0, 0.0, 0.0)

    def close(outcome: str) -> None:
        ended = "corrected" if at.words else outcome
        for entry, score in served.items():
            found.setdefault(entry, []).append(attrs.evolve(at, score=score, outcome=ended))
        served.clear()

    for event in events:
        kind = event["event"]
        if kind in ("RunStarted", "RunResumed"):
            at = attrs.evolve(at, run=_text(event, "run"), task=_text(event, "instruction") or at.task)
        elif kind == "SubtaskStarted":
            close("unobserved")
            at = attrs.evolve(at, attempt=_count(event, "attempt"), words=(), code="", error="")
        elif kind == "Retrieved":
            close("unobserved")
            subtask, when = _text(event, "subtask"), float(event.get("time") or 0.0)
            at = attrs.evolve(at, subtask=subtask, time=when, words=(), code="", error="")
            served.update(_served(event))
        elif kind == "CodeWritten":
            at = attrs.evolve(at, code=_text(event, "code"))
        elif kind == "CodeEnded":
            at = attrs.evolve(at, error=_text(event, "error"))
        elif kind == "FeedbackGiven":
            at = attrs.evolve(at, words=(*at.words, _text(event, "words")))
        elif kind == "SubtaskEnded":
            close("approved" if event.get("status") == "approved" else "unobserved")
            at = attrs.evolve(at, attempt=0)
        elif kind == "RunEnded":
            close("unobserved")
    close(NOT_OVER)
    return found


def _served(event: dict[str, Any]) -> dict[int, float]:
    """Entries of a retrieval with their scores."""
    rows = [row for row in event.get("served") or () if isinstance(row, dict) and isinstance(row.get("entry"), int)]
    return {row["entry"]: float(row.get("score") or 0.0) for row in rows}


def _text(event: dict[str, Any], name: str) -> str:
    return str(event.get(name) or "")


def _count(event: dict[str, Any], name: str) -> int:
    value = event.get(name)
    return value if isinstance(value, int) else 0


# -- searching ---------------------------------------------------------------------------------------------------------
def search(book: Skillbook, words: str = "", kind: str = "", superseded: bool = False) -> list[Entry]:
    """Find entries by words: each must occur in the entry's text or key, or in what people said to make it.

    Args:
        book: the open book; neither embedder nor vector store is used.
        words: words in any case and order; empty: all entries.
        kind: only entries of this kind; empty: all kinds.
        superseded: whether superseded entries are included.

    Returns:
        The entries, newest first.

    Raises:
        InvalidArgument: if ``words`` is longer than ``LONGEST_SEARCH``.
    """
    if len(words) > LONGEST_SEARCH:
        raise InvalidArgument("words", f"{len(words)} characters", f"at most {LONGEST_SEARCH}")
    wanted = words.casefold().split()
    entries = book.entries(kind or None, superseded=superseded)
    return [one for one in reversed(entries) if not wanted or _has(book, one, wanted)]


def _has(book: Skillbook, entry: Entry, wanted: list[str]) -> bool:
    here = f"{entry.text} {entry.key}".casefold()
    missing = [word for word in wanted if word not in here]
    if not missing:
        return True
    said = " ".join(f"{one.words} {one.who}" for one in map(book.feedback, book.sources([entry.id]))).casefold()
    return all(word in said for word in missing)
