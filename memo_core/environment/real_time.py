"""Keeping a simulation from running faster than the clock on the wall, so that a person can follow it and interrupt."""

from __future__ import annotations

import time
from collections.abc import Callable

_CATCH_UP_S = 0.1  # that a simulation may lag behind and make up for; after a longer delay it goes on from there


class RealTime:
    """A tick listener that waits until the wall clock has advanced as far as the simulation."""

    def __init__(self, now: Callable[[], float], stopped: Callable[[], bool]) -> None:
        """Start with the next tick.

        Args:
            now: the simulation's clock (s).
            stopped: whether a stop is latched; then nothing is waited for, so that the arm brakes at once.
        """
        self._now = now
        self._stopped = stopped
        self._offset = -float("inf")  # s, of the wall clock ahead of the simulation's
        self._last = 0.0

    def wait(self) -> None:
        """Wait until it is time for the state after this tick: about one control period."""
        now, wall = self._now(), time.monotonic()
        step, self._last = now - self._last, now
        ahead = now + self._offset - wall
        if not (0 < step < _CATCH_UP_S and abs(ahead) < _CATCH_UP_S):  # a pause, or another checkpoint
            self._offset, ahead = wall - now, 0.0
        if ahead > 0 and not self._stopped():
            time.sleep(ahead)
