"""The durable log of a run. Everything in a run that is not pure computation goes through it.

``RunLog.effect`` writes one entry when an effect begins and one when it has ended. An interrupted run is resumed by
running *the same code again*: every effect is answered from the log, in order, until the log ends; from then on effects
take place. So the code of a run needs no special case for resuming (durable execution).
"""

from __future__ import annotations

import threading
import zlib
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Generic, TypeVar

import attrs
import cattrs

from memo_core.errors import InvalidArgument, MemoError, Stopped
from memo_core.runlog.log_file import VERSION, LogFile
from memo_core.runlog.log_history import History, LogEntry, unanswered_stop
from memo_core.runlog.whole_files import write_whole
from memo_core.text.redaction import Redactor

T = TypeVar("T")
_UNREADABLE = (KeyError, TypeError, ValueError, AttributeError, OverflowError, zlib.error, cattrs.BaseValidationError)


def _same(value: Any) -> Any:
    return value


@attrs.frozen
class Effect(Generic[T]):
    """One kind of effect: its name in the log, and how its result is converted to JSON and back. ``outside``: it
    changes something outside this process (money, motion, people, the book), so both entries are flushed to disk before
    the run continues. ``world``: it needs the world in the state in which the run left it; if that cannot be restored
    and no person confirms it, the effect is in doubt. ``confirms``: its result True is such a confirmation.
    ``answers_stop``: a person said why they pressed stop. ``errors``: exceptions that are logged like results.
    """

    name: str
    keep: Callable[[T], Any] = _same
    read: Callable[[Any], T] = _same
    outside: bool = False
    world: bool = False
    confirms: bool = False
    answers_stop: bool = False
    errors: tuple[type[MemoError], ...] = ()


@attrs.define(auto_exc=True, eq=False)
class LogMismatch(MemoError):
    """A resumed run requested a different effect than the one in its log at this position."""

    log: str
    entry: int
    logged: str
    wanted: str

    def __str__(self) -> str:
        return (
            f"{self.log}, entry {self.entry}: the run did {self.logged}, and now wants {self.wanted}; it cannot be "
            "resumed with this version, book or configuration"
        )


@attrs.define(auto_exc=True, eq=False)
class InDoubt(MemoError):
    """It is unknown what an effect did to a world that cannot be restored, so it is not repeated."""

    entry: int
    effect: str

    def __str__(self) -> str:
        return f"entry {self.entry} ({self.effect}) began before the process was interrupted; its outcome is unknown"


