"""Looking up what is kept of a row by the row's id: a table, since a binary search among a million ids, which lie apart
in memory, takes ten times as long."""

from __future__ import annotations

import numpy as np

_FAR = 1 << 26  # ids are given one after the other; what a damaged book has beyond this is kept apart
_ROOM = 1024


class IdTable:
    """Whole numbers from 0 on, by id."""

    def __init__(self) -> None:
        self._held = np.zeros(min(_ROOM, _FAR), np.int32)  # by id, one more than the number; 0: none
        self._far: dict[int, int] = {}

    @property
    def nbytes(self) -> int:
        return self._held.nbytes

    def put(self, ids: np.ndarray, numbers: np.ndarray) -> None:
        """Both of shape (n,)."""
        near = (ids >= 0) & (ids < _FAR)
        self._far.update(zip(ids[~near].tolist(), numbers[~near].tolist(), strict=True))
        room = int(ids[near].max(initial=-1)) + 1
        if room > len(self._held):
            held = np.zeros(min(room + room // 4, _FAR), np.int32)
            held[: len(self._held)] = self._held
            self._held = held
        self._held[ids[near]] = numbers[near] + 1

    def get(self, ids: np.ndarray) -> np.ndarray:
        """int64 (n,), -1 for unknown ids."""
        found = self._held.take(ids, mode="clip").astype(np.int64) - 1
        outside = (ids < 0) | (ids >= len(self._held))
        if outside.any():
            found[outside] = [self._far.get(one, -1) for one in ids[outside].tolist()]
        return found
