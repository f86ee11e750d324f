"""What the threads of a run or of a clustering have freed goes back to the system. glibc's malloc keeps it in arenas of
the threads, and each has new threads: a process that makes runs for hours grows about twice as fast without
(docs/run-log.md)."""

from __future__ import annotations

import ctypes
import sys


def give_back_freed_memory() -> None:
    """Does nothing where the C library is not glibc."""
    if sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)) is not None:
        trim(0)
