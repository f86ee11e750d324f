"""Opening the book's database and writing to it so that nothing acknowledged is lost.

SQLite by default: write-ahead log, ``synchronous=FULL``, write transactions begin IMMEDIATE. ``postgresql://`` for a
laboratory that shares one book. What the book promises (``docs/skillbook.md``) rests on this file.
"""

from __future__ import annotations

import os
import sqlite3
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import attrs
import sqlalchemy as sa
from sqlalchemy.pool import StaticPool

from memo_core.errors import InvalidArgument, MemoError
from memo_core.skillbook import tables
from memo_core.skillbook.integrity import broken_tables, broken_values

_NETWORK = """
nfs nfs4 cifs smb smb2 smb3 smbfs afs ncpfs 9p lustre gpfs ceph glusterfs beegfs orangefs pvfs2 davfs vboxsf prl_fs
fuse.sshfs fuse.glusterfs fuse.ceph-fuse fuse.s3fs fuse.rclone fuse.gcsfuse fuse.davfs2
"""
NETWORK_FILESYSTEMS = frozenset(_NETWORK.split())


@attrs.define(auto_exc=True, eq=False)
class SkillbookError(MemoError):
    """A book that cannot be opened or used as asked. ``book`` is its URL without secrets."""

    book: str
    problem: str
    remedy: str = ""

    def __str__(self) -> str:
        return f"skillbook {self.book}: {self.problem}" + (f" ({self.remedy})" if self.remedy else "")


@attrs.define(auto_exc=True, eq=False)
class ReadOnlyBook(SkillbookError):
    """A write to a book that was opened read-only."""


@attrs.define(auto_exc=True, eq=False)
class DamagedBook(SkillbookError):
    """A book whose file is not whole."""


# as SQLite says it
_BROKEN = ("malformed", "not a database", "database corruption", "no such table", "no such column", "Could not decode")
_DAMAGE = (*_BROKEN, "disk I/O error")  # which a full disk ends in as well
_BUSY_TIMEOUT_MS = 60_000  # a writer waits for another
_ERASE_TIMEOUT_S = 10.0
_MAKING_TABLES = 0x4D454D4F  # a number of our own among the server's advisory locks
_URL_FORMS = "sqlite:///FILE or postgresql://USER@HOST/NAME"


