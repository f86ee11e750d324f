"""Promises about milliseconds, asked on machines where other programs run."""

from __future__ import annotations

from collections.abc import Callable


def shortest(measure: Callable[[], float], promise: float, tries: int = 8) -> float:
    """The shortest of some tries (s), ended by the first that keeps the promise (s). Other programs only ever add to
    what the code takes itself, so one that never keeps it is slow by itself."""
    times: list[float] = []
    while len(times) < tries and (not times or times[-1] >= promise):
        times.append(measure())
    return min(times)
