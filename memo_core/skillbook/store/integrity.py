"""Checks that the values in a book's rows are values that MEMO can have written; an intact file may still contain
anything.

SQLite keeps values of any type in any column, and tables can be dropped. This reads every row, so it is used by ``memo
skillbook check`` and to explain an error after it occurred.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sqlalchemy as sa

from memo_core.skillbook.model.entries import KINDS
from memo_core.skillbook.store import tables

_LAST_TIME = 253_402_300_799.0  # s since the epoch: the last second of the year 9999
_NUMBERS = ("schema_version", "generation", "uncounted", "dimension")  # of the table meta
_ONE_OF = {
    ("feedback", "kind"): ("correction", "approval", "edit"),
    ("feedback", "status"): ("pending", "parked", "kept", "processed"),
    ("entries", "kind"): KINDS,
    ("changes", "change"): ("superseded", "restored", "joined"),
}
_NEEDED = ("schema_version", "book", "generation", "created")


def broken_tables(connection: sa.Connection) -> list[str]:
    """Descriptions of missing tables and columns of a SQLite book, and of unexpected ones."""
    strange = "SELECT type, name FROM sqlite_master WHERE type IN ('trigger', 'view')"
    found = [f"a {kind} {name!r}, which MEMO never makes" for kind, name in connection.exec_driver_sql(strange)]
    there = _there(connection)
    for table in tables.metadata.tables.values():
        if table.name in there:
            lacking = [column.name for column in table.columns if column.name not in there[table.name]]
            found += [f"{table.name}: the column {name} is not there" for name in lacking]
            referred = {row[2] for row in connection.exec_driver_sql(f"PRAGMA foreign_key_list({table.name})")}
            strangers = sorted(referred - set(tables.metadata.tables))
            found += [f"{table.name}: refers to a table {name!r}, which MEMO never makes" for name in strangers]
    if "meta" not in there:
        found.append("the table meta is not there")
    if found or _meta(connection).get("schema_version") != str(tables.SCHEMA_VERSION):
        return found  # an older book has fewer tables
    return [f"the table {name} is not there" for name in tables.metadata.tables if name not in there]


def broken_values(connection: sa.Connection) -> Iterator[str]:
    """Descriptions of invalid values in a SQLite book, one line per table and column. Requires all tables."""
    there = _there(connection)
    for table in tables.metadata.tables.values():
        for column in table.columns if table.name in there else ():
            query = sa.text(f"SELECT count(*) FROM {table.name} WHERE {_wrong(column)}")
            if count := int(connection.execute(query).scalar_one()):
                yield f"{table.name}: {count} values of {column.name} cannot be right"
    meta = _meta(connection)
    yield from (f"meta: {name} is not there" for name in _NEEDED if name not in meta)
    for name in _NUMBERS:
        if name in meta and not (meta[name].isdecimal() and len(meta[name]) < 19):
            yield f"meta: {name} is no number"


def _there(connection: sa.Connection) -> dict[str, set[str]]:
    """The columns of each existing table."""
    inspector = sa.inspect(connection)
    return {name: {column["name"] for column in inspector.get_columns(name)} for name in inspector.get_table_names()}


def _meta(connection: sa.Connection) -> dict[str, str]:
    return {str(name): str(value) for name, value in connection.exec_driver_sql("SELECT name, value FROM meta")}


def _wrong(column: sa.Column[Any]) -> str:
    """An SQL condition that is true for values that the column cannot have."""
    name, kind = f'"{column.name}"', column.type
    if isinstance(kind, sa.LargeBinary):
        wrong = f"typeof({name}) <> 'blob'"
    elif isinstance(kind, sa.Float):
        wrong = f"typeof({name}) NOT IN ('real', 'integer') OR {name} NOT BETWEEN 0 AND {_LAST_TIME}"
    elif isinstance(kind, (sa.Integer, sa.Boolean)):
        wrong = f"typeof({name}) <> 'integer'"
    else:
        wrong = f"typeof({name}) <> 'text' OR instr(CAST({name} AS BLOB), x'00') > 0"
    if (allowed := _ONE_OF.get((column.table.name, column.name))) is not None:
        wrong += f" OR {name} NOT IN ({', '.join(map(repr, allowed))})"
    if (column.table.name, column.name) == ("keys", "objects"):
        of_texts = f"NOT EXISTS (SELECT 1 FROM json_each({name}) AS one WHERE one.type <> 'text')"
        right = f"json_type({name}) = 'array' AND {of_texts} AND (action = '' OR json_array_length({name}) > 0)"
        wrong += f" OR CASE WHEN json_valid({name}) THEN NOT ({right}) ELSE 1 END"
    if column.nullable:
        return f"{name} IS NOT NULL AND ({wrong})"
    return f"{name} IS NULL OR {wrong}"
