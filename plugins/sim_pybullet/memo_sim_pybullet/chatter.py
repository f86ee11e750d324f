"""What Bullet prints to the standard output by itself: kept out of it, since commands print JSON there."""

from __future__ import annotations

import os
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_one_at_a_time = threading.Lock()


@contextmanager
def caught_output() -> Iterator[Callable[[], str]]:
    """Catch what native code prints meanwhile; yields a function that tells it."""
    with _one_at_a_time, tempfile.TemporaryFile() as file:
        sys.stdout.flush()
        real = os.dup(1)
        try:
            os.dup2(file.fileno(), 1)

            def said() -> str:
                file.seek(0)
                return " ".join(file.read().decode(errors="replace").split())

            yield said
        finally:
            os.dup2(real, 1)
            os.close(real)
