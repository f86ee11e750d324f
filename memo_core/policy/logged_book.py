"""The skillbook as a run uses it: each read and each write is an effect in the run's log.

A write commits the number of its entry in the same transaction, so that after a crash the book itself says whether it
happened. The log contains ids, never what people said or what was derived from it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

import attrs

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.policy.run_context import Session
from memo_core.runlog.run_log import Effect, RunLog
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import Entry, Feedback, Note, Reaction
from memo_core.skillbook.model.keys import Key

T = TypeVar("T")


def pin(log: RunLog, book: Skillbook) -> None:
    """Retrieve in this run without what is clustered from now on; resumed, it pins the revision that it began with."""
    kind: Effect[int] = Effect("pin the skillbook")
    book.pin(log.effect(kind, "", lambda _: book.newest_revision()))


class LoggedBook:
    """Writes to the book of one run, and its pending feedback."""

    def __init__(self, session: Session, book: Skillbook) -> None:
        self._log = session.log
        self._run = session.run
        self._book = book

    # -- reading -------------------------------------------------------------------------------------------------------
    def pending_feedback(self) -> list[Feedback]:
        """Feedback that was not processed yet, oldest first."""
        kind: Effect[list[Feedback]] = Effect("pending feedback", _ids, self._feedback)
        return self._log.effect(kind, "", lambda _: self._book.pending_feedback())

    # -- writing -------------------------------------------------------------------------------------------------------
    def record_approval(self, record: Callable[[], int], about: str) -> int:
        """``record`` writes an approval; its id."""
        kind: Effect[int] = Effect("record an approval", outside=True)
        return self._log.effect(kind, about, lambda entry: self._write(entry, lambda _: record()), self._recorded)

    def add_notes(self, feedback_id: int, notes: Sequence[Note], scene: str = "") -> tuple[Entry, ...]:
        """As ``Skillbook.add_notes``, which is idempotent."""
        kind: Effect[tuple[Entry, ...]] = Effect("add notes", _ids, self._entries, outside=True)
        return self._log.effect(
            kind,
            f"feedback {feedback_id}",
            lambda entry: self._write(entry, lambda book: book.add_notes(feedback_id, notes, scene)),
        )

    def read_back(self, feedback_id: int, said: Sequence[Reaction]) -> tuple[Entry, ...]:
        """As ``Skillbook.read_back``, which is idempotent."""
        kind: Effect[tuple[Entry, ...]] = Effect("apply a read-back", _ids, self._entries, outside=True)
        return self._log.effect(
            kind,
            f"feedback {feedback_id}",
            lambda entry: self._write(entry, lambda book: book.read_back(feedback_id, said)),
        )

    def add_template(self, approval: int, key: Key | str, code: str, scene: str, derived_from: Sequence[int]) -> Entry:
        """As ``Skillbook.add_template``, which is idempotent."""
        kind: Effect[Entry] = Effect(
            "add a template", lambda entry: [entry.id], lambda ids: self._entries(ids)[0], outside=True
        )
        return self._log.effect(
            kind,
            f"approval {approval}",
            lambda entry: self._write(entry, lambda book: book.add_template(approval, key, code, scene, derived_from)),
        )

    def add_call(
        self, approval: int, key: Key | str, call: str, function: int, scene: str, derived_from: Sequence[int]
    ) -> Entry:
        """Store an approved call, as ``Skillbook.add_call`` does, which is idempotent."""
        kind: Effect[Entry] = Effect(
            "add a call", lambda entry: [entry.id], lambda ids: self._entries(ids)[0], outside=True
        )
        given = (approval, key, call, function, scene, derived_from)
        return self._log.effect(
            kind, f"approval {approval}", lambda entry: self._write(entry, lambda book: book.add_call(*given))
        )

    def park(self, feedback_id: int, reason: str) -> None:
        """As ``Skillbook.park``, which is idempotent."""
        kind: Effect[None] = Effect("set feedback aside", outside=True)
        self._log.effect(
            kind,
            f"feedback {feedback_id}",
            lambda entry: self._write(entry, lambda book: book.park(feedback_id, reason)),
        )

    def note_use(self, entry_ids: Sequence[int], success: bool, subtask: Key | str) -> None:
        """As ``Skillbook.note_use``."""
        kind: Effect[bool] = Effect("count uses", outside=True)

        def count(book: Skillbook) -> bool:
            book.note_use(entry_ids, success, subtask)
            return True

        self._log.effect(
            kind, str(subtask), lambda entry: self._write(entry, count), lambda entry: self._happened(entry) or None
        )

    def _write(self, entry: int, write: Callable[[Skillbook], T]) -> T:
        with self._book.effect_of(self._run, entry):
            written = write(self._book)
        self._log.note_book(self._book.generation())
        return written

    def _happened(self, entry: int) -> bool:
        return self._book.effect_note(self._run, entry) is not None

    def _recorded(self, entry: int) -> int | None:
        return max(one.id for one in self._book.feedback_of_run(self._run)) if self._happened(entry) else None

    # -- by id ---------------------------------------------------------------------------------------------------------
    def _feedback(self, ids: list[int]) -> list[Feedback]:
        return [feedback_of(self._book, number) for number in ids]

    def _entries(self, ids: list[int]) -> tuple[Entry, ...]:
        return entries_of(self._book, ids)


@attrs.frozen(eq=False)
class BookWordStore:
    """Keeps a correction of one attempt in the book, as feedback (``memo_core.policy.logged_person.WordStore``)."""

    run: str
    book: Skillbook
    record: Callable[[str], int]  # writes the words with what they are about; their id

    def keep(self, words: str, entry: int, state: str) -> int:
        with self.book.effect_of(self.run, entry, state):
            return self.record(words)

    def kept(self, entry: int) -> tuple[int, str, str] | None:
        note = self.book.effect_note(self.run, entry)
        if note is None:
            return None
        newest = max(self.book.feedback_of_run(self.run), key=lambda one: one.id)
        return newest.id, newest.words, note

    def read(self, number: int) -> str:
        return feedback_of(self.book, number).words


def feedback_of(book: Skillbook, number: int) -> Feedback:
    """Feedback that a run's log refers to. Raises ``InvalidArgument`` if it was removed."""
    try:
        return book.feedback(number)
    except UnknownName:
        problem = f"feedback {number} of this run is not in the skillbook any more (forget)"
        raise InvalidArgument("--resume", problem, "the skillbook that the run began with") from None


def entries_of(book: Skillbook, ids: Sequence[int]) -> tuple[Entry, ...]:
    """Entries that a run's log refers to. Raises ``InvalidArgument`` if one was removed."""
    try:
        return tuple(book.entry(number) for number in ids)
    except UnknownName as error:
        problem = f"entry {error.name} of this run is not in the skillbook any more (forget)"
        raise InvalidArgument("--resume", problem, "the skillbook that the run began with") from None


def _ids(values: Sequence[Feedback | Entry]) -> list[int]:
    return [value.id for value in values]
