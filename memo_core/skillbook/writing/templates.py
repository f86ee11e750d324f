"""Versions of templates: under one key, one version for things that are built alike is retrieved; the others stay in
the book with their record.

Approved code becomes the new version, because it worked most recently and includes earlier corrections. A version whose
code is corrected is replaced by an older one with a better record: the share of approvals, (confirmed uses + 1) / (uses
+ 1), counting the approval that created it; the newest if several are equal. Only uses for the template's own key
count. A version that fails when it is retested in a simulator is replaced by one that does not, whatever their records.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable, Mapping, Sequence

import attrs
import sqlalchemy as sa

from memo_core.skillbook.model.entries import PROGRAM_KINDS, Entry
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.structural_similarity import BuiltDifferently
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.store.superseding import restore, supersede
from memo_core.skillbook.store.trials import failing
from memo_core.skillbook.writing.orphaned_calls import calls_to_templates

_E, _R, _K, _C = tables.entries.c, tables.records.c, tables.keys.c, tables.changes.c


@attrs.frozen
class Records:
    """How often entries were served to code for one key, and how often that was approved."""

    of: dict[tuple[int, Key], tuple[int, int]]

    def record(self, entry: int, key: Key) -> tuple[int, int]:
        """(uses, confirmed uses)."""
        return self.of.get((entry, key), (0, 0))

    def failed(self, entry: int, key: Key) -> bool:
        """Whether code for ``key`` for which the entry was served was corrected."""
        uses, confirmed = self.record(entry, key)
        return uses > confirmed

    def share(self, entry: Entry) -> float:
        """Share of approvals under the entry's own key, including the one that created it."""
        uses, confirmed = self.record(entry.id, entry.key)
        return (confirmed + 1) / (uses + 1)


def records_of(database: Database, connection: sa.Connection, entries: Iterable[int] | None = None) -> Records:
    """Of all entries, or of some."""
    if not database.has(connection, tables.records):
        return Records({})
    query = sa.select(_R.entry, _K.action, _K.objects, _R.uses, _R.confirmed_uses).join(tables.keys, _R.key == _K.id)
    if entries is not None:
        query = query.where(_R.entry.in_(list(entries)))
    return Records(
        {
            (entry, queries.key_of(action, objects)): (uses, confirmed)
            for entry, action, objects, uses, confirmed in connection.execute(query)
        }
    )


def count_use(connection: sa.Connection, entries: Iterable[int], key: int, success: bool) -> None:
    """Add one use for a key to entries' records, inside a write transaction."""
    for entry in entries:
        where = (_R.entry == entry, _R.key == key)
        values = {"uses": _R.uses + 1, "confirmed_uses": _R.confirmed_uses + int(success)}
        changed = connection.execute(sa.update(tables.records).where(*where).values(**values))
        if not changed.rowcount:
            queries.insert_plain(connection, tables.records, entry=entry, key=key, uses=1, confirmed_uses=int(success))


def same_code(one: str, other: str) -> bool:
    """Whether two functions differ only in comments and layout."""
    try:
        return ast.dump(ast.parse(one)) == ast.dump(ast.parse(other))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return one.split() == other.split()


def served_version(connection: sa.Connection, key: int, code: str) -> Entry | None:
    """The active version under a key that is exactly this code."""
    valid = queries.entries_where(connection, _E.key == key, _E.kind.in_(PROGRAM_KINDS), _E.superseded_by.is_(None))
    return next((entry for entry in valid if same_code(entry.text, code)), None)


def succeed(connection: sa.Connection, key: int, revision: int, newest: int) -> None:
    """Make the version ``newest`` replace those under its key for things that are built alike, inside a write
    transaction."""
    valid = queries.entries_where(connection, _E.key == key, _E.kind.in_(PROGRAM_KINDS), _E.superseded_by.is_(None))
    differ = BuiltDifferently(connection, valid)
    for entry in valid:
        if entry.id != newest and not differ(newest, entry.id):
            supersede(connection, revision, entry.id, f"newer version {newest}", newest)


def elect(database: Database, connection: sa.Connection, key: int, reason: str) -> int | None:
    """Activate the best version under a key for each way its things are built, inside a write transaction; a version
    that was rolled back is not a candidate. Returns the revision, or None if nothing had to change."""
    every = queries.entries_where(connection, _E.key == key, _E.kind.in_(PROGRAM_KINDS))
    gave_way = sa.select(_C.revision, _C.entry).where(
        _C.entry.in_([entry.id for entry in every]), _C.change == "superseded", _C.because.is_not(None)
    )
    outdone = {(row.revision, row.entry) for row in connection.execute(gave_way)}
    candidates = [one for one in every if one.superseded_by is None or (one.superseded_by, one.id) in outdone]
    ids = [entry.id for entry in candidates]
    merit = _merit(
        records_of(database, connection, ids), failing(database, connection, ids), _made_at(database, connection, ids)
    )
    elected = []
    for versions in _built_alike(connection, candidates):
        valid = [entry for entry in versions if entry.superseded_by is None]
        best = max(versions, key=merit)
        if valid and valid != [best]:
            elected.append((best, valid))
    if not elected:
        return None
    revision = queries.insert(connection, tables.revisions, key=key, time=database.now(), reason=reason)
    for best, valid in elected:
        for entry in valid:
            if entry.id != best.id:
                supersede(connection, revision, entry.id, f"version {best.id} has the better record", best.id)
        if best not in valid:
            restore(connection, revision, best.id, "the best record")
    calls_to_templates(connection)
    return revision


def _built_alike(connection: sa.Connection, entries: Sequence[Entry]) -> list[list[Entry]]:
    """The entries by how the things are built that they were made for, each with the newest that it is not unlike."""
    differ = BuiltDifferently(connection, entries)
    groups: list[list[Entry]] = []
    for entry in sorted(entries, key=lambda one: -one.id):
        group = next((some for some in groups if not differ(some[0].id, entry.id)), None)
        if group is None:
            groups.append([entry])
        else:
            group.append(entry)
    return groups


_MadeAt = tuple[float, str, int]  # time of the revision (s since the epoch), book, number there


def _merit(
    records: Records, failed: set[int], made_at: Mapping[int, _MadeAt]
) -> Callable[[Entry], tuple[bool, float, float, _MadeAt]]:
    return lambda entry: (entry.id not in failed, records.share(entry), entry.created, made_at[entry.id])


def _made_at(database: Database, connection: sa.Connection, entries: Sequence[int]) -> dict[int, _MadeAt]:
    """When entries were made: the same order in every book that has them, also of a call that is as old as its
    template."""
    origins, revisions = tables.origins.c, tables.revisions.c
    book = database.meta(connection)["book"]
    of = sa.select(origins.local, origins.book, origins.id).where(
        origins.kind == "entry", origins.local.in_(list(entries))
    )
    made_in = {row.local: (str(row.book), int(row.id)) for row in connection.execute(of) if row.id.isdecimal()}
    when = sa.select(_E.id, revisions.time).join(tables.revisions, _E.revision == revisions.id)
    return {
        entry: (float(time), *made_in.get(entry, (book, entry)))
        for entry, time in connection.execute(when.where(_E.id.in_(list(entries))))
    }
