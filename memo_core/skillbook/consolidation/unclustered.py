"""A book without the changes of clustering, which `memo-c` and `droc-v` read when other methods cluster the book, or
without functions only; or without what was clustered after a revision, which a run reads that is clustered beside."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import attrs
import sqlalchemy as sa

from memo_core.skillbook.consolidation.condensing import CLUSTERED, DUPLICATES
from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.store.origins import IMPORTED
from memo_core.skillbook.vectors.text_vectors import batched
from memo_core.skillbook.writing.adding import CLUSTER, FUNCTION
from memo_core.skillbook.writing.functions import FUNCTIONS, SAME_WORDS
from memo_core.skillbook.writing.orphaned_calls import calls_to_templates

_E, _R, _C = tables.entries.c, tables.revisions.c, tables.changes.c
CLUSTERING = (CLUSTERED, DUPLICATES, FUNCTIONS, SAME_WORDS)  # how the reasons of all its revisions begin
_DERIVED = ("vectors",)  # tables that are not copied
_CHUNK = 500


@attrs.frozen
class LeftOut:
    """Revisions of clustering that a copy goes without: those for some reasons, and all after a revision."""

    reasons: tuple[str, ...] = ()
    after: int | None = None  # None: only those for the reasons

    def __bool__(self) -> bool:
        return bool(self.reasons) or self.after is not None


def has_changes(database: Database, connection: sa.Connection, left_out: LeftOut) -> bool:
    """Whether these revisions superseded an entry that is still superseded, or is again."""
    revisions = _revisions(left_out)
    gave_way: sa.ColumnElement[bool] = _E.superseded_by.in_(revisions)
    if database.has(connection, tables.changes):
        gave_way = sa.or_(gave_way, _gave_way_to(sa.select(_E.id).where(_made(revisions))))
    return connection.execute(sa.select(_E.id).where(gave_way).limit(1)).first() is not None


def state_of(database: Database, connection: sa.Connection) -> tuple[int, int]:
    """The state of a book that a copy depends on, as numbers that grow: generation, and uses of entries."""
    used = sa.select(sa.func.sum(tables.records.c.uses))
    uses = connection.execute(used).scalar() if database.has(connection, tables.records) else 0
    return int(database.meta(connection)["generation"]), int(uses or 0)


def copy_without(database: Database, copy: Database, left_out: LeftOut) -> None:
    """Fill ``copy``, an open and empty book, with everything in ``database`` except the changes of these revisions.
    Entries keep their numbers. Edits and removals that people made afterwards are kept, and calls that were approved
    afterwards become templates."""
    with database.read() as connection, copy.write() as target:
        for table in tables.metadata.sorted_tables:
            if table.name in _DERIVED or not database.has(connection, table):
                continue
            if table.name == tables.meta.name:
                target.execute(sa.delete(table))
            for rows in batched(connection.execute(sa.select(table)).mappings(), _CHUNK):
                target.execute(sa.insert(table), [dict(row) for row in rows])
        _undo(target, left_out)


def _undo(connection: sa.Connection, left_out: LeftOut) -> None:
    clusterings = set(queries.ids_of(connection.execute(_revisions(left_out))))
    made = _made(clusterings)
    merged = {entry.id: entry for entry in queries.entries_where(connection, made)}
    because = sa.or_(_C.revision.in_(clusterings), _C.because.in_(merged))
    query = sa.select(_C.revision, _C.entry, _C.because).where(_C.change == "superseded", because)
    gave_way_to = {(row.revision, row.entry): row.because for row in connection.execute(query)}
    gave_way = sa.or_(_E.superseded_by.in_(clusterings), _gave_way_to(merged))
    retired = queries.entries_where(connection, gave_way, sa.not_(made))
    back = [entry.id for entry in retired if _stands(entry, clusterings, merged, gave_way_to)]
    mine = sa.update(tables.entries)
    for part in batched(back, _CHUNK):
        connection.execute(mine.where(_E.id.in_(part)).values(superseded_by=None))
    edited = _E.kind == "function"
    connection.execute(mine.where(sa.or_(made, edited), _E.superseded_by.is_(None)).values(superseded_by=_E.revision))
    calls_to_templates(connection)


def _stands(
    entry: Entry, clusterings: set[int], merged: dict[int, Entry], gave_way_to: dict[tuple[int, int], int | None]
) -> bool:
    """Whether only clustering superseded an entry, and likewise the entries into which it was merged, recursively."""
    at: Entry | None = entry
    while at is not None and at.superseded_by is not None:
        heir = merged.get(gave_way_to.get((at.superseded_by, at.id)) or 0)
        if heir is None and at.superseded_by not in clusterings:
            return False
        at = heir
    return True


def _made(revisions: Iterable[int] | sa.Select[tuple[int]]) -> sa.ColumnElement[bool]:
    """Whether an entry was made by one of these revisions of clustering."""
    return sa.and_(_E.phase.in_((CLUSTER, FUNCTION)), _E.revision.in_(revisions))


def _gave_way_to(merged: Iterable[int] | sa.Select[tuple[int]]) -> sa.ColumnElement[bool]:
    """Whether an entry is superseded because of one of these, also if that was undone and done again."""
    because = sa.select(_C.entry).where(_C.because.in_(merged), _C.change == "superseded")
    return _E.id.in_(because.where(_C.revision == _E.superseded_by).correlate(tables.entries))


def _revisions(left_out: LeftOut) -> sa.Select[tuple[int]]:
    wanted = [_made_for(left_out.reasons)]
    if left_out.after is not None:
        wanted.append(sa.and_(_R.id > left_out.after, _made_for(CLUSTERING)))
    return sa.select(_R.id).where(sa.or_(*wanted))


def _made_for(reasons: Sequence[str]) -> sa.ColumnElement[bool]:
    """Whether a revision was made for one of these reasons, here or in an imported book."""
    wanted = [prefix + word for prefix in ("", IMPORTED) for word in reasons]
    return sa.or_(sa.false(), *(_R.reason.startswith(reason, autoescape=True) for reason in wanted))
