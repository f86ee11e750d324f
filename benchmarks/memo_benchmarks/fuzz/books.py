"""Skillbooks as files: pages of nonsense, values and tables that do not belong, torn write-ahead logs."""

from __future__ import annotations

import sqlite3
from contextlib import closing, suppress
from pathlib import Path
from random import Random
from typing import Any

from memo_benchmarks.fuzz.example_book import write_example
from memo_benchmarks.fuzz.imports import BOOK, LOOKS
from memo_benchmarks.fuzz.kind import Command, Kind, Memo
from memo_benchmarks.fuzz.mutations import damaged_bytes, text

WRITES: tuple[Command, ...] = (
    ["skillbook", "edit", "1", "another text", *BOOK],
    ["skillbook", "remove", "2", *BOOK],
    ["skillbook", "forget", "ana0", *BOOK, "--yes"],
    ["skillbook", "rollback", "1", *BOOK],
    ["skillbook", "retry", *BOOK],
    ["skillbook", "reembed", *BOOK],
    ["skillbook", "rebuild", "--out", "new.db", *BOOK],
    ["skillbook", "check", "--rescue", "new.db", *BOOK],
    ["cluster", *BOOK],
    ["cluster", "--dry-run", "--all", *BOOK],
)
_VALUES: tuple[Any, ...] = (
    None, "", 0, -1, 1, 2**63 - 1, -(2**63), 1e300, float("inf"), -0.5, b"\xff\xfe", b"", "x" * 3_000, "[", "{}",
    "null", "OPEN(", "OPEN(door)", "1e999", "NaN", "2026",
)  # fmt: skip
_STATEMENTS = (
    "DROP TABLE {table}",
    "DELETE FROM {table}",
    "DELETE FROM {table} WHERE rowid % 2 = 0",
    "ALTER TABLE {table} RENAME TO other",
    "ALTER TABLE {table} RENAME COLUMN {column} TO other",
    "CREATE TRIGGER t BEFORE INSERT ON {table} BEGIN SELECT RAISE(ABORT, 'no'); END",
    "CREATE TRIGGER t BEFORE UPDATE ON {table} BEGIN SELECT RAISE(ABORT, 'no'); END",
    "CREATE VIEW v AS SELECT * FROM v2",
    "PRAGMA user_version = 99",
    "PRAGMA application_id = 99",
)


class Books(Kind):
    name = "books"

    def prepare(self, place: Path, memo: Memo) -> None:
        write_example(place / "book.db")
        with closing(sqlite3.connect(place / "book.db")) as raw:
            raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        self._whole = (place / "book.db").read_bytes()
        with closing(sqlite3.connect(place / "book.db", isolation_level=None)) as raw:
            self._columns = [
                (table, column[1])
                for (table,) in raw.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall()
                for column in raw.execute(f"PRAGMA table_info({table})").fetchall()
                if not table.startswith("sqlite_")
            ]
            for number in range(20):  # so that there is a write-ahead log to be torn
                raw.execute("UPDATE feedback SET reason = ?", (f"again {number}",))
            self._log = (place / "book.db-wal").read_bytes()

    def write(self, place: Path, draw: Random) -> list[Command]:
        path, how = place / "book.db", draw.random()
        path.write_bytes(self._whole)
        if how < 0.45:
            with closing(sqlite3.connect(path)) as raw:
                for _ in range(draw.choice((1, 1, 2, 5))):
                    self._change(raw, draw)
        elif how < 0.75:
            path.write_bytes(self._damaged(draw))
        elif how < 0.9:
            Path(f"{path}-wal").write_bytes(damaged_bytes(self._log, draw))
        else:
            path.write_bytes(damaged_bytes(self._whole, draw))
        return [*draw.sample((*LOOKS, *WRITES), 2), ["skillbook", "check", *BOOK]]

    def _change(self, raw: sqlite3.Connection, draw: Random) -> None:
        table, column = draw.choice(self._columns)
        raw.execute("PRAGMA foreign_keys = OFF")
        with suppress(sqlite3.Error, UnicodeEncodeError, OverflowError), raw:
            if draw.random() < 0.25:
                raw.execute(draw.choice(_STATEMENTS).format(table=table, column=column))
                return
            raw.execute("PRAGMA ignore_check_constraints = ON")
            value = text(draw) if draw.random() < 0.4 else draw.choice(_VALUES)
            which = draw.choice(("", " WHERE rowid = 1", " WHERE rowid % 2 = 0", " WHERE rowid = (SELECT max(rowid))"))
            put = "CAST(? AS TEXT)" if isinstance(value, bytes) and draw.random() < 0.5 else "?"
            raw.execute(f"UPDATE {table} SET {column} = {put}{which}", (value,))

    def _damaged(self, draw: Random) -> bytes:
        """Pages of nonsense or zeros, or pages swapped; sometimes the end is missing."""
        data = bytearray(self._whole)
        pages = len(data) // 4096
        for _ in range(draw.choice((1, 1, 2, 4))):
            at, other = draw.randrange(0 if draw.random() < 0.1 else 1, pages) * 4096, draw.randrange(pages) * 4096
            page = draw.choice((draw.randbytes(4096), bytes(4096), bytes(data[other : other + 4096])))
            many = draw.choice((4096, 4096, 100, 16))
            data[at : at + many] = page[:many]
        if draw.random() < 0.2:
            del data[draw.randrange(len(data)) :]
        return bytes(data)
