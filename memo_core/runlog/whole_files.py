"""Writing files atomically."""

from __future__ import annotations

import contextlib
import errno
import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import attrs

from memo_core.errors import MemoError

_UNFINISHED = ".unfinished"


@attrs.define(auto_exc=True, eq=False)
class CannotWrite(MemoError):
    """A file that a run needs cannot be written, for example because the disk is full or a folder has its name."""

    file: Path
    problem: str

    def __str__(self) -> str:
        return f"{self.file} cannot be written: {self.problem}"


@contextlib.contextmanager
def writing(file: Path) -> Iterator[None]:
    """Raise ``CannotWrite`` in place of an ``OSError`` within the block."""
    try:
        yield
    except OSError as error:
        problem = (
            "a file is where its folder should be" if error.errno in (errno.EEXIST, errno.ENOTDIR) else error.strerror
        )
        raise CannotWrite(file, problem or str(error)) from error


def write_whole(path: Path, content: str | bytes) -> Path:
    """Write a file atomically; it is on disk when this returns. Raises ``CannotWrite``."""
    with whole_file(path) as file:
        file.write(content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content)
    return path


@contextlib.contextmanager
def whole_file(path: Path) -> Iterator[BinaryIO]:
    """A file to write to. It replaces ``path`` on disk when the block ends and is deleted when the block raises. Raises
    ``CannotWrite``."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}{_UNFINISHED}")
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            with temporary.open("wb") as file:
                yield file
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, path)
        except BaseException:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise


def clear_unfinished(folder: Path) -> None:
    """Remove the temporary files that processes killed in ``write_whole`` left in ``folder`` and its subfolders. No
    process may be writing there."""
    for file in folder.rglob(f".*{_UNFINISHED}"):
        file.unlink(missing_ok=True)
