"""One process at a time works in an experiment's folder."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from memo_core.errors import InvalidArgument


@contextmanager
def working_in(folder: Path) -> Iterator[None]:
    """Keep others out of ``folder`` while the block runs; the system lets go however the process ends. Raises
    ``InvalidArgument`` where another process is at work. Without effect on a file system without locks."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("w") as file:
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            problem = f"another process is at work in {folder}"
            raise InvalidArgument("DIR", problem, "another folder; or wait for it, or stop it") from None
        except OSError:
            pass
        yield
