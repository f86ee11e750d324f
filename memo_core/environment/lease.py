"""One process at a time moves a robot: a lock file for each robot's address, given back however the process ends."""

from __future__ import annotations

import contextlib
import fcntl
import os
import re
import tempfile
from pathlib import Path

from memo_core.errors import BackendUnavailable


class Lease:
    """The right to move the robot at ``address``, for processes of this machine."""

    def __init__(self, address: str, folder: Path | None = None) -> None:
        self.address = address
        name = re.sub(r"[^\w.-]+", "-", address).strip("-")
        self.file = (folder or Path(tempfile.gettempdir())) / f"memo-robot-{name}.lock"
        self._handle: int | None = None

    def take(self) -> None:
        """Raises ``BackendUnavailable``, which names the process that has it."""
        handle = self._locked()
        try:
            os.ftruncate(handle, 0)
            os.pwrite(handle, f"{os.getpid()}\n".encode(), 0)
        except OSError:
            pass  # another user's file, opened for reading: the lock counts, not what is written
        self._handle = handle

    def _locked(self) -> int:
        """The lock file, opened and locked: the one that has the name, not one whose holder removed it meanwhile."""
        while True:
            handle = self._open()
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                holder = os.pread(handle, 20, 0).decode(errors="replace").strip()
                os.close(handle)
                who = f"process {holder}" if holder.isdecimal() else "another process"
                problem = f"{who} moves the robot at {self.address} (lock {self.file})"
                raise BackendUnavailable("robot", self.address, problem, "wait for it, or end it") from None
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), os.stat(self.file)):
                    return handle
            os.close(handle)

    def _open(self) -> int:
        """Also where the file is another user's, which a folder for everybody may forbid to write to."""
        try:
            return os.open(self.file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        except PermissionError:
            return os.open(self.file, os.O_RDONLY | os.O_CLOEXEC)

    def give_back(self) -> None:
        """Idempotent. The file is removed before its lock is given back, so that whoever waits for it sees that it has
        gone (``_locked``)."""
        handle, self._handle = self._handle, None
        if handle is not None:
            with contextlib.suppress(OSError):  # another user's file in a folder for everybody stays
                self.file.unlink()
            os.close(handle)
