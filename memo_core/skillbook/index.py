"""The derived index: one vector a distinct key, in a vector store, rebuilt whenever it is not the database's.

Indexed are keys, not entries: many entries share a key. With the query [λ1 q_act ; λ2 q_obj] / (λ1 + λ2) the inner
product with a key's [v_act ; v_obj] is r(q, v) exactly, for any λ. What a store returns is scored again from the
vectors kept here, so an approximate store can miss but never lie.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable

import attrs
import numpy as np

from memo_core.errors import BackendUnavailable
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook.keys import Key
from memo_core.skillbook.wording import KeyVectors

_FIRST = 32  # keys asked for at first


@attrs.frozen(eq=False)
class Hits:
    """Keys by r, largest first: their rows in ``KeyIndex.ids`` and the terms of r, each of shape (n,)."""

    rows: np.ndarray  # int64
    scores: np.ndarray  # float64
    action_cosines: np.ndarray  # float64
    objects_cosines: np.ndarray  # float64


class KeyIndex:
    """Keys of one generation of the book, searchable by inner product. The store is this index's alone."""

    def __init__(self, store: VectorStore, key_vectors: KeyVectors) -> None:
        self._store = store
        self._key_vectors = key_vectors
        self.ids: np.ndarray = np.zeros(0, dtype=np.int64)  # ascending
        self._actions = np.zeros((0, 0), dtype=np.float32)
        self._objects = np.zeros((0, 0), dtype=np.float32)
        self._stamp = -1

    def load(self, keys: dict[int, Key], generation: int, book: str) -> None:
        """Take over the keys of a generation, by ascending id; the store is rebuilt unless it is up to date."""
        ordered = dict(sorted(keys.items()))
        self.ids = np.fromiter(ordered, dtype=np.int64, count=len(ordered))
        self._stamp = (generation << 32) | zlib.crc32(f"{book}|{self._key_vectors.fingerprint()}".encode())
        if not ordered:
            return
        self._actions, self._objects = self._key_vectors.get(list(ordered.values()))
        if not self._store_is_current():
            self._rebuild()

    def search(
        self, action: np.ndarray, objects: np.ndarray, weights: tuple[float, float], enough: Callable[[Hits], bool]
    ) -> Hits:
        """The best keys: as many as it takes until ``enough`` of the list so far, or all."""
        if not len(self.ids):
            nothing = np.zeros(0)
            return Hits(np.zeros(0, dtype=np.int64), nothing, nothing, nothing)
        total = weights[0] + weights[1]
        query = np.concatenate([weights[0] * action, weights[1] * objects]).astype(np.float32) / np.float32(total)
        count = min(_FIRST, len(self.ids))
        while True:
            hits = self._score(self._search_store(query, count), action, objects, weights)
            if count >= len(self.ids) or enough(hits):
                return hits
            count = min(4 * count, len(self.ids))

    def _score(self, rows: np.ndarray, action: np.ndarray, objects: np.ndarray, weights: tuple[float, float]) -> Hits:
        by_action = (self._actions[rows] @ action).astype(np.float64)
        by_objects = (self._objects[rows] @ objects).astype(np.float64)
        scores = (weights[0] * by_action + weights[1] * by_objects) / (weights[0] + weights[1])
        order = np.lexsort((rows, -scores))
        return Hits(rows[order], scores[order], by_action[order], by_objects[order])

    def _search_store(self, query: np.ndarray, count: int) -> np.ndarray:
        """Rows of the keys that the store says are best."""
        for rebuilt in (False, True, True):
            try:
                if self._store_is_ours():
                    found, _ = self._store.search(query, count)
                    rows = np.minimum(np.searchsorted(self.ids, found), len(self.ids) - 1)
                    if len(found) and np.array_equal(self.ids[rows], found):
                        return rows
            except Exception:
                if rebuilt:
                    raise
            self._rebuild()  # whatever a corrupt store does, it is derived data and made anew
        problem = "a fresh index returns ids that were never added"
        raise BackendUnavailable("vectorstore", type(self._store).__name__, problem)

    def _store_is_ours(self) -> bool:
        return self._store.generation() in (None, self._stamp) and len(self._store) == len(self.ids)

    def _store_is_current(self) -> bool:
        try:
            self._store.open()
            return self._store.generation() == self._stamp and len(self._store) == len(self.ids)
        except Exception:
            return False

    def _rebuild(self) -> None:
        vectors = np.concatenate([self._actions, self._objects], axis=1)
        self._store.open()
        self._store.reset(vectors.shape[1])
        self._store.add([int(i) for i in self.ids], vectors)
        self._store.set_generation(self._stamp)
