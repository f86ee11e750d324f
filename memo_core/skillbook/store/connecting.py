"""Connecting to the database of a skillbook: a SQLite file, SQLite in memory, or a PostgreSQL server.

The settings made here are what the book's promises rest on: SQLite writes ahead with ``synchronous=FULL``, its write
transactions begin IMMEDIATE, files on network file systems are refused, and a server may not acknowledge before
writing.
"""

from __future__ import annotations

import os
import re
import sqlite3
import time
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy.pool import StaticPool

from memo_core.errors import InvalidArgument, close_match
from memo_core.skillbook.model.errors import SkillbookError
from memo_core.text.parsing import encodable

_NETWORK = """
nfs nfs4 cifs smb smb2 smb3 smbfs afs ncpfs 9p lustre gpfs ceph glusterfs beegfs orangefs pvfs2 davfs vboxsf prl_fs
fuse.sshfs fuse.glusterfs fuse.ceph-fuse fuse.s3fs fuse.rclone fuse.gcsfuse fuse.davfs2
"""
NETWORK_FILESYSTEMS = frozenset(_NETWORK.split())

BUSY_TIMEOUT_MS = 60_000  # a writer waits this long for another one
_READ_ONLY = "skillbook.read_only=true only retrieves from it; to write, make file and folder writable, or use a copy"
_URL_FORMS = "sqlite:///FILE or postgresql://USER@HOST/NAME"
_KINDS = ("sqlite", "postgresql")
_HALF_A_URL = re.compile(r"(sqlite|file|postgres(ql)?)(\+\w+)?:(?!//)", re.IGNORECASE)


def parse_url(url: str) -> sa.URL:
    """A database URL, or the path of a file, as a URL. Raises ``InvalidArgument``, also for one with a password."""
    if "\0" in url:
        raise InvalidArgument("skillbook", f"{url!r} holds a null character", _URL_FORMS)
    if not encodable(url):
        raise InvalidArgument("skillbook", f"{url!r} is not UTF-8 text", _URL_FORMS)
    if not url.strip():
        raise InvalidArgument("skillbook", f"{url!r} names no book", f"the path of a file, {_URL_FORMS}")
    if _HALF_A_URL.match(url):
        raise InvalidArgument("skillbook", f"{url!r} is no database URL", f"{_URL_FORMS}; ./{url} for a file so named")
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
    kind = parsed.get_backend_name()
    if kind not in _KINDS:
        raise InvalidArgument("skillbook", f"{kind!r} is not supported{close_match(kind, _KINDS)}", _URL_FORMS)
    if kind == "sqlite" and parsed.host:  # SQLAlchemy would open an empty book in memory
        problem = f"{url!r} names a host, and SQLite has none"
        raise InvalidArgument("skillbook", problem, f"sqlite:///{url.partition('://')[2]}")
    if kind == "sqlite" and "?" in url:
        problem = f"{url!r}: what follows the ? would be taken for options, and there are none"
        raise InvalidArgument("skillbook", problem, "sqlite:///FILE; a path with a ? without sqlite:///")
    if parsed.drivername == "postgresql":
        parsed = parsed.set(drivername="postgresql+psycopg")
    return parsed


def sqlite_engine(name: str, path: Path | None, read_only: bool) -> sa.Engine:
    """``path`` None: in memory. ``name`` is the book's, for errors. Raises ``SkillbookError`` for an unusable path."""
    if path is None:
        engine = sa.create_engine("sqlite://", poolclass=StaticPool, connect_args={"check_same_thread": False})
    else:
        _check_path(name, path, read_only)
        quoted = str(path).replace("%", "%25").replace("?", "%3f").replace("#", "%23")
        mode = "rwc"
        if read_only:
            mode = "ro&immutable=1" if _is_bare(path) else "ro"
        address = f"file:{quoted}?mode={mode}"
        engine = sa.create_engine(
            "sqlite://",
            creator=lambda: sqlite3.connect(address, uri=True, timeout=60.0, check_same_thread=False),
            poolclass=sa.QueuePool,
        )
    writable = path is None or not read_only
    sa.event.listen(engine, "connect", lambda raw, _record: _configure_sqlite(raw, writable))
    sa.event.listen(engine, "begin", _begin_sqlite)
    return engine


