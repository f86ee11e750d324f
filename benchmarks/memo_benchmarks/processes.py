"""Processes that this one started, and those that lost their parent on the way. Linux only."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import time
from pathlib import Path

from memo_core.errors import InvalidArgument

_GONE_S = 3.0  # a process without parent may take so long to notice
_SET_CHILD_SUBREAPER = 36


def adopt_orphans(command: str) -> None:
    """From here on processes that lose their parent come to this one. Raises ``InvalidArgument`` naming ``command``
    where the system has no ``/proc``."""
    if not Path("/proc/self/task").exists():
        raise InvalidArgument(command, "processes cannot be counted here", "Linux")
    ctypes.CDLL(None).prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def children() -> list[int]:
    """Ids of all children of this process."""
    found = []
    for file in Path("/proc/self/task").glob("*/children"):
        found += [int(pid) for pid in file.read_text().split()]
    return found


def orphans(known: set[int]) -> list[str]:
    """Commands of children other than ``known`` that did not end by themselves. They are killed."""
    deadline = time.monotonic() + _GONE_S
    while True:
        pids = [pid for pid in children() if pid not in known]
        for pid in pids:
            with contextlib.suppress(ChildProcessError):
                os.waitpid(pid, os.WNOHANG)
        alive = [pid for pid in pids if pid in children()]
        if not alive:
            return []
        if time.monotonic() > deadline:
            break
        time.sleep(0.05)
    names = []
    for pid in alive:
        names.append(Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")[:80])
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
    return names
