"""Exporting a book as records, one per line: everything but the vectors, which are derived.

Numbers in a record are those of the exporting book; ``origin`` is the book in which a row was created and its number
there, which identifies a row across books that were merged in any order (``memo_core.skillbook.sharing.importing``).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import attrs
import sqlalchemy as sa

from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.store.origins import IMPORTED, origins_of
from memo_core.skillbook.writing.revising import kept_read_backs

FORMAT = 4  # 1 has no origins, changes, uses and withdrawn rows, 2 no read-backs, 3 no functions
# Kinds of records whose number the first record says, so that a file with lines missing is noticed.
COUNTED = {"feedback": tables.feedback, "revision": tables.revisions, "entry": tables.entries}


def records(database: Database, connection: sa.Connection) -> Iterator[dict[str, Any]]:
    """First the book, then imported books, feedback, aliases, revisions, entries, read-backs, changes, uses and what
    was withdrawn. ``record`` names the kind of each."""
    meta = database.meta(connection)
    of = {kind: origins_of(database, connection, kind, meta["book"]) for kind in ("feedback", "entry", "revision")}
    yield {"record": "book", "format": FORMAT, **meta, "counts": {kind: _count(connection, kind) for kind in COUNTED}}
    if database.has(connection, tables.books):
        for other in connection.execute(sa.select(tables.books).order_by(tables.books.c.book)):
            yield {"record": "imported", **other._mapping}
    for feedback in queries.feedback_where(connection):
        yield {"record": "feedback", **attrs.asdict(feedback), "origin": list(of["feedback"].origin(feedback.id))}
    for spelling, key in sorted(queries.alias_rows(connection).items()):
        yield {"record": "alias", "spelling": spelling, **_key(key.action, list(key.objects))}
    for revision in connection.execute(sa.select(tables.revisions).order_by(tables.revisions.c.id)):
        yield {
            "record": "revision",
            "id": revision.id,
            "time": revision.time,
            "reason": revision.reason.removeprefix(IMPORTED),
            "origin": list(of["revision"].origin(revision.id)),
        }
    sources: dict[int, list[int]] = {}
    for entry, source in connection.execute(sa.select(tables.sources.c.entry, tables.sources.c.feedback)):
        sources.setdefault(entry, []).append(source)
    columns = tables.entries.c
    places = {
        entry: (phase, ordinal)
        for entry, phase, ordinal in connection.execute(sa.select(columns.id, columns.phase, columns.ordinal))
    }
    links = _links(database, connection)
    for one in queries.each_entry(connection):
        fields = attrs.asdict(one, filter=lambda field, _: field.name != "key")
        phase, ordinal = places[one.id]
        yield {
            "record": "entry",
            **fields,
            **_key(one.key.action, list(one.key.objects)),
            "phase": phase,
            "ordinal": ordinal,
            "sources": sorted(sources.get(one.id, [])),
            "origin": list(of["entry"].origin(one.id)),
            **links.get(one.id, {}),
        }
    for kept in kept_read_backs(database, connection):
        yield {"record": "read_back", **attrs.asdict(kept)}
    if database.has(connection, tables.changes):
        by_revision = sa.select(tables.changes).order_by(tables.changes.c.revision, tables.changes.c.entry)
        for change in connection.execute(by_revision):
            yield {"record": "change", **change._mapping}
    if database.has(connection, tables.records):
        used, keys = tables.records.c, tables.keys.c
        query = sa.select(used.entry, used.uses, used.confirmed_uses, keys.action, keys.objects)
        for use in connection.execute(query.join(tables.keys, used.key == keys.id).order_by(used.entry, keys.id)):
            key = queries.key_of(use.action, use.objects)
            counts = {"uses": use.uses, "confirmed_uses": use.confirmed_uses}
            yield {"record": "uses", "entry": use.entry, **_key(key.action, list(key.objects)), **counts}
    for book, number in sorted(of["feedback"].gone):
        yield {"record": "withdrawn", "kind": "feedback", "origin": [book, number]}


def _links(database: Database, connection: sa.Connection) -> dict[int, dict[str, list[Any]]]:
    """Collect by entry the functions that a call calls ("calls") and a note's further keys ("keys")."""
    found: dict[int, dict[str, list[Any]]] = {}
    if database.has(connection, tables.calls):
        query = sa.select(tables.calls.c.entry, tables.calls.c.function).order_by(tables.calls.c.function)
        for entry, function in connection.execute(query):
            found.setdefault(entry, {}).setdefault("calls", []).append(function)
    if database.has(connection, tables.entry_keys):
        further, keys = tables.entry_keys.c, tables.keys.c
        named = sa.select(further.entry, keys.action, keys.objects).join(tables.keys, further.key == keys.id)
        for entry, action, objects in connection.execute(named.order_by(further.entry, keys.id)):
            key = queries.key_of(action, objects)
            found.setdefault(entry, {}).setdefault("keys", []).append([key.action, *key.objects])
    return found


def _count(connection: sa.Connection, kind: str) -> int:
    return int(connection.scalar(sa.select(sa.func.count()).select_from(COUNTED[kind])) or 0)


def _key(action: str, objects: list[str]) -> dict[str, Any]:
    return {"action": action, "objects": objects}