class Database:
    """One open database. ``read`` and ``write`` give a connection in a transaction; ``write`` serialises writers."""

    def __init__(self, url: str, read_only: bool = False) -> None:
        self.read_only = read_only
        self.now: Callable[[], float] = time.time  # s since the epoch; a book that is rebuilt has the time of its log
        self._url = _parse(url)
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
        engine = self._sqlite_engine() if self.is_sqlite else self._server_engine()
        self._engine = engine
        try:
            self._prepare()
        except sa.exc.DatabaseError as error:
            self.close()
            raise SkillbookError(self.name, f"cannot be opened: {error.orig}") from error
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
            raise

    def _say_damaged(self, error: BaseException | None, signs: tuple[str, ...] = _DAMAGE) -> None:
        """Raises ``DamagedBook`` for what SQLite says of a file that is not whole."""
        said = " ".join(str(error).split())
        if isinstance(error, sqlite3.DatabaseError) and any(sign in said for sign in signs):
            raise self._damaged(said) from error

    def _damaged(self, what: str) -> DamagedBook:
        remedy = f"memo skillbook check --book {self.name} says where; --rescue FILE gets out what can be read"
        return DamagedBook(self.name, f"its file is damaged ({what[:500]})", remedy)

    def blame(self, error: BaseException | None) -> None:
        """Raises ``DamagedBook`` where an unexpected error came of a book that is not whole: found by looking at all of
        it. Otherwise the error is a bug, and left to the caller."""
        if not isinstance(error, Exception) or isinstance(error, (MemoError, OSError)) or self._engine is None:
            return
        if problems := self.problems():
            raise self._damaged("; ".join(problems[:3])) from error

    def fetch(self, statement: sa.Select[Any], parameters: dict[str, Any]) -> Sequence[Sequence[Any]]:
        """Rows of one reading statement, a transaction of its own. For statements that are asked again and again: on
        a local file it goes past SQLAlchemy's execution, over a connection of its own that holds no lock between."""
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
                raise

    @contextmanager
    def write(self) -> Iterator[sa.Connection]:
        """A connection in a write transaction, durable when the block ends, undone when it raises.

        Raises ``SkillbookError`` when the disk is full or the server is gone.
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
            problem = f"could not be written ({' '.join(str(error.orig).split())}); what was stored before is safe"
            raise SkillbookError(self.name, problem, "make room on its disk, or see who holds it") from error
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
        """An INSERT that passes over rows that exist."""
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

    def next_generation(self, connection: sa.Connection, by_revisions: bool = False) -> int:
        """Count the change that this write transaction makes to what can be retrieved.

        ``by_revisions``: new revisions and what they list as changed tell all of it, so that who has counted the
        generation before need not count everything again (``memo_core.skillbook.retrieval_cache``).
        """
        generation = int(self.meta(connection)["generation"]) + 1
        self.set_meta(connection, "generation", str(generation))
        if not by_revisions:
            self.set_meta(connection, "uncounted", str(generation))
        return generation

    def problems(self) -> list[str]:
        """SQLite's own check of its pages, rows that refer to something that is not there, tables and values that
        cannot be MEMO's; none on a server."""
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
        except (sa.exc.DatabaseError, DamagedBook) as error:  # too damaged to be looked through
            pages.append(str(getattr(error, "orig", error)))
        return [page for page in pages if page != "ok"]

    def size(self) -> int:
        """Bytes of the database file; 0 where there is none."""
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
            raw.execute("PRAGMA busy_timeout=0")  # or the first try alone would wait as long as a writer may
            try:
                while raw.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()[0]:
                    if time.monotonic() > deadline:
                        problem = "what was deleted is still in its log, because somebody else is reading the book"
                        remedy = "close the others; the next to close the book empties it"
                        raise SkillbookError(self.name, problem, remedy)
                    time.sleep(0.05)
            finally:
                raw.execute(f"PRAGMA busy_timeout={_BUSY_TIMEOUT_MS}")

    # -- opening -------------------------------------------------------------------------------------------------------
    def _reading(self) -> sa.Connection:
        if self.is_sqlite:
            return self.engine.connect()
        # the server's default shows each statement another state of the book
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

    def _sqlite_engine(self) -> sa.Engine:
        if self.in_memory:
            engine = sa.create_engine("sqlite://", poolclass=StaticPool, connect_args={"check_same_thread": False})
        else:
            path = Path(os.path.expanduser(str(self._url.database))).absolute()
            self._check_path(path)
            quoted = str(path).replace("%", "%25").replace("?", "%3f").replace("#", "%23")
            mode = "rwc"
            if self.read_only:
                bare = not path.with_name(path.name + "-wal").exists() and not os.access(path.parent, os.W_OK)
                mode = "ro&immutable=1" if bare else "ro"  # on a read-only medium the log's index cannot be made
            address = f"file:{quoted}?mode={mode}"
            engine = sa.create_engine(
                "sqlite://",
                creator=lambda: sqlite3.connect(address, uri=True, timeout=60.0, check_same_thread=False),
                poolclass=sa.QueuePool,
            )
        writable = self.in_memory or not self.read_only
        sa.event.listen(engine, "connect", lambda raw, _record: _configure_sqlite(raw, writable))
        sa.event.listen(engine, "begin", _begin_sqlite)
        return engine

    def _check_path(self, path: Path) -> None:
        if path.is_dir():
            raise SkillbookError(self.name, f"{path} is a folder", "name a file, e.g. sqlite:///book.db")
        if path.exists() and not _may_be_sqlite(path):
            raise SkillbookError(self.name, f"{path} is no skillbook: it is some other file", "choose another file")
        if self.read_only and not path.exists():
            raise SkillbookError(self.name, f"there is no file {path}", "teach something first, or check the path")
        if not self.read_only:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise SkillbookError(self.name, f"its folder {path.parent} cannot be made: {error.strerror}") from error
        kind = filesystem_of(path)
        if kind in NETWORK_FILESYSTEMS:
            raise SkillbookError(
                self.name,
                f"{path} is on a network file system ({kind}), where SQLite's locks cannot be trusted",
                "keep it on a local disk, or share a book with postgresql://user@host/database",
            )

    def _server_engine(self) -> sa.Engine:
        try:
            engine = sa.create_engine(self._url, pool_pre_ping=True)
        except ModuleNotFoundError as error:
            problem = f"its driver {error.name!r} is not installed"
            raise SkillbookError(self.name, problem, "pip install 'psycopg[binary]'") from error
        sa.event.listen(engine, "connect", lambda raw, _record: _configure_server(raw))
        if self.read_only:
            engine = engine.execution_options(postgresql_readonly=True)
        return engine

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
        """Whether the book has a table: one of an older version that is open read-only may lack some."""
        if self._whole is None:
            names = set(sa.inspect(connection).get_table_names())
            self._whole = frozenset(tables.metadata.tables) <= names
            self._names = names
        return self._whole or table.name in self._names

    def has_table(self, table: sa.Table) -> bool:
        """``has``, without a transaction at hand."""
        if self._whole is None:
            with self.read() as connection:
                return self.has(connection, table)
        return self._whole or table.name in self._names

    def _add_tables(self) -> None:
        """What an older book lacks, all or nothing."""
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
        """A copy of the file as it is before its schema is changed, beside it; None where there is no file. ``forget``
        knows of it. Raises ``SkillbookError`` where it cannot be made."""
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
        """Until the transaction ends. Of several processes that make the same table on a server, all but one fail."""
        if not self.is_sqlite:
            connection.execute(sa.select(sa.func.pg_advisory_xact_lock(_MAKING_TABLES)))


