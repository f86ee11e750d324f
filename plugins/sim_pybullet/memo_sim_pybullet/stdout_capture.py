"""Keeps what Bullet prints on its own out of standard output, where commands print JSON."""

from __future__ import annotations

import ctypes
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TextIO

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


class Diversion:
    """Discards what native code prints on the standard output, from any thread, until ``end``; what Python prints is
    kept."""

    def __init__(self) -> None:
        _flush()
        self._real: int | None = os.dup(1)
        self._python = sys.stdout
        self._instead: TextIO | None = None
        try:
            if sys.stdout.fileno() == 1:
                encoding = sys.stdout.encoding
                self._instead = open(os.dup(1), "w", encoding=encoding, errors="replace", buffering=1)  # noqa: SIM115
                sys.stdout = self._instead
        except (OSError, ValueError):  # a standard output that is no file: nothing native writes to it
            pass
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.close(nowhere)

    def end(self) -> None:
        """Idempotent."""
        if self._real is None:
            return
        _flush()
        os.dup2(self._real, 1)
        os.close(self._real)
        self._real = None
        if self._instead is not None:
            if sys.stdout is self._instead:
                sys.stdout = self._python
            self._instead.close()


def _flush() -> None:
    """Python's buffers and C's: what Bullet prints into a pipe waits in the latter until the program ends."""
    sys.stdout.flush()
    sys.stderr.flush()
    with suppress(OSError, AttributeError):  # where there is no C library to ask by that name
        ctypes.CDLL(None).fflush(None)
