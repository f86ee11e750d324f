"""The ledger of a study: every call of every run that shares it, in one SQLite file.

A line for a call is inserted before the call and completed after it, so that calls of a killed run are recorded and
processes see what the others are about to spend."""

from __future__ import annotations

import contextlib
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import MemoError
from memo_core.interfaces.llm import Usage
from memo_core.llm.spending import Spent
from memo_core.text.parsing import resolved

_WAIT_S = 30.0  # for other processes that write
_UNREADABLE = (sqlite3.Error, UnicodeDecodeError)  # the second: SQLite's own message quotes bytes of a damaged schema
_SCHEMA = """
CREATE TABLE IF NOT EXISTS calls (
    id INTEGER PRIMARY KEY, begun REAL NOT NULL, ended REAL, run TEXT NOT NULL, phase TEXT NOT NULL,
    model TEXT NOT NULL, prompt_tokens INTEGER NOT NULL, completion_tokens INTEGER NOT NULL DEFAULT 0, cost REAL,
    entry INTEGER, cached_tokens INTEGER NOT NULL DEFAULT 0
)
"""
_SUMS = """
SELECT count(*), coalesce(sum(prompt_tokens), 0), coalesce(sum(completion_tokens), 0), coalesce(sum(cost), 0.0),
       coalesce(sum(cost IS NULL AND ended IS NOT NULL AND prompt_tokens > 0), 0), coalesce(sum(ended IS NULL), 0),
       coalesce(sum(cached_tokens), 0)
FROM calls
"""
_ADDED = {"entry": "INTEGER", "cached_tokens": "INTEGER NOT NULL DEFAULT 0"}  # columns that older ledgers lack


@attrs.define(auto_exc=True, eq=False)
class LedgerError(MemoError):
    """The ledger cannot be read or written."""

    path: Path
    problem: str

    def __str__(self) -> str:
        return f"the study's ledger {self.path}: {self.problem}"


class Ledger:
    """One file, used by any number of threads and processes. Every call returns when it is on disk."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._connection: sqlite3.Connection | None = None
        self._lock = threading.RLock()

    def open(self) -> None:
        """Idempotent; creates the file if there is none. Raises ``LedgerError``."""
        with self._lock:
            if self._connection is not None:
                return
            try:
                self.path.parent.mkdir(parents=True, exist_ok=True)
                connection = sqlite3.connect(self.path, _WAIT_S, isolation_level=None, check_same_thread=False)
                connection.execute("PRAGMA synchronous=FULL")
                connection.execute(_SCHEMA)
                _add_missing_columns(connection)
            except (OSError, *_UNREADABLE) as error:
                raise LedgerError(self.path, str(error)) from error
            self._connection = connection

    def close(self) -> None:
        """Idempotent; a call that ends later reopens the ledger briefly."""
        with self._lock:
            connection, self._connection = self._connection, None
            if connection is not None:
                connection.close()

    def spent(self) -> Spent:
        """Spending of all runs."""
        with self._writing() as connection:
            return _sums(connection)

    def begin(
        self,
        run: str,
        phase: str,
        model: str,
        prompt_tokens: int,
        check: Callable[[Spent], None],
        entry: int | None = None,
    ) -> int:
        """Insert a line for a call that begins, and return its number. ``check`` receives the spending so far and
        raises if no more is allowed; the check and the insertion are one transaction. ``entry``: the call's entry in
        the run's log."""
        with self._writing() as connection:
            check(_sums(connection))
            inserted = connection.execute(
                "INSERT INTO calls (begun, run, phase, model, prompt_tokens, entry) VALUES (?, ?, ?, ?, ?, ?)",
                (time.time(), run, phase, model, prompt_tokens, entry),
            )
            return int(inserted.lastrowid or 0)

    def end(self, line: int, usage: Usage | None) -> None:
        """Complete a call's line; ``usage`` None if nothing was spent."""
        with self._writing() as connection:
            _end(connection, line, usage)

    def recover(self, run: str, known: Mapping[int, Usage | None]) -> None:
        """Complete the lines of calls that had ended when their process was killed before it could do so: log entry ->
        cost. If a call was repeated, its latest line is completed."""
        newest = "SELECT max(id) FROM calls WHERE run = ? GROUP BY entry"
        unfinished = f"SELECT entry, id FROM calls WHERE run = ? AND ended IS NULL AND id IN ({newest})"
        with self._writing() as connection:
            lines = connection.execute(unfinished, (run, run))
            for entry, line in lines.fetchall():
                if entry in known:
                    _end(connection, line, known[entry])

    @contextlib.contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        with self._lock:
            was_open = self._connection is not None
            self.open()
            connection: Any = self._connection
            try:
                connection.execute("BEGIN IMMEDIATE")
                try:
                    yield connection
                except BaseException:
                    connection.execute("ROLLBACK")
                    raise
                connection.execute("COMMIT")
            except _UNREADABLE as error:
                raise LedgerError(self.path, str(error)) from error
            finally:
                if not was_open:
                    self.close()


def _add_missing_columns(connection: sqlite3.Connection) -> None:
    """Ledgers of older versions know neither the entries of calls nor cached tokens."""
    connection.execute("BEGIN IMMEDIATE")
    for name in _ADDED.keys() - _columns(connection):
        connection.execute(f"ALTER TABLE calls ADD COLUMN {name} {_ADDED[name]}")
    connection.execute("COMMIT")


def _columns(connection: sqlite3.Connection) -> set[str]:
    return {column[1] for column in connection.execute("PRAGMA table_info(calls)")}


def _end(connection: sqlite3.Connection, line: int, usage: Usage | None) -> None:
    usage = usage or Usage()
    connection.execute(
        "UPDATE calls SET ended = ?, prompt_tokens = ?, completion_tokens = ?, cost = ?, cached_tokens = ? "
        "WHERE id = ?",
        (time.time(), usage.prompt_tokens, usage.completion_tokens, usage.cost, usage.cached_tokens, line),
    )


def _sums(connection: sqlite3.Connection) -> Spent:
    return Spent(*connection.execute(_SUMS).fetchone())


def read_ledger(path: Path) -> tuple[list[tuple[str, Spent]], Spent]:
    """Spending per run, in the order of their first calls, and in total. Read-only. Raises ``LedgerError``, also for
    another kind of file."""
    try:
        address = f"{resolved(path).as_uri()}?mode=ro"
        with contextlib.closing(sqlite3.connect(address, _WAIT_S, isolation_level=None, uri=True)) as connection:
            connection.execute("BEGIN")  # both queries see the same calls
            columns = _columns(connection)
            sums = _SUMS if not columns or "cached_tokens" in columns else _SUMS.replace("sum(cached_tokens)", "0")
            by_run = f"{sums.replace('SELECT', 'SELECT run,', 1)} GROUP BY run ORDER BY min(id)"
            runs = [(run, Spent(*one)) for run, *one in connection.execute(by_run)]
            return runs, Spent(*connection.execute(sums).fetchone())
    except _UNREADABLE as error:
        raise LedgerError(path, f"it is not a ledger, or cannot be read ({error})") from error
