"""The derived index: which keys are nearest. Indexed are keys, not entries: many entries share a key.

A book of some thousand keys scores them all, exactly, from the few parts that they are made of
(``memo_core.skillbook.parts``). Beyond that a vector store is asked: it holds one vector a key and is brought up to
date or made anew whenever it is not the database's. With the query [λ1 q_act ; λ2 q_obj] / (λ1 + λ2) the inner product
with a key's [v_act ; v_obj] is r(q, v) exactly, for any λ. What a store returns is scored again here, so an approximate
store can miss but never lie.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable

import attrs
import numpy as np

from memo_core.errors import BackendUnavailable
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook.keys import Key
from memo_core.skillbook.parts import KeyParts
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
    """The keys of one state of the book, searchable by r. The store, where there is one, is this index's alone; it is
    asked when there are more than ``exact_keys`` keys, and not opened before."""

    def __init__(self, store: VectorStore | None, key_vectors: KeyVectors, exact_keys: int) -> None:
        self._store = store
        self._key_vectors = key_vectors
        self._exact_keys = exact_keys
        self.ids: np.ndarray = np.zeros(0, dtype=np.int64)  # ascending
        self._parts: KeyParts | None = None
        self._book: str | None = None
        self._stamp = -1  # says which keys, in which vectors, of which book the store should hold
        self._filled = False  # whether the store held the keys of the last ``load``

    @property
    def exact(self) -> bool:
        """Whether every key is scored here and no store is asked."""
        return self._store is None or len(self.ids) <= self._exact_keys

    def load(self, keys: dict[int, Key], book: str) -> None:
        """Take over the keys of a book's state by their ids; nothing is done when they are those of the last one."""
        ordered = dict(sorted(keys.items()))
        ids, before = np.fromiter(ordered, dtype=np.int64, count=len(ordered)), self.ids
        if book == self._book and np.array_equal(ids, before):  # a key's row is never changed
            return
        self.ids, self._book = ids, book
        self._parts = self._key_vectors.parts(list(ordered.values())) if ordered else None
        filled, self._filled = self._filled, not self.exact
        if self.exact:
            return
        self._stamp = self._stamp_of(ordered)
        if not self._store_is_current() and not (filled and self._bring_up_to_date(before)):
            self._rebuild()

    def search(
        self, action: np.ndarray, objects: np.ndarray, weights: tuple[float, float], enough: Callable[[Hits], bool]
    ) -> Hits:
        """The best keys: as many as it takes until ``enough`` of the list so far, or all."""
        if self._parts is None:
            nothing = np.zeros(0)
            return Hits(np.zeros(0, dtype=np.int64), nothing, nothing, nothing)
        best = self._best_of_all if self.exact else self._best_of_store
        return best(self._parts, action, objects, weights, enough)

    # -- every key -----------------------------------------------------------------------------------------------------
    def _best_of_all(
        self,
        parts: KeyParts,
        action: np.ndarray,
        objects: np.ndarray,
        weights: tuple[float, float],
        enough: Callable[[Hits], bool],
    ) -> Hits:
        by_action, by_objects = parts.cosines(action, objects)
        scores = (weights[0] * by_action + weights[1] * by_objects) / (weights[0] + weights[1])
        count = min(_FIRST, len(scores))
        while True:
            least = np.partition(scores, len(scores) - count)[len(scores) - count]
            rows = np.flatnonzero(scores >= least)
            hits = _in_order(rows, scores[rows], by_action[rows], by_objects[rows])
            if len(rows) == len(scores) or enough(hits):
                return hits
            count = min(4 * count, len(scores))

    # -- a store -------------------------------------------------------------------------------------------------------
    def _best_of_store(
        self,
        parts: KeyParts,
        action: np.ndarray,
        objects: np.ndarray,
        weights: tuple[float, float],
        enough: Callable[[Hits], bool],
    ) -> Hits:
        total = weights[0] + weights[1]
        query = np.concatenate([weights[0] * action, weights[1] * objects]).astype(np.float32) / np.float32(total)
        count = min(_FIRST, len(self.ids))
        while True:
            rows = self._search_store(query, count)
            actions, things = parts.vectors(rows)
            by_action, by_objects = (
                np.vecdot(actions, action).astype(np.float64),
                np.vecdot(things, objects).astype(np.float64),
            )
            scores = (weights[0] * by_action + weights[1] * by_objects) / total
            hits = _in_order(rows, scores, by_action, by_objects)
            if count >= len(self.ids) or enough(hits):
                return hits
            count = min(4 * count, len(self.ids))

    def _search_store(self, query: np.ndarray, count: int) -> np.ndarray:
        """Rows of the keys that the store says are best."""
        store = self._asked()
        for rebuilt in (False, True, True):
            try:
                if self._store_is_ours():
                    found, _ = store.search(query, count)
                    rows = np.minimum(np.searchsorted(self.ids, found), len(self.ids) - 1)
                    if len(found) and np.array_equal(self.ids[rows], found):
                        return rows
            except Exception:
                if rebuilt:
                    raise
            self._rebuild()  # whatever a corrupt store does, it is derived data and made anew
        problem = "a fresh index returns ids that were never added"
        raise BackendUnavailable("vectorstore", type(store).__name__, problem)

    def _asked(self) -> VectorStore:
        assert self._store is not None
        return self._store

    def _stamp_of(self, keys: dict[int, Key]) -> int:
        """62 bits that change with the keys, their vectors and the book, and with nothing else: a change of the book
        that brings in no key leaves the store as it is."""
        listed = "|".join(
            (str(self._book), self._key_vectors.fingerprint(), *(f"{i} {key}" for i, key in keys.items()))
        )
        return int.from_bytes(hashlib.sha256(listed.encode()).digest()[:8], "big") >> 2

    def _store_is_ours(self) -> bool:
        store = self._asked()
        return store.generation() in (None, self._stamp) and len(store) == len(self.ids)

    def _store_is_current(self) -> bool:
        store = self._asked()
        try:
            store.open()
            return store.generation() == self._stamp and len(store) == len(self.ids)
        except Exception:
            return False

    def _bring_up_to_date(self, before: np.ndarray) -> bool:
        """Give the store the keys that came since it held ``before``, and take out those that went; whether that went
        well."""
        store = self._asked()
        try:
            if len(store) != len(before):
                return False
            new = np.flatnonzero(~np.isin(self.ids, before))
            if len(new):
                store.add(self.ids[new].tolist(), self._vectors(new))
            gone = before[~np.isin(before, self.ids)]
            if len(gone):
                store.remove(gone.tolist())
            store.set_generation(self._stamp)
            return len(store) == len(self.ids)
        except Exception:
            return False

    def _vectors(self, rows: np.ndarray) -> np.ndarray:
        assert self._parts is not None
        return np.concatenate(self._parts.vectors(rows), axis=1)

    def _rebuild(self) -> None:
        store, vectors = self._asked(), self._vectors(np.arange(len(self.ids)))
        store.open()
        store.reset(vectors.shape[1])
        store.add([int(i) for i in self.ids], vectors)
        store.set_generation(self._stamp)


def _in_order(rows: np.ndarray, scores: np.ndarray, by_action: np.ndarray, by_objects: np.ndarray) -> Hits:
    order = np.lexsort((rows, -scores))
    return Hits(rows[order], scores[order], by_action[order], by_objects[order])
