"""Opening the book's database and writing to it so that no acknowledged write is lost.

SQLite by default, ``postgresql://`` for a laboratory that shares one book. The promises of ``docs/skillbook.md`` rest
on this file and on ``connecting``.
"""

from __future__ import annotations

import math
import os
import sqlite3
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sa

from memo_core.errors import MemoError
from memo_core.skillbook.model.errors import (
    DamagedBook as DamagedBook,
    ReadOnlyBook as ReadOnlyBook,
    SkillbookError as SkillbookError,
)
from memo_core.skillbook.store import tables
from memo_core.skillbook.store.connecting import BUSY_TIMEOUT_MS, parse_url, refused, server_engine, sqlite_engine
from memo_core.skillbook.store.integrity import broken_tables, broken_values

_E, _O = tables.entries.c, tables.origins.c

# parts of SQLite's messages
_BROKEN = ("malformed", "not a database", "database corruption", "no such table", "no such column", "Could not decode")
_DAMAGE = (*_BROKEN, "disk I/O error")  # also the result of a full disk
_ERASE_TIMEOUT_S = 10.0
_MAKING_TABLES = 0x4D454D4F  # our key among the server's advisory locks


class Database:
    """One open database. ``read`` and ``write`` give a connection in a transaction; ``write`` serialises writers."""

    def __init__(self, url: str, read_only: bool = False) -> None:
        self.read_only = read_only
        self.now: Callable[[], float] = time.time  # s since the epoch; a book that is rebuilt uses the times of its log
        self._url = parse_url(url)
        shown = self._url if self.is_sqlite else self._url.set(drivername="postgresql")
        self.name = shown.render_as_string(hide_password=True)
        self._engine: sa.Engine | None = None
        self._fetching = threading.Lock()
        self._reader: sa.PoolProxiedConnection | None = None
        self._prepared: dict[sa.Select[Any], tuple[str, tuple[str, ...]]] = {}
        self._whole: bool | None = None  # whether it has all tables
        self._names: set[str] = set()
        self._marks = threading.local()
        self._memory_lock = threading.RLock()  # the one connection of a book in memory is used by one thread at a time

    @property
    def in_memory(self) -> bool:
        return self._url.get_backend_name() == "sqlite" and self._url.database in (None, "", ":memory:")

    @property
    def path(self) -> Path | None:
        """The database's file; None in memory and on a server."""
        if not self.is_sqlite or self.in_memory:
            return None
        return Path(os.path.expanduser(str(self._url.database))).absolute()

    @property
    def is_sqlite(self) -> bool:
        return self._url.get_backend_name() == "sqlite"

    def open(self) -> None:
        """Connect, create the tables of a new book, check the schema. Idempotent. Raises ``SkillbookError``."""
        if self._engine is not None:
            return
        if self.is_sqlite:
            engine = sqlite_engine(self.name, self.path, self.read_only)
        else:
            engine = server_engine(self.name, self._url, self.read_only)
        self._engine = engine
        try:
            self._prepare()
        except sa.exc.DatabaseError as error:
            self.close()
            raise self._refused(error.orig) from error
        except BaseException as error:
            try:
                self.blame(error)
            finally:
                self.close()
            raise

    def close(self) -> None:
        """Idempotent."""
        with self._fetching:
            if self._reader is not None:
                self._reader.close()
                self._reader = None
        if self._engine is not None:
            self._engine.dispose()
            self._engine = None

    @property
    def engine(self) -> sa.Engine:
        if self._engine is None:
            raise SkillbookError(self.name, "is not open", "use it inside `with`, or call open() first")
        return self._engine

    @contextmanager
    def read(self) -> Iterator[sa.Connection]:
        """A connection in a read transaction: one consistent state of the book."""
        try:
            with self._exclusive(), self._reading() as connection, connection.begin():
                yield connection
        except sa.exc.DatabaseError as error:
            self._say_damaged(error.orig)
            if isinstance(error, sa.exc.OperationalError):
                raise self._refused(error.orig) from error
            raise

    def _refused(self, error: BaseException | None, doing: str = "") -> SkillbookError:
        doing = doing or ("cannot be opened or read" if self.read_only else "cannot be opened")
        return refused(self.name, self.path, error, doing)

    def _say_damaged(self, error: BaseException | None, signs: tuple[str, ...] = _DAMAGE) -> None:
        """Raise ``DamagedBook`` if SQLite's error means a damaged file."""
        said = " ".join(str(error).split())
        if isinstance(error, sqlite3.DatabaseError) and any(sign in said for sign in signs):
            raise self._damaged(said) from error

    def _damaged(self, what: str) -> DamagedBook:
        remedy = f"memo skillbook check --book {self.name} says where; --rescue FILE gets out what can be read"
        return DamagedBook(self.name, f"its file is damaged ({what[:500]})", remedy)

    def blame(self, error: BaseException | None) -> None:
        """Raise ``DamagedBook`` if a check of the whole book shows that an unexpected error came from damage. Otherwise
        the error is a bug, and left to the caller."""
        if not isinstance(error, Exception) or isinstance(error, (MemoError, OSError)) or self._engine is None:
            return
        if problems := self.problems():
            raise self._damaged("; ".join(problems[:3])) from error

    def fetch(self, statement: sa.Select[Any], parameters: dict[str, Any]) -> Sequence[Sequence[Any]]:
        """Rows of one SELECT statement in its own transaction. Fast for statements that are executed often: on a local
        file it bypasses SQLAlchemy's execution and uses its own connection, which holds no lock between calls."""
        if not self.is_sqlite or self.in_memory:
            with self.read() as connection:
                return connection.execute(statement, parameters).all()
        with self._fetching:
            if self._reader is None:
                self._reader = self.engine.raw_connection()
            prepared = self._prepared.get(statement)
            if prepared is None:
                compiled = statement.compile(dialect=self.engine.dialect)
                prepared = self._prepared[statement] = (str(compiled), tuple(compiled.positiontup or ()))
            sql, names = prepared
            raw = self._reader.dbapi_connection
            assert raw is not None
            try:
                return raw.execute(sql, [parameters[name] for name in names]).fetchall()
            except sqlite3.DatabaseError as error:
                self._say_damaged(error)
                if isinstance(error, sqlite3.OperationalError):
                    raise self._refused(error) from error
                raise

    @contextmanager
    def write(self) -> Iterator[sa.Connection]:
        """A connection in a write transaction, durable when the block ends, rolled back when it raises.

        Raises ``SkillbookError`` when the disk is full or the server is unreachable.
        """
        if self.read_only:
            raise ReadOnlyBook(self.name, "is open read-only", "evaluations never write")
        try:
            with self._exclusive(), self._writing() as connection, connection.begin():
                if not self.is_sqlite:
                    lock = sa.select(tables.meta.c.value).where(tables.meta.c.name == "generation")
                    connection.execute(lock.with_for_update())
                yield connection
                if (mark := getattr(self._marks, "now", None)) is not None:
                    self._note(connection, *mark)
        except sa.exc.OperationalError as error:
            self._say_damaged(error.orig, _BROKEN)
            raise self._refused(error.orig, "could not be written, what was stored before is safe") from error
        except sa.exc.DatabaseError as error:
            self._say_damaged(error.orig)
            raise

    @contextmanager
    def marked(self, run: str, entry: int, note: str) -> Iterator[None]:
        """Every write of this thread within the block commits, in the same transaction, that it is the effect of this
        entry of a run's log; of a run only the newest is kept."""
        self._marks.now = (run, entry, note)
        try:
            yield
        finally:
            self._marks.now = None

    @staticmethod
    def _note(connection: sa.Connection, run: str, entry: int, note: str) -> None:
        connection.execute(sa.delete(tables.run_effects).where(tables.run_effects.c.run == run))
        connection.execute(sa.insert(tables.run_effects).values(run=run, entry=entry, note=note))

    def upsert(self, table: sa.Table) -> sa.Insert:
        """An INSERT that ignores rows that exist."""
        if self.is_sqlite:
            from sqlalchemy.dialects.sqlite import insert
        else:
            from sqlalchemy.dialects.postgresql import insert  # type: ignore[assignment]
        return insert(table).on_conflict_do_nothing()

    # -- meta ----------------------------------------------------------------------------------------------------------
    @staticmethod
    def meta(connection: sa.Connection) -> dict[str, str]:
        return {name: value for name, value in connection.execute(sa.select(tables.meta.c.name, tables.meta.c.value))}

    @staticmethod
    def set_meta(connection: sa.Connection, name: str, value: str) -> None:
        changed = connection.execute(sa.update(tables.meta).where(tables.meta.c.name == name).values(value=value))
        if not changed.rowcount:
            connection.execute(sa.insert(tables.meta).values(name=name, value=value))

    def next_generation(self, connection: sa.Connection) -> int:
        """Count the change that this write transaction makes to what can be retrieved."""
        generation = int(self.meta(connection)["generation"]) + 1
        self.set_meta(connection, "generation", str(generation))
        return generation

    def time_of_entry(self, connection: sa.Connection) -> float:
        """The time to store with a new entry (s since the epoch): now, but never before that of an earlier entry of
        this book, so that the order of times is the order of writing although a computer's clock may be set back."""
        imported = sa.select(_O.local).where(_O.kind == "entry", _O.local.is_not(None))
        latest = sa.select(sa.func.max(_E.created)).where(_E.id.not_in(imported))
        return max(self.now(), connection.execute(latest).scalar() or -math.inf)

    def problems(self) -> list[str]:
        """Findings of SQLite's integrity check, rows with missing references, and tables and values that cannot be
        MEMO's; empty on a server."""
        if not self.is_sqlite:
            return []
        pages: list[str] = []
        try:
            with self.read() as connection:
                for (page,) in connection.exec_driver_sql("PRAGMA integrity_check"):
                    pages.append(str(page))
                for table, row, missing, *_ in connection.exec_driver_sql("PRAGMA foreign_key_check"):
                    pages.append(f"{table} {row}: refers to a row of {missing} that is not there")
                broken = broken_tables(connection)
                pages += broken or broken_values(connection)
        except (sa.exc.DatabaseError, DamagedBook, UnicodeDecodeError) as error:  # too damaged to be looked through
            pages.append(str(getattr(error, "orig", error)))
        return [page for page in pages if page != "ok"]

    def size(self) -> int:
        """Bytes of the database file; 0 if there is none."""
        return self.path.stat().st_size if self.path is not None and self.path.exists() else 0

    def erase_traces(self) -> None:
        """After a deletion: rewrite the file without free pages and empty the log, so that deleted words are gone.

        Raises ``SkillbookError`` when another process reads the book all the time.
        """
        if not self.is_sqlite:
            return
        deadline = time.monotonic() + _ERASE_TIMEOUT_S
        with self._exclusive(), self.engine.connect() as connection:
            raw = connection.connection.dbapi_connection
            assert raw is not None
            raw.execute("VACUUM")
            raw.execute("PRAGMA busy_timeout=0")  # otherwise the first try alone would wait as long as a writer may
            try:
                while raw.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()[0]:
                    if time.monotonic() > deadline:
                        problem = "what was deleted is still in its log, because somebody else is reading the book"
                        remedy = "close the others; the next to close the book empties it"
                        raise SkillbookError(self.name, problem, remedy)
                    time.sleep(0.05)
            finally:
                raw.execute(f"PRAGMA busy_timeout={BUSY_TIMEOUT_MS}")

    # -- opening -------------------------------------------------------------------------------------------------------
    def _reading(self) -> sa.Connection:
        if self.is_sqlite:
            return self.engine.connect()
        # with the server's default each statement may see another state of the book
        return self.engine.connect().execution_options(isolation_level="REPEATABLE READ")

    def _writing(self) -> sa.Connection:
        return self.engine.connect().execution_options(memo_write=True)

    @contextmanager
    def _exclusive(self) -> Iterator[None]:
        if not self.in_memory:
            yield
            return
        with self._memory_lock:
            yield

    def _prepare(self) -> None:
        with self.read() as connection:
            names = set(sa.inspect(connection).get_table_names())
            found = self.meta(connection) if "meta" in names else {}
        if not found:
            if names:
                raise SkillbookError(
                    self.name, "this database is no skillbook: it has other tables", "choose another file"
                )
            if self.read_only and not self.in_memory:
                raise SkillbookError(self.name, "this file is no skillbook", "check the path")
            self._create()
            return
        version = found.get("schema_version", "?")
        if not version.isdigit() or int(version) > tables.SCHEMA_VERSION:
            raise SkillbookError(
                self.name,
                f"it has schema version {version}, this MEMO knows up to {tables.SCHEMA_VERSION}",
                "update memo-core, or use another book",
            )
        lacking = int(version) < tables.SCHEMA_VERSION or not names >= set(tables.metadata.tables)
        if lacking and not self.read_only:
            self._add_tables()

    def has(self, connection: sa.Connection, table: sa.Table) -> bool:
        """Whether the book has a table; a book of an older version that is open read-only may lack some."""
        if self._whole is None:
            names = set(sa.inspect(connection).get_table_names())
            self._whole = frozenset(tables.metadata.tables) <= names
            self._names = names
        return self._whole or table.name in self._names

    def has_table(self, table: sa.Table) -> bool:
        """As ``has``, in its own transaction."""
        if self._whole is None:
            with self.read() as connection:
                return self.has(connection, table)
        return self._whole or table.name in self._names

    def _add_tables(self) -> None:
        """Add the tables that an older book lacks, in one transaction."""
        with self.write() as connection:
            self._one_at_a_time(connection)
            before = self.meta(connection).get("schema_version", "")
            backup = None if before == str(tables.SCHEMA_VERSION) else self._back_up(before)
            tables.metadata.create_all(connection)
            if backup is not None:
                values = {"path": str(backup), "kind": "backup", "time": self.now()}
                connection.execute(self.upsert(tables.places).values(**values))
            for index in tables.entries.indexes:  # create_all leaves tables there as they are
                index.create(connection, checkfirst=True)
            for name in tables.FORMER_INDEXES:
                connection.exec_driver_sql(f"DROP INDEX IF EXISTS {name}")
            for name in tables.FORMER_TABLES:
                connection.exec_driver_sql(f"DROP TABLE IF EXISTS {name}")
            self.set_meta(connection, "schema_version", str(tables.SCHEMA_VERSION))

    def _back_up(self, version: str) -> Path | None:
        """Copy the file, beside it, before its schema is changed; None if there is no file. ``forget`` deletes the
        copy. Raises ``SkillbookError`` if it cannot be made."""
        path = self.path
        if path is None:
            return None
        backup = path.with_name(f"{path.name}.schema-{version}.backup")
        part = backup.with_name(f".{backup.name}.part")  # one process at a time gets here
        try:
            part.unlink(missing_ok=True)  # of a process that was killed
            with closing(sqlite3.connect(path)) as source, closing(sqlite3.connect(part)) as target:
                source.backup(target)
            os.replace(part, backup)
        except (OSError, sqlite3.Error) as error:
            part.unlink(missing_ok=True)
            problem = f"it has schema version {version}, and no backup could be made before it is changed ({error})"
            raise SkillbookError(self.name, problem, f"make room for {backup}, or open the book read-only") from error
        return backup

    def _create(self) -> None:
        with self._exclusive(), self._writing() as connection, connection.begin():
            self._one_at_a_time(connection)
            tables.metadata.create_all(connection)
            now = repr(self.now())
            first = {
                "schema_version": str(tables.SCHEMA_VERSION),
                "book": uuid.uuid4().hex,
                "generation": "0",
                "created": now,
            }
            for name, value in first.items():
                connection.execute(self.upsert(tables.meta).values(name=name, value=value))

    def _one_at_a_time(self, connection: sa.Connection) -> None:
        """Exclude other processes until the transaction ends, since only one can create the tables on a server."""
        if not self.is_sqlite:
            connection.execute(sa.select(sa.func.pg_advisory_xact_lock(_MAKING_TABLES)))