class RunLog:
    """The log of one run. ``effect`` belongs to one thread; ``aside`` and ``late`` may be called from any."""

    def __init__(
        self, folder: Path | None = None, history: History | None = None, seen: frozenset[str] = frozenset()
    ) -> None:
        """``folder`` None: in memory, for work that is never resumed. ``history``: the log of an interrupted run;
        ``seen``: the positions of the events that it sent (``place``)."""
        self.folder = folder
        self.history = history
        self.world_known = history is None  # whether the world is as the log says it is; else a person must look
        self._redact = Redactor.of_environment()
        self._file: LogFile | None = None
        self.live = history is None  # whether anything happened that was not answered from the log
        self._replay = deque(history.replayed if history is not None else ())
        self._kept = _kept_answers(history)
        self._open_asides = _open_asides(history)
        self._numbering = threading.Lock()
        self._done: list[LogEntry] = []
        self._next = max((entry.number for entry in history.effects), default=0) + 1 if history is not None else 1
        self._before_live: list[Callable[[], None]] = []
        self._inside = False
        self._thread = 0
        self._seen = seen
        self._last = self._since = 0

    # -- life ----------------------------------------------------------------------------------------------------------
    def begin(self, head: dict[str, Any], part: dict[str, Any]) -> int:
        """Open the file and write the header lines: ``head`` once per run, ``part`` for each process. Returns the
        number of bytes of an incomplete last line that were removed."""
        if self.folder is None:
            return 0
        self._file = LogFile(self.folder)
        if self.history is None:
            self._file.append({"memo_run_log": VERSION, **head}, sync=False)
        elif self.history.cut is not None:
            self._file.append({"cut": self.history.cut}, sync=False)
        self._file.append({"part": self.part, **part}, sync=True)
        return self._file.cut

    @property
    def part(self) -> int:
        """1 is the first; more in a resumed run."""
        return 1 if self.history is None else len(self.history.parts) + 1

    def close(self) -> None:
        """Idempotent."""
        if self._file is not None:
            self._file.close()

    def end(self, reason: str) -> None:
        """The run has come to its end: there is nothing to resume."""
        self._append({"ended": reason}, sync=True)

    def cut_off(self) -> None:
        """The run was interrupted and may be resumed. The unanswered stop, or else the effect that failed last, is then
        repeated."""
        number = unanswered_stop(self._done)
        if number is None:
            number = next((entry.number for entry in reversed(self._done) if entry.raised is not None), None)
        if number is not None:
            self._append({"cut": number}, sync=True)

    @property
    def begun(self) -> bool:
        """Whether the log has any effect."""
        return bool(self._done or self._replay)

    def count(self, name: str) -> int:
        """How many effects of this name have ended so far: the same in a resumed run."""
        return sum(entry.name == name and entry.ended for entry in self._done)

    # -- effects -------------------------------------------------------------------------------------------------------
    @property
    def replaying(self) -> bool:
        """Whether the next effect is answered from the log."""
        return bool(self._replay) and self._replay[0].ended

    def before_live(self, action: Callable[[], None]) -> None:
        """Register a function to be called once, right before the first effect of a resumed run that is not answered
        from the log."""
        if self.history is not None:
            self._before_live.append(action)

    def go_live(self) -> None:
        """Call the functions registered with ``before_live``, in order, unless they were called already."""
        actions, self._before_live = self._before_live, []
        for action in actions:
            action()

    def effect(
        self,
        kind: Effect[T],
        about: str,
        do: Callable[[int], T],
        recover: Callable[[int], T | None] | None = None,
        equivalent: Callable[[int, str], bool] = lambda number, logged: False,
    ) -> T:
        """Call ``do(entry number)`` with an entry before and after it, or return the logged result.

        Args:
            kind: the kind of effect.
            about: identifies the effect within its kind, without secrets or words of people; the same when resumed.
            do: takes the entry's number and has the effect.
            recover: finds out whether an effect without an end in the log took place nevertheless: its result, or None.
            equivalent: whether an entry of this kind, given its number and its different ``about``, is this effect.

        Returns:
            The result, from the log if the effect took place before the run was resumed.

        Raises:
            LogMismatch: if the log has another effect at this position.
            InDoubt: if it is unknown what an interrupted effect did to a world that cannot be restored.
        """
        self._thread = threading.get_ident()
        entry = self._replay.popleft() if self._replay else None
        if entry is not None and not (
            entry.name == kind.name and (entry.about == about or equivalent(entry.number, entry.about))
        ):
            raise LogMismatch(str(self.folder), entry.number, f"{entry.name} ({entry.about})", f"{kind.name} ({about})")
        if entry is not None and entry.ended:
            self._advance(entry)
            return self._again(kind, entry)
        return self._live(kind, about, do, recover, entry)

    def _again(self, kind: Effect[T], entry: LogEntry) -> T:
        try:
            if entry.raised is not None:
                raise _error_of(kind, entry)
            return kind.read(entry.value)
        except _UNREADABLE as error:
            problem = f"{self.folder}, entry {entry.number} ({entry.name}) is damaged: {error!r}"
            raise InvalidArgument("--resume", problem, "the log as the run wrote it, and its version of MEMO") from None

    def _live(
        self,
        kind: Effect[T],
        about: str,
        do: Callable[[int], T],
        recover: Callable[[int], T | None] | None,
        begun: LogEntry | None,
    ) -> T:
        self.go_live()
        self.live = True
        entry = begun
        if entry is None:
            entry = LogEntry(self._number(), kind.name, about)
        self._advance(entry)
        self._inside = True
        try:
            found = recover(entry.number) if begun is not None and recover is not None else None
            if found is not None:
                self._end(kind, entry, found)
                return found
            self._append({"n": entry.number, "begin": kind.name, "about": about}, sync=kind.outside)
            if kind.world and not self.world_known:
                raise InDoubt(entry.number, kind.name)
            value = do(entry.number)
            self._end(kind, entry, value)
            self.world_known = self.world_known or (kind.confirms and bool(value))
            return value
        except MemoError as error:
            if isinstance(error, (*kind.errors, Stopped, InDoubt)):
                self._raised(kind, entry, error)
            raise
        finally:
            self._inside = False

    def _number(self) -> int:
        with self._numbering:
            number, self._next = self._next, self._next + 1
        return number

    def aside(
        self, kind: Effect[T], about: str, do: Callable[[int], T], recover: Callable[[int], T | None] | None = None
    ) -> T:
        """Log an effect that happens within another effect or in another thread, such as a question asked in a look.

        A resumed run does not replay it in order: what encloses it is answered as a whole, or takes place again, and
        then finds the result by ``about`` (``kept``). Arguments as for ``effect``.
        """
        begun = self._open_asides.pop(about, None)
        entry = LogEntry(self._number() if begun is None else begun, kind.name, about, aside=True)
        try:
            found = recover(entry.number) if begun is not None and recover is not None else None
            if found is None:
                record = {"n": entry.number, "begin": kind.name, "about": about, "aside": True}
                self._append(record, sync=kind.outside)
                found = do(entry.number)
        except MemoError as error:
            if isinstance(error, (*kind.errors, Stopped)):
                self._raised(kind, entry, error)
            raise
        self._end(kind, entry, found)
        return found

    def _advance(self, entry: LogEntry) -> None:
        self._done.append(entry)
        self._last, self._since = entry.number, 0

    def _end(self, kind: Effect[T], entry: LogEntry, value: T) -> None:
        entry.ended, entry.value, entry.answered = True, kind.keep(value), kind.answers_stop
        entry.stopped = bool(getattr(value, "stopped", False))
        marks = {name: True for name in ("stopped", "answered") if getattr(entry, name)}
        self._append({"n": entry.number, "end": kind.name, "value": entry.value, **marks}, sync=kind.outside)

    def _raised(self, kind: Effect[T], entry: LogEntry, error: MemoError) -> None:
        entry.ended, entry.stopped = True, isinstance(error, Stopped)
        entry.raised = {"type": type(error).__name__, **cattrs.unstructure(error)}
        self._append({"n": entry.number, "end": kind.name, "raised": entry.raised}, sync=kind.outside)

    # -- results outside of the order ----------------------------------------------------------------------------------
    def late(self, number: int, value: dict[str, Any]) -> None:
        """Log the late result of an effect that had been abandoned. From any thread."""
        self._append({"late": number, "value": value}, sync=True)

    def kept(self, about: str) -> Any:
        """The value of a finished effect that could not be replayed in order because it was abandoned, cut or an aside;
        each value is returned once. None if there is none."""
        values = self._kept.get(about)
        return values.popleft() if values else None

    def leave_order(self) -> None:
        """Stop replaying in order; the remaining logged values are available through ``kept``."""
        for entry in self._replay:
            _keep_answer(self._kept, entry)
        self._replay.clear()

    # -- files beside the log ------------------------------------------------------------------------------------------
    def write(self, name: str, text: str) -> str:
        """Write a complete file into the run's folder, with secrets removed; on disk when this returns. Returns its
        name ("" in memory)."""
        if self.folder is None:
            return ""
        write_whole(self.folder / name, self._redact(text))
        return name

    # -- events --------------------------------------------------------------------------------------------------------
    def place(self) -> str | None:
        """Position of the next event in the run (the entry it follows, and its index after that entry), so that it is
        sent once however often the run is resumed. None within an effect or from another thread; "" if it was sent
        already."""
        if self._inside or threading.get_ident() != self._thread:
            return None
        place = f"{self._last}.{self._since}"
        self._since += 1
        return "" if place in self._seen else place

    def note_book(self, generation: int) -> None:
        """Log the skillbook's generation as known to the run, so that a resumed run can detect changes by others."""
        self._append({"book": generation}, sync=False)

    def _append(self, record: dict[str, Any], sync: bool) -> None:
        if self._file is not None:
            self._file.append(record, sync)


