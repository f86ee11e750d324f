"""Temporary folders. Those that a killed process left behind are removed when the next one is created.

A folder is locked while it is in use. The lock ends with the process, so a folder that can be locked is not in use."""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

PREFIX = "memo-scratch-"


@contextlib.contextmanager
def scratch_folder() -> Iterator[Path]:
    """A new, empty folder in the system's temporary directory, gone after the block."""
    clear_abandoned()
    while True:
        folder = Path(tempfile.mkdtemp(prefix=PREFIX))
        if (lock := _locked(folder)) is not None:
            break  # else another process took it for abandoned, between its making and its locking
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(lock)


def clear_abandoned() -> None:
    """Remove the folders of processes that are gone."""
    for folder in Path(tempfile.gettempdir()).glob(PREFIX + "*"):
        if (lock := _locked(folder)) is not None:
            shutil.rmtree(folder, ignore_errors=True)
            os.close(lock)


def _locked(folder: Path) -> int | None:
    """A file handle that holds the folder's lock; None if another process has it or the folder is not ours."""
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.fstat(handle).st_nlink and os.path.samestat(os.fstat(handle), os.stat(folder)):
            return handle
    except OSError:
        pass
    os.close(handle)
    return None
