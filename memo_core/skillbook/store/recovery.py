"""Recovering a damaged file: every row that SQLite can still read is copied to a new book."""

from __future__ import annotations

import sqlite3
from contextlib import closing, suppress
from pathlib import Path

import attrs
import sqlalchemy as sa

from memo_core.errors import InvalidArgument
from memo_core.skillbook.store import tables
from memo_core.skillbook.store.database import Database, SkillbookError

_DERIVED = ("vectors", "clusterings")  # are made anew
_IN_A_ROW = 10_000  # rows that cannot be read one after the other: beyond is the end


@attrs.frozen
class Rescued:
    """Numbers of rows by table: recovered ones, and ones left out because a row that they refer to is lost."""

    read: dict[str, int]
    dangling: int


def rescue(damaged: Path, out: Path) -> Rescued:
    """Write what can be read of a SQLite book into the new file ``out``. The damaged file is not changed. Raises
    ``InvalidArgument`` if ``out`` exists, ``SkillbookError`` if nothing can be read."""
    if out.exists():
        raise InvalidArgument("--rescue", f"{out} exists already", "a new file")
    new = Database(str(out))
    try:
        new.open()
    except SkillbookError:
        with suppress(OSError):
            out.unlink()  # otherwise the next attempt would find a file
        raise
    new.close()
    read: dict[str, int] = {}
    address = f"file:{str(damaged.absolute()).replace('%', '%25').replace('?', '%3f').replace('#', '%23')}?mode=ro"
    with closing(sqlite3.connect(address, uri=True)) as source, closing(sqlite3.connect(out)) as target:
        for table in tables.metadata.sorted_tables:
            if table.name not in _DERIVED:
                read[table.name] = _copy(source, target, table)
        target.execute("UPDATE meta SET value = ? WHERE name = 'schema_version'", (str(tables.SCHEMA_VERSION),))
        dangling = _drop_dangling(target)
        target.commit()
    return Rescued({name: count for name, count in read.items() if count}, dangling)


def _copy(source: sqlite3.Connection, target: sqlite3.Connection, table: sa.Table) -> int:
    try:
        there = {row[1] for row in source.execute(f"PRAGMA table_info({table.name})")}
    except sqlite3.DatabaseError:
        return 0
    columns = [column.name for column in table.columns if column.name in there]
    if not columns:
        return 0
    marks = ", ".join("?" * len(columns))
    query = f"SELECT rowid, {', '.join(columns)} FROM {table.name} WHERE rowid > ? ORDER BY rowid LIMIT 1"
    exactly = query.replace("rowid > ?", "rowid = ?")
    at, count, missed = 0, 0, 0
    while missed < _IN_A_ROW:
        try:
            row = source.execute(query if not missed else exactly, (at if not missed else at + 1,)).fetchone()
            if row is None and not missed:
                break
        except sqlite3.DatabaseError:
            row = None
        if row is None:  # not to be read, or not there: try the next number
            at, missed = at + 1, missed + 1
            continue
        at, missed = row[0], 0
        with suppress(sqlite3.IntegrityError):  # a value is lost that no row of the table is without
            target.execute(f"INSERT OR REPLACE INTO {table.name} ({', '.join(columns)}) VALUES ({marks})", row[1:])
            count += 1
    return count


def _drop_dangling(target: sqlite3.Connection) -> int:
    """Delete rows that refer to lost rows, and then rows that refer to these."""
    gone = 0
    while dangling := target.execute("PRAGMA foreign_key_check").fetchall():
        for name, rowid, *_ in dangling:
            gone += target.execute(f"DELETE FROM {name} WHERE rowid = ?", (rowid,)).rowcount
    return gone
