"""Functions of a book and their calls: listing them, and storing what consolidation made of a group of programs."""

from __future__ import annotations

import attrs
import sqlalchemy as sa

from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.functions import Function, read_function
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.writing import functions
from memo_core.skillbook.writing.functions import FUNCTIONS, GroupChange

_E = tables.entries.c


@attrs.frozen
class LearntFunction:
    """An active function with its active calls."""

    entry: Entry
    calls: tuple[Entry, ...]

    @property
    def function(self) -> Function:
        return read_function(self.entry.text)


def functions_of(book: Skillbook) -> list[LearntFunction]:
    """The active functions of a book, oldest first."""
    database = book.database
    with database.read() as connection:
        valid = sa.and_(_E.kind == "function", _E.superseded_by.is_(None))
        return [
            LearntFunction(entry, tuple(functions.calls_of(database, connection, entry.id)))
            for entry in queries.entries_where(connection, valid)
        ]


def store(book: Skillbook, change: GroupChange, model: str = "") -> int | None:
    """Commit what consolidation made of a group.

    Args:
        book: the book.
        change: new functions with their calls, and notes (``GroupChange``).
        model: name of the model that proposed it; empty: none was asked.

    Returns:
        Number of the revision; None if nothing changed.

    Raises:
        GroupChanged: if the book changed meanwhile; nothing is written then.
        ReadOnlyBook: if the book is open read-only.
    """
    reason = f"{FUNCTIONS} by {model}" if model else FUNCTIONS
    with book.database.write() as connection:
        return functions.store_group(book.database, connection, change, reason, model)
