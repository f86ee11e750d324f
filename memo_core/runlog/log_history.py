"""Reading a run log: the effects in order, and which of them are replayed in a resumed run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import attrs

from memo_core.runlog.log_file import FILE, damaged


@attrs.define(eq=False)
class LogEntry:
    """One effect. ``value`` or ``raised`` is set once it has ended; ``begun`` counts how often it was begun."""

    number: int
    name: str
    about: str
    begun: int = 1
    ended: bool = False
    value: Any = None
    raised: dict[str, Any] | None = None
    stopped: bool = False  # a person's stop cut it short
    answered: bool = False  # a person said what a stop before it was about
    late: dict[str, Any] | None = None  # what a model call that was abandoned came to
    cut: bool = False  # it does not count any more: a resumed run does it anew
    aside: bool = False  # it happened within another effect or in another thread, and is not replayed in order


@attrs.frozen(eq=False)
class History:
    """A run log as read. ``effects``: all of them, in the order in which they began."""

    head: dict[str, Any]
    effects: tuple[LogEntry, ...] = ()
    parts: tuple[dict[str, Any], ...] = ()
    ended: str = ""  # why there is nothing to resume
    wall_s: float = 0.0  # of all parts together
    book: tuple[int | None, float] = (None, 0.0)  # the skillbook's generation as the run knew it last, and when
    cut: int | None = None  # from this effect on nothing counts, which the log does not say yet: the run was killed

    @property
    def replayed(self) -> tuple[LogEntry, ...]:
        """The effects that are replayed in a resumed run; the last one may have no end."""
        return tuple(entry for entry in self.effects if not (entry.cut or entry.aside))


def read_history(folder: Path, records: Sequence[dict[str, Any]]) -> History:
    """The history in the lines of a log. Raises ``InvalidArgument``, which names an inconsistent line."""
    head, effects, parts = records[0], dict[int, LogEntry](), list[dict[str, Any]]()
    ended, wall, first, last = "", 0.0, 0.0, 0.0
    book: tuple[int | None, float] = (None, 0.0)
    for line, record in enumerate(records[1:], start=2):
        try:
            if "part" in record:
                wall += last - first
                first = record["t"]
                parts.append(record)
            elif "begin" in record:
                _begin(effects, record)
            elif "end" in record:
                _end(effects[record["n"]], record)
            elif "late" in record:
                effects[record["late"]].late = record["value"]
            elif "cut" in record:
                _cut(effects.values(), record["cut"])
            elif "ended" in record:
                ended = str(record["ended"])
            last = float(record["t"])
            if record.get("book") is not None:
                book = (int(record["book"]), last)
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise damaged(folder / FILE, line, f"{type(error).__name__}: {error}") from None
    cut = _first_not_replayed([entry for entry in effects.values() if not (entry.cut or entry.aside)])
    if cut is not None:
        _cut(effects.values(), cut)
    return History(head, tuple(effects.values()), tuple(parts), ended, wall + last - first, book, cut)


def _begin(effects: dict[int, LogEntry], record: dict[str, Any]) -> None:
    number = int(record["n"])
    if number in effects:
        effects[number].begun += 1
    else:
        effects[number] = LogEntry(number, str(record["begin"]), str(record["about"]), aside=bool(record.get("aside")))


def _end(entry: LogEntry, record: dict[str, Any]) -> None:
    if entry.name != record["end"]:
        raise ValueError(f"entry {entry.number} began as {entry.name!r}")
    entry.ended, entry.value, entry.raised = True, record.get("value"), record.get("raised")
    entry.stopped = bool(record.get("stopped")) or (entry.raised or {}).get("type") == "Stopped"
    entry.answered = bool(record.get("answered"))


def _cut(effects: Iterable[LogEntry], number: int) -> None:
    for entry in effects:
        entry.cut = entry.cut or entry.number >= number


def _first_not_replayed(effects: list[LogEntry]) -> int | None:
    """For a killed run, these are repeated: effects after one that never ended, a stop that no person had answered, and
    an error that was the last entry."""
    for index, entry in enumerate(effects):
        if not entry.ended:
            stop = unanswered_stop(effects[:index])
            after = effects[index + 1].number if index + 1 < len(effects) else None
            return stop if stop is not None else after
    number = unanswered_stop(effects)
    if number is None and effects and effects[-1].raised is not None:
        number = effects[-1].number
    return number


def unanswered_stop(effects: Sequence[LogEntry]) -> int | None:
    """The first effect that was stopped after the last answered stop; None if every stop was answered."""
    found = None
    for entry in effects:
        if entry.answered:
            found = None
        elif entry.stopped and found is None:
            found = entry.number
    return found
