"""Exchange with other books: export, merging, and lessons taught elsewhere."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.sharing import export as export_records, importing
from memo_core.skillbook.sharing.import_records import ImportRecords
from memo_core.skillbook.sharing.importing import Imported, ImportedBook
from memo_core.skillbook.store.origins import origins_of
from memo_core.skillbook.writing import bulk_adding
from memo_core.skillbook.writing.bulk_adding import Lesson


def export(book: Skillbook) -> Iterator[dict[str, Any]]:
    """Everything in the book except vectors, as JSON-compatible records (``memo_core.skillbook.sharing.export``) of
    the state at the first iteration. Records are read during iteration, so a large book needs little memory."""
    with book.database.read() as connection:
        yield from export_records.records(book.database, connection)


def merge(
    book: Skillbook, records: ImportRecords | Iterable[dict[str, Any]], name: str, dry_run: bool = False
) -> Imported:
    """Merge the records of another book (``export``), all or none: new rows are added with their origin. A second
    call changes nothing. ``name`` says whose book it is. Raises ``BadImport``, ``ReadOnlyBook``."""
    imported, gone = importing.merge(book.database, records, name, dry_run)
    if book.vectors is not None:
        book.vectors.forget(gone)
    if imported.withdrawn and not dry_run:
        book.database.erase_traces()
    return imported


def imported_books(book: Skillbook) -> list[ImportedBook]:
    """Books that were merged into this one, with the time of each merge."""
    with book.database.read() as connection:
        return importing.imported_books(book.database, connection)


def origin(book: Skillbook, entry_id: int) -> tuple[str, str]:
    """The book an entry was made in, and its number there."""
    with book.database.read() as connection:
        name = book.database.meta(connection)["book"]
        return origins_of(book.database, connection, "entry", name).origin(entry_id)


def add_many(book: Skillbook, lessons: Sequence[Lesson]) -> int:
    """Store lessons that were taught elsewhere, all or none, in one durable transaction: a thousand at a time is
    much faster than one by one. Calling it twice stores them twice. Returns the number of entries. Raises
    ``ReadOnlyBook``."""
    with book.database.write() as connection:
        return bulk_adding.add_lessons(book.database, connection, lessons)
