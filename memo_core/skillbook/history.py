"""Revisions: what each changed, the book's state after each, and rolling one back.

Superseded entries are not deleted, so any state can be read. A rollback is itself a revision and can be rolled back as
well."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import attrs
import sqlalchemy as sa

from memo_core.errors import MemoError, UnknownName
from memo_core.skillbook.book import Skillbook, meant
from memo_core.skillbook.consolidation.condensing import CONDENSED
from memo_core.skillbook.consolidation.rules import state_digest
from memo_core.skillbook.model.entries import PROGRAM_KINDS, Entry
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.store.superseding import restore, supersede
from memo_core.skillbook.vectors.text_vectors import batched
from memo_core.skillbook.writing.functions import take_keys_of_parts
from memo_core.skillbook.writing.orphaned_calls import calls_to_templates
from memo_core.skillbook.writing.templates import records_of

_E, _R, _C, _K = tables.entries.c, tables.revisions.c, tables.changes.c, tables.keys.c
_CHUNK = 500


@attrs.frozen
class Change:
    """A change that a revision made to an entry: ``added``, ``superseded``, ``restored``, or ``joined`` (moved from the
    key ``why``)."""

    change: str
    entry: Entry
    why: str = ""
    because: int | None = None  # the entry it gave way to


@attrs.frozen
class Revision:
    """One change to the set of valid entries."""

    id: int
    time: float  # s since the epoch
    reason: str
    key: Key | None  # None when the key is gone
    changes: tuple[Change, ...]

    def count(self, change: str) -> int:
        return sum(one.change == change for one in self.changes)


@attrs.frozen
class Version:
    """A template, or the call that stands in for one, with its record for its own key: ``state`` is served, superseded
    or rolled back."""

    entry: Entry
    state: str
    uses: int
    confirmed_uses: int


@attrs.frozen
class Difference:
    """Entries active at one time and not at the other, oldest first."""

    removed: tuple[Entry, ...]
    added: tuple[Entry, ...]


@attrs.define(auto_exc=True, eq=False)
class CannotRollBack(MemoError):
    """Later revisions depend on what a revision did. ``later`` are revisions to roll back first."""

    revision: int
    problem: str
    later: tuple[int, ...] = ()

    exit_code = 2

    def __str__(self) -> str:
        listed = ", ".join(map(str, self.later))
        first = f"; roll back {listed} before it, in this order" if self.later else ""
        return f"revision {self.revision} cannot be rolled back: {self.problem}{first}"


def revisions(book: Skillbook, key: Key | str | None = None, last: int | None = None) -> list[Revision]:
    """Every change to the set of valid entries, oldest first, or those that touched a key's entries (``"*"``: the
    general statements); only the ``last`` ones if given, since a large book has many."""
    with book.database.read() as connection:
        return _revisions(book.database, connection, None if key is None else meant(connection, key), last)


def versions(book: Skillbook, key: Key | str) -> list[Version]:
    """The templates of a key with their records, oldest first."""
    with book.database.read() as connection:
        return _versions(book.database, connection, meant(connection, key))


def difference(book: Skillbook, one: int, other: int | None = None) -> Difference:
    """Changes made by revision ``one``; with ``other``, between the book after ``one`` and after ``other``. Raises
    ``UnknownName``."""
    with book.database.read() as connection:
        return _difference(book.database, connection, one, other)


def roll_back(book: Skillbook, revision: int) -> Revision:
    """Undo a revision by a new one. Raises ``UnknownName``, ``CannotRollBack``, ``ReadOnlyBook``."""
    with book.database.write() as connection:
        new = _roll_back(book.database, connection, revision)
    with book.database.read() as connection:
        return _revisions(book.database, connection, only=new)[0]


def revision(book: Skillbook, number: int) -> Revision:
    """One change to the set of valid entries, by its number."""
    with book.database.read() as connection:
        return _revisions(book.database, connection, only=number)[0]


def _revisions(
    database: Database,
    connection: sa.Connection,
    key: Key | None = None,
    last: int | None = None,
    only: int | None = None,
) -> list[Revision]:
    """All revisions, oldest first, or those that touched a key's entries; of these only the ``last`` ones, or ``only``
    the one with this id."""
    ids = _ids(connection, key) if only is None else [only]
    if last is not None:
        ids = ids[max(0, len(ids) - last) :]
    return [one for part in batched(ids, _CHUNK) for one in _read(database, connection, part)]


def _ids(connection: sa.Connection, key: Key | None) -> list[int]:
    if key is None:
        return queries.ids_of(connection.execute(sa.select(_R.id).order_by(_R.id)))
    number = queries.known_key_id(connection, key)
    if number is None:
        return []
    touched = sa.union(
        sa.select(_R.id).where(_R.key == number),
        sa.select(_E.revision).where(_E.key == number),
        sa.select(_C.revision).join(tables.entries, _C.entry == _E.id).where(_E.key == number),
    )
    return sorted(queries.ids_of(connection.execute(touched)))


def _read(database: Database, connection: sa.Connection, ids: list[int]) -> list[Revision]:
    """Some revisions with their changes, by ascending id."""
    by_revision: dict[int, list[Change]] = {}
    for entry in queries.entries_where(connection, _E.revision.in_(ids)):
        by_revision.setdefault(entry.revision, []).append(Change("added", entry))
    changed = _changes(database, connection, _C.revision.in_(ids))
    entries: dict[int, Entry] = {}
    for part in batched(sorted({row.entry for row in changed}), _CHUNK):
        entries.update(queries.entries_by_id(connection, part))
    for row in changed:
        by_revision.setdefault(row.revision, []).append(Change(row.change, entries[row.entry], row.why, row.because))
    query = sa.select(_R.id, _R.time, _R.reason, _K.action, _K.objects).join(tables.keys, _R.key == _K.id, isouter=True)
    return [
        Revision(
            row.id,
            row.time,
            row.reason,
            queries.key_of(row.action, row.objects) if row.objects is not None else None,
            tuple(by_revision.get(row.id, ())),
        )
        for row in connection.execute(query.where(_R.id.in_(ids)).order_by(_R.id))
    ]


def _versions(database: Database, connection: sa.Connection, key: Key) -> list[Version]:
    """The templates of a key with their records, oldest first."""
    mine = [
        entry
        for entry in queries.entries_where(connection, _E.kind.in_(PROGRAM_KINDS), _K.action == key.action)
        if entry.key == key
    ]
    records = records_of(database, connection, [entry.id for entry in mine])
    theirs = _changes(database, connection, _C.entry.in_([entry.id for entry in mine]))
    succeeded = {(row.revision, row.entry) for row in theirs if row.because is not None}
    found = []
    for entry in mine:
        gone = "superseded" if (entry.superseded_by, entry.id) in succeeded else "rolled back"
        uses, confirmed = records.record(entry.id, key)
        found.append(Version(entry, "served" if entry.superseded_by is None else gone, uses, confirmed))
    return found


def _difference(database: Database, connection: sa.Connection, one: int, other: int | None = None) -> Difference:
    """What ``one`` changed; with ``other``, from the book as it was after ``one`` to the book as it was after
    ``other``. Raises ``UnknownName``."""
    for revision in (one, other):
        if revision is not None:
            _check(connection, revision)
    before, after = (one - 1, one) if other is None else (one, other)
    between = (min(before, after), max(before, after))
    touched = sa.union(
        sa.select(_E.id).where(_E.revision > between[0], _E.revision <= between[1]),
        *(
            [sa.select(_C.entry).where(_C.revision > between[0], _C.revision <= between[1])]
            if database.has(connection, tables.changes)
            else []
        ),
    )
    removed: list[Entry] = []
    added: list[Entry] = []
    for part in batched(sorted(queries.ids_of(connection.execute(touched))), _CHUNK):
        entries = list(queries.entries_by_id(connection, part).values())
        changed = _changes(database, connection, _C.entry.in_(part))
        was, now = _valid_after(before, entries, changed), _valid_after(after, entries, changed)
        removed += [entry for entry in entries if entry.id in was - now]
        added += [entry for entry in entries if entry.id in now - was]
    return Difference(*(tuple(sorted(some, key=lambda entry: entry.id)) for some in (removed, added)))


def _roll_back(database: Database, connection: sa.Connection, revision: int) -> int:
    """Undo a revision inside a write transaction. Returns the new revision's id. Raises ``UnknownName``,
    ``CannotRollBack`` if later revisions depend on it or it was rolled back already.
    """
    _check(connection, revision)
    added = queries.entries_where(connection, _E.revision == revision)
    mine = connection.execute(sa.select(tables.changes).where(_C.revision == revision)).all()
    entries = queries.entries_by_id(connection, [row.entry for row in mine])
    _check_untouched(connection, revision, added, mine, entries)
    key = connection.execute(sa.select(_R.key).where(_R.id == revision)).scalar()
    new = queries.insert(connection, tables.revisions, key=key, time=database.now(), reason=f"rollback of {revision}")
    for entry in added:
        supersede(connection, new, entry.id, f"rollback of {revision}")
    for row in mine:
        if row.change == "superseded":
            restore(connection, new, row.entry, f"rollback of {revision}")
        elif row.change == "restored":
            heir = _gave_way_to(connection, row.entry, revision)
            supersede(connection, new, row.entry, f"rollback of {revision}", heir)
    calls_to_templates(connection)
    _part(database, connection, new, [row for row in mine if row.change == "joined"])
    if key is not None:
        _leave_as_it_is(connection, key)
    database.next_generation(connection)
    return new


def _gave_way_to(connection: sa.Connection, entry: int, before: int) -> int | None:
    """The entry that one gave way to before a revision restored it; if it goes, the one superseded again comes back."""
    where = (_C.entry == entry, _C.change == "superseded", _C.revision < before)
    query = sa.select(_C.because, _C.why).where(*where).order_by(_C.revision.desc()).limit(1)
    row = connection.execute(query).one_or_none()
    if row is not None and row.because is None and not row.why:  # as ``forget`` leaves it
        raise CannotRollBack(before, "what it took back was made with words that were withdrawn since")
    return None if row is None else row.because


def _check(connection: sa.Connection, revision: int) -> None:
    if connection.execute(sa.select(_R.id).where(_R.id == revision)).first() is None:
        newest = queries.ids_of(connection.execute(sa.select(_R.id).order_by(_R.id.desc()).limit(20)))
        raise UnknownName("revision", str(revision), tuple(map(str, sorted(newest))))


def _check_untouched(
    connection: sa.Connection,
    revision: int,
    added: Sequence[Entry],
    mine: Sequence[sa.Row[Any]],
    entries: dict[int, Entry],
) -> None:
    """Raises ``CannotRollBack`` if anything that the revision touched has changed since."""
    retired = {entry.id: entry.superseded_by for entry in [*added, *entries.values()]}
    left: list[int] = [entry.id for entry in added] + [row.entry for row in mine if row.change != "joined"]
    ids = [*left, *(row.entry for row in mine if row.change == "joined")]
    if not ids:
        raise CannotRollBack(revision, "it changed no entry that is still there")
    called = sa.select(tables.calls.c.entry).where(tables.calls.c.function.in_([entry.id for entry in added]))
    calls = queries.entries_where(connection, _E.id.in_(called), _E.revision > revision, _E.superseded_by.is_(None))
    if calls:
        later = tuple(sorted({call.revision for call in calls}, reverse=True))
        raise CannotRollBack(revision, "functions that it brought in are called since", later)
    touched = {by for entry in left if (by := retired[entry]) is not None and by != revision}
    for start in range(0, len(ids), _CHUNK):
        where = (_C.entry.in_(ids[start : start + _CHUNK]), _C.revision > revision)
        touched |= set(queries.ids_of(connection.execute(sa.select(_C.revision).where(*where))))
    if not touched:
        return
    reasons = {row.id: row.reason for row in connection.execute(sa.select(_R.id, _R.reason).where(_R.id.in_(touched)))}
    standing = {later for later in touched if not _undone(connection, later)}
    own = [later for later in standing if reasons[later] == f"rollback of {revision}"]
    if own:
        raise CannotRollBack(revision, f"it was already, by revision {max(own)}")
    standing -= {later for later in standing for one in touched if reasons[later] == f"rollback of {one}"}
    if standing:
        raise CannotRollBack(revision, "later ones changed its entries again", tuple(sorted(standing, reverse=True)))


def _undone(connection: sa.Connection, revision: int) -> bool:
    """Whether a revision was rolled back, and the rollback was not itself rolled back."""
    query = sa.select(_R.id).where(_R.reason == f"rollback of {revision}", _R.id > revision)
    return any(not _undone(connection, later) for later in queries.ids_of(connection.execute(query)))


def _part(database: Database, connection: sa.Connection, new: int, joined: list[sa.Row[Any]]) -> None:
    """Move entries back to the key they had before it was merged into another."""
    for spelling in {row.why for row in joined}:
        connection.execute(sa.delete(tables.aliases).where(tables.aliases.c.spelling == spelling))
    for row in joined:
        where = _E.id == row.entry
        query = sa.select(_K.action, _K.objects, _E.key).join(tables.keys, _E.key == _K.id).where(where)
        there = connection.execute(query).one()
        back = queries.key_id(connection, database.upsert(tables.keys), Key.parse(row.why))
        connection.execute(sa.update(tables.entries).where(where).values(key=back))
        record = (tables.records.c.entry == row.entry, tables.records.c.key == there.key)
        connection.execute(sa.update(tables.records).where(*record).values(key=back))
        was = str(queries.key_of(there.action, there.objects))
        queries.insert_plain(
            connection, tables.changes, revision=new, entry=row.entry, change="joined", why=was, because=None
        )
    take_keys_of_parts(connection, [row.entry for row in joined])


def _leave_as_it_is(connection: sa.Connection, key: int) -> None:
    """After a rollback a key is not clustered again until something else changes."""
    where = tables.clusterings.c.key == key
    state = connection.execute(sa.select(tables.clusterings.c.digest).where(where)).scalar()
    if state is None:
        return
    valid = sa.select(_E.id).where(_E.key == key, CONDENSED, _E.superseded_by.is_(None))
    members = state_digest(queries.ids_of(connection.execute(valid)), ()).split(":")[0]
    rest = state.partition(":")[2]
    connection.execute(sa.update(tables.clusterings).where(where).values(digest=f"{members}:{rest}"))


def _changes(database: Database, connection: sa.Connection, condition: sa.ColumnElement[bool]) -> list[sa.Row[Any]]:
    if not database.has(connection, tables.changes):
        return []
    return list(connection.execute(sa.select(tables.changes).where(condition).order_by(_C.revision, _C.entry)))


def _valid_after(revision: int, entries: list[Entry], changed: list[sa.Row[Any]]) -> set[int]:
    valid = {entry.id for entry in entries if entry.revision <= revision}
    for row in changed:
        if row.revision > revision or row.change == "joined":
            continue
        if row.change == "superseded":
            valid.discard(row.entry)
        else:
            valid.add(row.entry)
    return valid
