"""Which keys are nearest to a subtask. Compared are keys, not entries: many entries share a key.

All keys are scored, exactly, from the few parts that they are made of (``memo_core.skillbook.key_factors``): 5 000 keys
in 0.1 ms, 200 000 in 3 ms. Texts are many and are what the vector store is for (``memo_core.skillbook.text_search``).
"""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.skillbook.key_embedding import KeyVectors
from memo_core.skillbook.key_factors import KeyParts
from memo_core.skillbook.keys import Key
from memo_core.skillbook.retrieval_score import TIE, key_score
from memo_core.skillbook.term_lists import nth_largest


@attrs.frozen(eq=False)
class KeyScores:
    """The terms of r of every key, by its row in ``KeyIndex.ids``; float64, shape (n,)."""

    scores: np.ndarray
    action_cosines: np.ndarray
    objects_cosines: np.ndarray
    moved_cosines: np.ndarray  # of what is moved alone, without where to
    exchanged: np.ndarray  # share of what the objects have in common that they have in exchanged roles only, 0 to 1

    def best_first(self, count: int) -> np.ndarray:
        """Rows of the ``count`` keys with the largest r, and of all that tie with the last, in order; int64."""
        if count >= len(self.scores):
            rows = np.arange(len(self.scores))
        else:
            rows = np.flatnonzero(self.scores >= nth_largest(self.scores, count))
        return rows[np.lexsort((rows, -self.scores[rows]))]


class KeyIndex:
    """The keys of one state of the book."""

    def __init__(self, key_vectors: KeyVectors) -> None:
        self._key_vectors = key_vectors
        self.ids: np.ndarray = np.zeros(0, dtype=np.int64)  # ascending
        self._parts: KeyParts | None = None
        self._book: str | None = None

    def load(self, keys: dict[int, Key], book: str) -> None:
        """Take over the keys of a book's state by their ids; nothing is done when they are those of the last one."""
        ordered = dict(sorted(keys.items()))
        ids = np.fromiter(ordered, dtype=np.int64, count=len(ordered))
        if book == self._book and np.array_equal(ids, self.ids):  # a key's row is never changed
            return
        self.ids, self._book = ids, book
        self._parts = self._key_vectors.parts(list(ordered.values())) if ordered else None

    def score(self, action: np.ndarray, objects: np.ndarray, weights: tuple[float, float]) -> KeyScores:
        """r and its terms of all keys, for unit vectors of a subtask's action, shape (d,), and objects, (2 d,)."""
        if self._parts is None:
            nothing = np.zeros(0)
            return KeyScores(nothing, nothing, nothing, nothing, nothing)
        by_action, by_objects, by_moved, crossed = self._parts.cosines(action, objects)
        scores = key_score(by_action, by_objects, *weights)
        exchanged = np.clip((crossed - by_objects) / np.maximum(1 - by_objects, TIE), 0.0, 1.0)
        return KeyScores(scores, by_action, by_objects, by_moved, exchanged)