class AsideLog(RunLog):
    """A run's log for calls within its effects or from other threads: what changes something outside the process is
    logged by ``RunLog.aside``, anything else just happens."""

    def __init__(self, log: RunLog) -> None:
        super().__init__(log.folder)
        self._log = log

    def effect(
        self,
        kind: Effect[T],
        about: str,
        do: Callable[[int], T],
        recover: Callable[[int], T | None] | None = None,
        equivalent: Callable[[int, str], bool] = lambda number, logged: False,
    ) -> T:
        return self._log.aside(kind, about, do, recover) if kind.outside else do(0)

    def late(self, number: int, value: dict[str, Any]) -> None:
        self._log.late(number, value)

    def kept(self, about: str) -> Any:
        return self._log.kept(about)


def _error_of(kind: Effect[Any], entry: LogEntry) -> MemoError:
    record = dict(entry.raised or {})
    name = record.pop("type")
    known: Sequence[type[MemoError]] = (*kind.errors, Stopped, InDoubt)
    [error] = [cattrs.structure(record, error) for error in known if error.__name__ == name]
    return error


def _kept_answers(history: History | None) -> dict[str, deque[Any]]:
    kept: dict[str, deque[Any]] = {}
    for entry in history.effects if history is not None else ():
        if entry.cut or entry.aside or entry.late is not None:
            _keep_answer(kept, entry)
    return kept


def _open_asides(history: History | None) -> dict[str, int]:
    """Asides without an end: about -> number."""
    effects = history.effects if history is not None else ()
    return {one.about: one.number for one in effects if one.aside and not one.ended and one.late is None}


def _keep_answer(kept: dict[str, deque[Any]], entry: LogEntry) -> None:
    value = entry.late if entry.late is not None else entry.value
    if value is not None and (entry.raised is None or entry.late is not None):
        kept.setdefault(entry.about, deque()).append(value)
