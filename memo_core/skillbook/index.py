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


@attrs.frozen(eq=False)
class Scored:
    """A key with the terms of its score."""

    id: int
    key: Key
    score: float
    action_cosine: float
    objects_cosine: float


class KeyIndex:
    """Keys of one generation of the book, searchable by inner product."""

    def __init__(self, store: VectorStore, key_vectors: KeyVectors) -> None:
        self._store = store
        self._key_vectors = key_vectors
        self._ids: np.ndarray = np.zeros(0, dtype=np.int64)
        self._rows: dict[int, int] = {}
        self._keys: list[Key] = []
        self._actions = np.zeros((0, 0), dtype=np.float32)
        self._objects = np.zeros((0, 0), dtype=np.float32)
        self._stamp = -1

    def load(self, keys: dict[int, Key], generation: int, book: str) -> None:
        """Take over the keys of a generation; the store is rebuilt unless it says it is up to date."""
        self._ids = np.fromiter(keys, dtype=np.int64, count=len(keys))
        self._rows = {int(i): row for row, i in enumerate(self._ids)}
        self._keys = list(keys.values())
        self._stamp = (generation << 32) | zlib.crc32(f"{book}|{self._key_vectors.fingerprint()}".encode())
        if not keys:
            return
        self._actions, self._objects = self._key_vectors.get(self._keys)
        if not self._store_is_current():
            self._rebuild()

    def search(
        self,
        action: np.ndarray,
        objects: np.ndarray,
        weights: tuple[float, float],
        enough: Callable[[list[Scored]], bool],
    ) -> list[Scored]:
        """Keys by r, largest first: as many as it takes until ``enough`` of the list so far, or all."""
        if not self._keys:
            return []
        total = weights[0] + weights[1]
        query = np.concatenate([weights[0] * action, weights[1] * objects]).astype(np.float32) / np.float32(total)
        count = min(64, len(self._keys))
        while True:
            found = self._score(self._search_store(query, count), action, objects, weights)
            if count >= len(self._keys) or enough(found):
                return found
            count = min(4 * count, len(self._keys))

    def _score(
        self, ids: np.ndarray, action: np.ndarray, objects: np.ndarray, weights: tuple[float, float]
    ) -> list[Scored]:
        rows = np.array([self._rows[int(i)] for i in ids], dtype=np.int64)
        by_action = (self._actions[rows] @ action).astype(np.float64)
        by_objects = (self._objects[rows] @ objects).astype(np.float64)
        scores = (weights[0] * by_action + weights[1] * by_objects) / (weights[0] + weights[1])
        order = np.lexsort((rows, -scores))
        return [
            Scored(int(ids[i]), self._keys[rows[i]], float(scores[i]), float(by_action[i]), float(by_objects[i]))
            for i in order
        ]

    def _search_store(self, query: np.ndarray, count: int) -> np.ndarray:
        for rebuilt in (False, True, True):
            try:
                if self._store_is_ours():
                    ids, _ = self._store.search(query, count)
                    if len(ids) and all(int(i) in self._rows for i in ids):
                        return ids
            except Exception:
                if rebuilt:
                    raise
            self._rebuild()  # whatever a corrupt store does, it is derived data and made anew
        problem = "a fresh index returns ids that were never added"
        raise BackendUnavailable("vectorstore", type(self._store).__name__, problem)

    def _store_is_ours(self) -> bool:
        return self._store.generation() in (None, self._stamp) and len(self._store) == len(self._keys)

    def _store_is_current(self) -> bool:
        try:
            self._store.open()
            return self._store.generation() == self._stamp and len(self._store) == len(self._keys)
        except Exception:
            return False

    def _rebuild(self) -> None:
        vectors = np.concatenate([self._actions, self._objects], axis=1)
        self._store.open()
        self._store.reset(vectors.shape[1])
        self._store.add([int(i) for i in self._ids], vectors)
        self._store.set_generation(self._stamp)
