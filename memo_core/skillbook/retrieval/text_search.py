"""The entries whose texts are most similar to a subtask's words, proposed by the vector store.

The store is derived data: it holds one vector for each active entry and is brought up to the book's generation before
it is asked. What it proposes is looked up in the book and scored again, so an approximate, stale or damaged store can
miss entries but never add one.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np
import sqlalchemy as sa

from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook.model.entries import spoken
from memo_core.skillbook.retrieval.key_index import BookKeys
from memo_core.skillbook.store import tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.vectors.text_vectors import TextVectors

_E = tables.entries.c
_ACTIVE = _E.superseded_by.is_(None)
_AMONG = sa.select(_E.id).where(_E.id.in_(sa.bindparam("ids", expanding=True)), _ACTIVE)
_BATCH = 20_000  # vectors handed to the store at once
_EMBEDDED = "docstrings"  # changes with what is embedded of an entry (``spoken``) and with which kinds are
_GENERATIONS = 1 << 28


class ExactStore(VectorStore):
    """All vectors in one array: the store of a book that was opened without one."""

    def __init__(self) -> None:
        self._ids = np.zeros(0, np.int64)
        self._vectors = np.zeros((0, 0), np.float32)
        self._generation: int | None = None

    def open(self) -> None: ...

    def close(self) -> None: ...

    def reset(self, dimension: int) -> None:
        self._ids, self._vectors = np.zeros(0, np.int64), np.zeros((0, dimension), np.float32)
        self._generation = None

    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
        if vectors.shape != (len(ids), self._vectors.shape[1]):
            wanted = f"shape {(len(ids), self._vectors.shape[1])}"
            raise InvalidArgument("vectors", f"shape {vectors.shape}", wanted)
        self.remove(ids)
        self._ids = np.concatenate([self._ids, np.asarray(ids, np.int64)])
        self._vectors = np.concatenate([self._vectors, np.asarray(vectors, np.float32)])

    def remove(self, ids: Sequence[int]) -> None:
        stay = ~np.isin(self._ids, np.asarray(ids, np.int64))
        self._ids, self._vectors = self._ids[stay], self._vectors[stay]

    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        products = np.vecdot(self._vectors, query) if len(self._ids) else np.zeros(0, np.float32)
        best = np.argsort(-products, kind="stable")[:count]
        return self._ids[best], products[best]

    def ids(self) -> np.ndarray:
        return self._ids

    def generation(self) -> int | None:
        return self._generation

    def set_generation(self, generation: int) -> None:
        self._generation = generation

    def __len__(self) -> int:
        return len(self._ids)


class TextSearch:
    """Searches the texts of one book's active entries. No other search may use the same store."""

    def __init__(self, database: Database, vectors: TextVectors, store: VectorStore | None) -> None:
        self._database = database
        self._vectors = vectors
        self._store: VectorStore = ExactStore() if store is None else store  # an empty store is false

    def nearest(self, meant: np.ndarray, count: int, keys: BookKeys) -> np.ndarray:
        """Ids of the ``count`` entries most similar to a text, best first, as far as the store finds them.

        Args:
            meant: unit vector of the text, shape (d,).
            count: most entries.
            keys: the generation that the store is brought up to.

        Raises:
            BackendUnavailable: if a store that was just filled finds nothing.
        """
        if not keys.total:
            return np.zeros(0, np.int64)
        for rebuild in (False, True):
            try:
                self._follow(keys, rebuild, len(meant))
                found, _ = self._store.search(meant, count)
                active = self._active(np.asarray(found, np.int64))
                if len(active):
                    return active
            except Exception:  # whatever a damaged store raises: it is derived data and filled again
                if rebuild:
                    raise
        if self._generation() != keys.generation:
            return np.zeros(0, np.int64)  # another process writes meanwhile; the caller starts again
        problem = "a fresh index finds nothing of what was added"
        raise BackendUnavailable("vectorstore", type(self._store).__name__, problem)

    # -- following the book --------------------------------------------------------------------------------------------
    def _follow(self, keys: BookKeys, rebuild: bool, dimension: int) -> None:
        self._store.open()
        stamp, held = self._stamp(keys), self._store.generation()
        if not rebuild and held == stamp and len(self._store) == keys.total:
            return
        known = None if rebuild or held is None or held // _GENERATIONS != stamp // _GENERATIONS else self._store.ids()
        active = self._all_active()
        if known is None:
            self._store.reset(dimension)
            came = active
        else:
            came, went = np.setdiff1d(active, known), np.setdiff1d(known, active)
            if len(went):
                self._store.remove(went.tolist())
        for start in range(0, len(came), _BATCH):
            self._add(came[start : start + _BATCH])
        self._store.set_generation(stamp)

    def _stamp(self, keys: BookKeys) -> int:
        """Book and embedder (34 bits), then generation (28 bits)."""
        whose = hashlib.sha256(f"{keys.book}|{self._vectors.name}|{_EMBEDDED}".encode()).digest()
        return (int.from_bytes(whose[:5], "big") >> 6) * _GENERATIONS + keys.generation % _GENERATIONS

    def _add(self, ids: np.ndarray) -> None:
        query = sa.select(_E.id, _E.kind, _E.text).where(_E.id.between(int(ids[0]), int(ids[-1])), _ACTIVE)
        wanted = set(ids.tolist())
        with self._database.read() as connection:
            texts = {row.id: spoken(row.kind, row.text) for row in connection.execute(query) if row.id in wanted}
        if texts:
            self._store.add([*texts], self._vectors.get([*texts.values()]))

    # -- in the book ---------------------------------------------------------------------------------------------------
    def _all_active(self) -> np.ndarray:
        with self._database.read() as connection:
            rows = connection.execute(sa.select(_E.id).where(_ACTIVE).order_by(_E.id))
            return np.fromiter((row[0] for row in rows), np.int64)

    def _active(self, ids: np.ndarray) -> np.ndarray:
        """The active ones among some entries, in their order."""
        with self._database.read() as connection:
            rows = connection.execute(_AMONG, {"ids": ids.tolist()}).all()
            active = np.fromiter((row[0] for row in rows), np.int64)
        return ids[np.isin(ids, active)]

    def _generation(self) -> int:
        with self._database.read() as connection:
            return int(self._database.meta(connection)["generation"])
