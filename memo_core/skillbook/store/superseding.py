"""Superseding and restoring entries. Both are stored as changes of a revision, with their reason."""

from __future__ import annotations

from collections.abc import Iterable

import sqlalchemy as sa

from memo_core.skillbook.store import queries, tables

_E, _C = tables.entries.c, tables.changes.c


def supersede(connection: sa.Connection, revision: int, entry: int, why: str, because: int | None = None) -> None:
    """Retire an entry by a revision, with the reason and its replacement, inside a write transaction."""
    connection.execute(sa.update(tables.entries).where(_E.id == entry).values(superseded_by=revision))
    _note(connection, revision, entry, "superseded", why, because)


def restore(connection: sa.Connection, revision: int, entry: int, why: str) -> None:
    """Make a retired entry active again by a revision, inside a write transaction."""
    connection.execute(sa.update(tables.entries).where(_E.id == entry).values(superseded_by=None))
    _note(connection, revision, entry, "restored", why, None)


def gave_way_to(connection: sa.Connection, entries: Iterable[int]) -> list[int]:
    """Retired entries that were superseded by one of ``entries`` and by nothing else."""
    query = (
        sa.select(_C.entry)
        .join(tables.entries, _C.entry == _E.id)
        .where(_C.because.in_(list(entries)), _C.change == "superseded", _C.revision == _E.superseded_by)
    )
    return sorted(queries.ids_of(connection.execute(query)))


def _note(connection: sa.Connection, revision: int, entry: int, change: str, why: str, because: int | None) -> None:
    queries.insert_plain(
        connection, tables.changes, revision=revision, entry=entry, change=change, why=why, because=because
    )
