"""The unclustered state of a book, which `memo-c` and `droc-v` read when other methods cluster the book."""

from __future__ import annotations

import sqlalchemy as sa

from memo_core.skillbook.consolidation.condensing import CLUSTERED, DUPLICATES
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.sharing.export import IMPORTED
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.vectors.text_vectors import batched
from memo_core.skillbook.writing.adding import CLUSTER

_E, _R, _C = tables.entries.c, tables.revisions.c, tables.changes.c
_DERIVED = ("vectors",)  # tables that are not copied
_CHUNK = 500


def is_clustered(database: Database, connection: sa.Connection) -> bool:
    """Whether clustering superseded an entry that is still superseded."""
    return connection.execute(sa.select(_E.id).where(_E.superseded_by.in_(_clusterings())).limit(1)).first() is not None


def copy_without_clustering(database: Database, copy: Database) -> None:
    """Fill ``copy``, an open and empty book, with everything in ``database`` except the changes of clustering. Entries
    keep their numbers. Edits and removals that people made after clustering are kept."""
    with database.read() as connection, copy.write() as target:
        for table in tables.metadata.sorted_tables:
            if table.name in _DERIVED or not database.has(connection, table):
                continue
            if table.name == tables.meta.name:
                target.execute(sa.delete(table))
            for rows in batched(connection.execute(sa.select(table)).mappings(), _CHUNK):
                target.execute(sa.insert(table), [dict(row) for row in rows])
        _undo(target)


def _undo(connection: sa.Connection) -> None:
    clusterings = set(queries.ids_of(connection.execute(_clusterings())))
    merged = {entry.id: entry for entry in queries.entries_where(connection, _E.phase == CLUSTER)}
    query = sa.select(_C.revision, _C.entry, _C.because).where(_C.change == "superseded", _C.revision.in_(clusterings))
    gave_way_to = {(row.revision, row.entry): row.because for row in connection.execute(query)}
    retired = queries.entries_where(connection, _E.superseded_by.in_(clusterings), _E.phase != CLUSTER)
    back = [entry.id for entry in retired if _stands(entry, clusterings, merged, gave_way_to)]
    mine = sa.update(tables.entries)
    for part in batched(back, _CHUNK):
        connection.execute(mine.where(_E.id.in_(part)).values(superseded_by=None))
    connection.execute(mine.where(_E.phase == CLUSTER, _E.superseded_by.is_(None)).values(superseded_by=_E.revision))


def _stands(
    entry: Entry, clusterings: set[int], merged: dict[int, Entry], gave_way_to: dict[tuple[int, int], int | None]
) -> bool:
    """Whether only clustering superseded an entry, and likewise the entries into which it was merged, recursively."""
    at: Entry | None = entry
    while at is not None and at.superseded_by in clusterings:
        at = merged.get(gave_way_to.get((at.superseded_by or 0, at.id)) or 0)
    return at is None or at.superseded_by is None


def _clusterings() -> sa.Select[tuple[int]]:
    """Revisions made by clustering, here or in an imported book."""
    reasons = [prefix + word for prefix in ("", IMPORTED) for word in (CLUSTERED, DUPLICATES)]
    return sa.select(_R.id).where(sa.or_(*(_R.reason.startswith(reason, autoescape=True) for reason in reasons)))
