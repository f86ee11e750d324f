"""Reading and writing the book's rows as values."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any

import attrs
import sqlalchemy as sa

from memo_core.skillbook.model.entries import GLOBAL_KEY, Entry, Feedback
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.store import tables
from memo_core.text.parsing import parse_json

_E, _K = tables.entries.c, tables.keys.c
_COLUMNS = [_E[field.name] for field in attrs.fields(Entry)]
_ENTRY = sa.select(*_COLUMNS, _K.action, _K.objects).join(tables.keys, _E.key == _K.id)
_BY_ID = _ENTRY.where(_E.id.in_(sa.bindparam("ids", expanding=True)))
_CHUNK = 500
_BATCH = 1_000  # rows of a whole book that are in memory at a time
_VALID = (
    sa.select(_E.id, _E.kind, _E.key, _E.text, _K.action, _K.objects)
    .join(tables.keys, _E.key == _K.id)
    .where(_E.superseded_by.is_(None))
    .order_by(_E.id)
)
_SIZES = sa.select(_E.key, _E.kind, sa.func.count()).where(_E.superseded_by.is_(None)).group_by(_E.key, _E.kind)
FEEDBACK_FIELDS = tuple(field.name for field in attrs.fields(Feedback))


@attrs.frozen
class ValidRow:
    """One active entry, as the index is built from it."""

    id: int
    kind: str
    key_id: int
    key: Key
    text: str


@lru_cache(maxsize=20_000)
def key_of(action: str, objects: str) -> Key:
    """The key of a row of ``keys``."""
    return Key(action, tuple(parse_json(objects))) if action else GLOBAL_KEY


def objects_text(key: Key) -> str:
    """How a key's objects are written in its row."""
    return json.dumps(list(key.objects), ensure_ascii=False)


def entry_of(row: Sequence[Any]) -> Entry:
    """From a row of ``_ENTRY``: the entry's fields, then the key's action and objects."""
    return Entry(row[0], row[1], key_of(row[-2], row[-1]), *row[3:-2])


def entries_by_id(connection: sa.Connection, ids: Sequence[int]) -> dict[int, Entry]:
    """Unknown ids are left out."""
    if not ids:
        return {}
    found = connection.execute(_BY_ID, {"ids": list(ids)}).all()
    return {row[0]: entry_of(row) for row in found}


def entries_where(connection: sa.Connection, *conditions: sa.ColumnElement[bool]) -> list[Entry]:
    return list(each_entry(connection, *conditions))


def each_entry(connection: sa.Connection, *conditions: sa.ColumnElement[bool]) -> Iterator[Entry]:
    """Iterate over entries without holding all of a large book in memory."""
    query = _ENTRY.where(*conditions).order_by(_E.id)
    for row in connection.execute(query, execution_options={"yield_per": _BATCH}):
        yield entry_of(row)


def valid_entry_rows(connection: sa.Connection) -> list[ValidRow]:
    """All entries that no revision retired."""
    known: dict[int, Key] = {}
    rows = []
    for entry, kind, key, text, action, objects in connection.execute(_VALID):
        if key not in known:
            known[key] = key_of(action, objects)
        rows.append(ValidRow(entry, kind, key, known[key], text))
    return rows


def keys_by_id(connection: sa.Connection, ids: Sequence[int] | None = None) -> dict[int, Key]:
    """All keys of the book, the global one too, or those with these ids."""
    query = sa.select(_K.id, _K.action, _K.objects)
    return {
        number: key_of(action, objects)
        for among in _among(_K.id, ids)
        for number, action, objects in connection.execute(query.where(among))
    }


def group_sizes(connection: sa.Connection, keys: Sequence[int] | None = None) -> list[tuple[int, str, int]]:
    """Key, kind and number of the valid entries, where there are any; of all keys or of these."""
    return [
        (key, kind, size)
        for among in _among(_E.key, keys)
        for key, kind, size in connection.execute(_SIZES.where(among))
    ]


def _among(column: sa.ColumnElement[int], values: Sequence[int] | None) -> Iterable[sa.ColumnElement[bool]]:
    """Conditions that select these values, or all."""
    if values is None:
        yield sa.true()
        return
    for start in range(0, len(values), _CHUNK):
        yield column.in_(values[start : start + _CHUNK])


def alias_rows(connection: sa.Connection) -> dict[str, Key]:
    """Spelling of a key -> the key it is kept under."""
    query = sa.select(tables.aliases.c.spelling, _K.action, _K.objects).join(tables.keys, tables.aliases.c.key == _K.id)
    return {spelling: key_of(action, objects) for spelling, action, objects in connection.execute(query)}


def feedback_where(connection: sa.Connection, *conditions: sa.ColumnElement[bool]) -> list[Feedback]:
    query = sa.select(tables.feedback).where(*conditions).order_by(tables.feedback.c.id)
    return [Feedback(**{name: row._mapping[name] for name in FEEDBACK_FIELDS}) for row in connection.execute(query)]


def key_id(connection: sa.Connection, upsert: sa.Insert, key: Key) -> int:
    """The id of a key's row, made if missing; an alias leads to the key it stands for."""
    found = known_key_id(connection, key)
    if found is None:
        connection.execute(upsert.values(action=key.action, objects=objects_text(key)))
        found = known_key_id(connection, key)
        assert found is not None
    return found


def known_key_id(connection: sa.Connection, key: Key) -> int | None:
    """The id of a key in the book, under this or another spelling; None if the book does not have it."""
    alias = connection.execute(sa.select(tables.aliases.c.key).where(tables.aliases.c.spelling == str(key))).scalar()
    if alias is not None:
        return int(alias)
    where = (_K.action == key.action, _K.objects == objects_text(key))
    found = connection.execute(sa.select(_K.id).where(*where)).scalar()
    return None if found is None else int(found)


def insert(connection: sa.Connection, table: sa.Table, **values: Any) -> int:
    """Insert one row; its id."""
    key = connection.execute(sa.insert(table).values(**values)).inserted_primary_key
    assert key is not None
    return int(key[0])


def insert_plain(connection: sa.Connection, table: sa.Table, **values: Any) -> None:
    """Insert one row of a table whose key is not made by the database."""
    connection.execute(sa.insert(table).values(**values))


def count(connection: sa.Connection, table: sa.Table, *conditions: sa.ColumnElement[bool]) -> int:
    return int(connection.execute(sa.select(sa.func.count()).select_from(table).where(*conditions)).scalar_one())


def ids_of(rows: Iterable[Any]) -> list[int]:
    return [int(row[0]) for row in rows]