def _is_bare(path: Path) -> bool:
    """Whether a book has no log to read beside it, and the log's index could not be made, as on a read-only medium."""
    log, index = (path.with_name(path.name + end) for end in ("-wal", "-shm"))
    return not os.access(path.parent, os.W_OK) and (not log.exists() or not (log.stat().st_size or index.exists()))


def refused(name: str, path: Path | None, error: BaseException | None, doing: str) -> SkillbookError:
    """The error for a database that refused to be opened, read or written.

    Args:
        name: the book's name.
        path: its file; None in memory and on a server.
        error: what the driver raised.
        doing: what was attempted, for example "cannot be opened".
    """
    said = " ".join(str(error).split())
    if path is None:
        return SkillbookError(name, f"{doing}: {said}", "see whether its server runs and the URL is right")
    fixed = not os.access(path.parent, os.W_OK)
    if fixed and "unable to open" in said and path.with_name(f"{path.name}-wal").exists():
        problem = f"{path} has a log beside it that must be merged first, and its folder cannot be written"
        return SkillbookError(name, problem, f"copy {path}* to another folder, and use the copy")
    if "readonly" in said or (fixed and "unable to open" in said):
        problem = f"{doing}: its {'folder ' + str(path.parent) if fixed else 'file ' + str(path)} is read-only"
        return SkillbookError(name, problem, _READ_ONLY)
    if "locked" in said:
        return SkillbookError(name, f"{doing}: {said}", f"end the program that holds {path}, or try again later")
    return SkillbookError(name, f"{doing}: {said}", "make room on its disk, or see who holds it")


def _check_path(name: str, path: Path, read_only: bool) -> None:
    try:
        path.lstat()
    except FileNotFoundError:
        pass
    except OSError as error:  # a name that is too long, a folder that may not be looked into
        raise SkillbookError(name, f"{path} cannot be opened: {error.strerror}", "name a file") from error
    if path.is_dir():
        raise SkillbookError(name, f"{path} is a folder", "name a file, e.g. sqlite:///book.db")
    if path.exists() and not _may_be_sqlite(path):
        raise SkillbookError(name, f"{path} is no skillbook: it is some other file", "choose another file")
    if read_only and not path.exists():
        raise SkillbookError(name, f"there is no file {path}", "teach something first, or check the path")
    if not read_only:
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SkillbookError(name, f"its folder {path.parent} cannot be made: {error.strerror}") from error
    kind = filesystem_of(path)
    if kind in NETWORK_FILESYSTEMS:
        raise SkillbookError(
            name,
            f"{path} is on a network file system ({kind}), where SQLite's locks cannot be trusted",
            "keep it on a local disk, or share a book with postgresql://user@host/database",
        )


def server_engine(name: str, url: sa.URL, read_only: bool) -> sa.Engine:
    """Raises ``SkillbookError`` if the driver is not installed."""
    try:
        engine = sa.create_engine(url, pool_pre_ping=True)
    except ModuleNotFoundError as error:
        problem = f"its driver {error.name!r} is not installed"
        raise SkillbookError(name, problem, "pip install 'psycopg[binary]'") from error
    sa.event.listen(engine, "connect", lambda raw, _record: _configure_server(raw))
    if read_only:
        engine = engine.execution_options(postgresql_readonly=True)
    return engine


def _may_be_sqlite(path: Path) -> bool:
    """Checked because SQLite itself treats a file of a few bytes as a new database and overwrites it."""
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
    cursor.execute("PRAGMA cache_size=-8192")  # KiB
    if writable:
        cursor.execute(f"PRAGMA busy_timeout={BUSY_TIMEOUT_MS}")
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
    """The kind of file system ``path`` is or would be on ("ext4", "nfs4"); "" if the system does not report it."""
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