def _parse(url: str) -> sa.URL:
    if "\0" in url:
        raise InvalidArgument("skillbook", f"{url!r} holds a null character", _URL_FORMS)
    if "://" not in url:
        return sa.URL.create("sqlite", database=url)
    try:
        parsed = sa.engine.make_url(url)
    except (sa.exc.ArgumentError, ValueError):
        raise InvalidArgument("skillbook", f"{url!r} is no database URL", _URL_FORMS) from None
    if parsed.password is not None or any("password" in name.lower() for name in parsed.query):
        raise InvalidArgument(
            "skillbook", "the URL holds a password", "it in the environment (PGPASSWORD) or ~/.pgpass"
        )
    if parsed.get_backend_name() not in ("sqlite", "postgresql"):
        raise InvalidArgument("skillbook", f"{parsed.get_backend_name()!r} is not supported", _URL_FORMS)
    if parsed.get_backend_name() == "sqlite" and "?" in url:
        problem = f"{url!r}: what follows the ? would be taken for options, and there are none"
        raise InvalidArgument("skillbook", problem, "sqlite:///FILE; a path with a ? without sqlite:///")
    if parsed.drivername == "postgresql":
        parsed = parsed.set(drivername="postgresql+psycopg")
    return parsed


def _may_be_sqlite(path: Path) -> bool:
    """SQLite itself takes a file of a few bytes for a new database, and writes over it."""
    try:
        with path.open("rb") as stream:
            start = stream.read(16)
    except OSError:
        return True  # it says why when it opens the file
    return start in (b"", b"SQLite format 3\x00")


def _configure_sqlite(raw: sqlite3.Connection, writable: bool) -> None:
    raw.isolation_level = None  # the driver would begin DEFERRED by itself, and late
    cursor = raw.cursor()
    cursor.execute("PRAGMA foreign_keys=ON")
    # KiB. A large sheet goes through the cache once: in a bigger one every page of it is memory that was never touched
    # before, which took longer than reading it (the slowest hundredth of a million entries: 10 ms instead of 4).
    cursor.execute("PRAGMA cache_size=-8192")
    if writable:
        cursor.execute(f"PRAGMA busy_timeout={_BUSY_TIMEOUT_MS}")
        _switch_to_wal(cursor)
        cursor.execute("PRAGMA synchronous=FULL")
        cursor.execute("PRAGMA secure_delete=ON")
    else:
        cursor.execute("PRAGMA query_only=ON")
    cursor.close()


def _configure_server(raw: Any) -> None:
    """A server configured to acknowledge before writing could lose acknowledged data."""
    off = "SELECT set_config('synchronous_commit', 'on', false) WHERE current_setting('synchronous_commit') = 'off'"
    with raw.cursor() as cursor:
        cursor.execute(off)
    raw.commit()


def _switch_to_wal(cursor: sqlite3.Cursor) -> None:
    # busy_timeout does not cover this switch: of several processes that open a new book at once, one is told "locked"
    deadline = time.monotonic() + 60.0
    while True:
        try:
            cursor.execute("PRAGMA journal_mode=WAL")
            return
        except sqlite3.OperationalError as error:
            if "locked" not in str(error) or time.monotonic() > deadline:
                raise
            time.sleep(0.02)


def _begin_sqlite(connection: sa.Connection) -> None:
    write = connection.get_execution_options().get("memo_write", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if write else "BEGIN")


def filesystem_of(path: Path, mountinfo: Path = Path("/proc/self/mountinfo")) -> str:
    """The kind of file system ``path`` is or would be on ("ext4", "nfs4"); "" where the system does not tell."""
    try:
        lines = mountinfo.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    target = os.path.realpath(path)
    best, kind = "", ""
    for line in lines:
        fields, _, tail = line.partition(" - ")
        parts = fields.split()
        if len(parts) < 5 or not tail:
            continue
        point = parts[4].replace("\\040", " ").replace("\\011", "\t").replace("\\012", "\n").replace("\\134", "\\")
        inside = target == point or target.startswith(point.rstrip("/") + "/")
        if inside and len(point) >= len(best):
            best, kind = point, tail.split()[0]
    return kind
