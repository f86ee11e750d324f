"""Flags and wakers for signal handlers: unlike ``threading.Event``, without a lock. The handler may have interrupted
the thread that holds it."""

from __future__ import annotations

import queue


class Flag:
    """A flag. Nobody waits for it; see ``Wake``."""

    def __init__(self) -> None:
        self._set = False

    def set(self) -> None:
        """Idempotent."""
        self._set = True

    def clear(self) -> None:
        """Idempotent."""
        self._set = False

    def is_set(self) -> bool:
        return self._set


class Wake:
    """Wakes the one thread that waits, once."""

    def __init__(self) -> None:
        self._calls: queue.SimpleQueue[None] = queue.SimpleQueue()  # its ``put`` may be interrupted by itself

    def set(self) -> None:
        """Wake the thread, or keep it from waiting. Idempotent."""
        self._calls.put(None)

    def wait(self, timeout: float | None = None) -> None:
        """Wait until woken, or for ``timeout`` seconds."""
        try:
            self._calls.get(timeout=timeout)
        except queue.Empty:
            return
