"""A real PostgreSQL of one's own on a Unix socket, for the tests, in a temporary folder and without privileges."""

from __future__ import annotations

import os
import pwd
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PROGRAMS = ("initdb", "pg_ctl", "createdb")


def find_postgres() -> Path | None:
    """The folder of PostgreSQL's programs: where Debian puts them, newest first, or on the path."""
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda p: -int(p.parent.name.split(".")[0]))
    on_path = shutil.which("initdb")
    folders += [Path(on_path).resolve().parent] if on_path else []
    return next((folder for folder in folders if all((folder / name).exists() for name in PROGRAMS)), None)


def missing() -> str:
    """Why PostgreSQL cannot be run here; empty when it can."""
    if find_postgres() is None:
        return "no PostgreSQL here: apt-get install postgresql"
    if os.getuid() == 0 and not any(_account(name) for name in ("postgres", "nobody")):
        return "PostgreSQL refuses to run as root, and there is no account `postgres` or `nobody`"
    try:
        import psycopg  # noqa: F401
    except ImportError:
        return "no driver: pip install 'psycopg[binary]'"
    return ""


@contextmanager
def postgres_server() -> Iterator[str]:
    """The folder of its socket; `url_of` makes a database and its URL."""
    programs = find_postgres()
    assert programs is not None
    folder = Path(tempfile.mkdtemp(prefix="memo-pg-"))  # short: a socket's path has 107 characters at most
    identity = {}
    if os.getuid() == 0:
        account = _account("postgres") or _account("nobody")
        assert account is not None
        os.chown(folder, account.pw_uid, account.pw_gid)
        identity = {"user": account.pw_uid, "group": account.pw_gid, "extra_groups": []}
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PG")} | {"LC_ALL": "C"}

    def run(program: str, *arguments: str) -> None:
        command = [str(programs / program), *arguments]
        # to a file, not a pipe: the server keeps what it is started with open
        with (folder / "log").open("ab") as log:
            os.chmod(folder / "log", 0o666)
            done = subprocess.run(command, stdout=log, stderr=log, cwd=folder, env=environment, **identity)
        assert done.returncode == 0, (folder / "log").read_text(errors="replace")[-2000:]

    data = str(folder / "data")
    try:
        run("initdb", "-D", data, "-U", "memo", "-A", "trust", "-E", "UTF8", "--no-sync")
        # a server that acknowledges early: the book must ask it not to
        options = f"-c synchronous_commit=off -c listen_addresses='' -c unix_socket_directories='{folder}'"
        run("pg_ctl", "-D", data, "-w", "-t", "60", "-o", options, "start")
        try:
            yield str(folder)
        finally:
            run("pg_ctl", "-D", data, "-w", "-m", "immediate", "stop")
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def url_of(server: str, database: str) -> str:
    """A new, empty database."""
    programs = find_postgres()
    assert programs is not None
    subprocess.run([str(programs / "createdb"), "-h", server, "-U", "memo", database], check=True)
    return f"postgresql://memo@/{database}?host={server}"


def _account(name: str) -> pwd.struct_passwd | None:
    try:
        return pwd.getpwnam(name)
    except KeyError:
        return None
