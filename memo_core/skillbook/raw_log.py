"""The raw log of a book, from which the book of any method can be made anew."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager

from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.sharing import rebuild_input
from memo_core.skillbook.sharing.rebuild_input import RawLog


def raw_log(book: Skillbook, until: int | float | None = None) -> RawLog:
    """Feedback and the entries made of it (``memo_core.skillbook.sharing.rebuild_input``), up to and including
    feedback number ``until`` (an int), or before a time (a float, s since the epoch)."""
    with book.database.read() as connection:
        return rebuild_input.read_log(book.database, connection, until)


def kept_answer(book: Skillbook, model: str, question: str) -> str | None:
    """The stored answer of a model to a question (its digest), from an earlier rebuild from this book."""
    with book.database.read() as connection:
        return rebuild_input.kept_answer(book.database, connection, model, question)


def keep_answer(book: Skillbook, model: str, question: str, phase: str, answer: str, about: Iterable[int]) -> None:
    """Store an answer, with the feedback that its question was ``about``. Raises ``ReadOnlyBook``."""
    with book.database.write() as connection:
        rebuild_input.keep_answer(book.database, connection, model, question, phase, answer, about)


def rename(book: Skillbook, identity: str, created: float) -> None:
    """Give an empty book another identity (of at most 100 characters) and time of creation."""
    with book.database.write() as connection:
        book.database.set_meta(connection, "book", identity)
        book.database.set_meta(connection, "created", repr(created))


@contextmanager
def clock(book: Skillbook, now: Callable[[], float]) -> Iterator[None]:
    """Within the block, use ``now`` (s since the epoch) as the time of writes."""
    before, book.database.now = book.database.now, now
    try:
        yield
    finally:
        book.database.now = before
