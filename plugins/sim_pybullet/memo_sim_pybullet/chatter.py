"""What Bullet prints by itself: kept out of the standard output, since commands print JSON there."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

_one_at_a_time = threading.Lock()


@contextmanager
def caught_output(*streams: int) -> Iterator[Callable[[], str]]:
    """Catch what native code prints meanwhile to these streams (file descriptors; none: the standard output); yields a
    function that tells it."""
    streams = streams or (1,)
    with _one_at_a_time, tempfile.TemporaryFile() as file:
        _flush()
        real = {stream: os.dup(stream) for stream in streams}
        try:
            for stream in streams:
                os.dup2(file.fileno(), stream)

            def said() -> str:
                _flush()
                file.seek(0)
                return " ".join(file.read().decode(errors="replace").split())

            yield said
        finally:
            _flush()
            for stream, kept in real.items():
                os.dup2(kept, stream)
                os.close(kept)


def _flush() -> None:
    """Python's buffers and C's: what Bullet prints into a pipe waits in the latter until the program ends."""
    sys.stdout.flush()
    sys.stderr.flush()
    with suppress(OSError, AttributeError):  # where there is no C library to ask by that name
        ctypes.CDLL(None).fflush(None)
