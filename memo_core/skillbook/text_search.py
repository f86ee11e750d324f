"""The entries whose texts are most similar to a text, found through the vector store. The store contains one vector for
each correction and template and is derived data: it is updated from the book's revisions, or rebuilt if that is not
possible. Its results are looked up in the book and scored again, so an approximate, stale or damaged store can miss
entries but never serve one that does not exist.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import sqlalchemy as sa

from memo_core.errors import BackendUnavailable
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook import queries, tables
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import spoken
from memo_core.skillbook.entry_index import EntryIndex
from memo_core.skillbook.retrieval_cache import KINDS, Contents
from memo_core.skillbook.text_vectors import TextVectors

_E, _C, _M = tables.entries.c, tables.changes.c, tables.meta.c
_BATCH = 20_000  # vectors handed to the store at once
_FEW = 5_000  # entries that came or went; more are not brought in one by one
_SAYS = "docstrings"  # changes with what of an entry is embedded (``spoken``)
_KIND = _E.kind.in_(KINDS)
_VALID = _E.superseded_by.is_(None)


class ExactStore(VectorStore):
    """All vectors in one array, for a book that was opened without a store."""

    def __init__(self) -> None:
        self._ids = np.zeros(0, np.int64)
        self._vectors = np.zeros((0, 0), np.float32)
        self._generation: int | None = None

    def open(self) -> None: ...

    def close(self) -> None: ...

    def reset(self, dimension: int) -> None:
        self._ids, self._vectors = np.zeros(0, np.int64), np.zeros((0, dimension), np.float32)

    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
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
    """Entries by similarity of their texts, for one book. No other search may use the same store."""

    def __init__(
        self, database: Database, vectors: TextVectors, indexes: Mapping[str, EntryIndex], store: VectorStore | None
    ) -> None:
        self._database = database
        self._vectors = vectors
        self._indexes = indexes  # by kind; they are brought up to the book's state first
        self._store: VectorStore = ExactStore() if store is None else store  # an empty one is false
        self._current: tuple[str, int] | None = None  # book and generation that the store was last brought up to
        self._wanted = (0, 0)  # the store's stamp and size there

    def nearest(self, meant: np.ndarray, count: int, state: Contents, distrust: bool = False) -> np.ndarray:
        """Ids of the ``count`` entries most similar to ``meant``, a unit vector of shape (d,), best first, as far as
        the store finds them; some may be outdated. ``distrust``: its previous answer was unusable. Raises
        ``BackendUnavailable``."""
        if not _size(state):
            return np.zeros(0, np.int64)
        for anew in (distrust, True, True):
            try:
                if self._follow(state, anew):
                    found, _ = self._store.search(meant, count)
                    if len(found):
                        return np.asarray(found, np.int64)
            except Exception:
                if anew:
                    raise
            self._current = None  # whatever a damaged store does, it is derived data and made anew
        if queries.generation_of(self._database) != state.generation:
            return np.zeros(0, np.int64)  # others write: the caller sees that as well, and asks with the new state
        problem = "a fresh index finds nothing of what was added"
        raise BackendUnavailable("vectorstore", type(self._store).__name__, problem)

    def is_current(self, state: Contents) -> bool:
        """Whether the store was brought up to the book's state."""
        return self._current == (state.book, state.generation)

    # -- inside --------------------------------------------------------------------------------------------------------
    def _follow(self, state: Contents, anew: bool) -> bool:
        """Update the store to the book's state. Returns whether that succeeded."""
        if anew or not self.is_current(state):
            self._store.open()
            if anew or not self._bring_up_to_date(state):
                self._rebuild(state)
            self._current, self._wanted = (state.book, state.generation), (self._stamp(state), _size(state))
        stamp, size = self._wanted
        return self._store.generation() in (None, stamp) and len(self._store) == size

    def _stamp(self, state: Contents) -> int:
        """62 bits: 20 of book and embedder, 14 of the last change that revisions do not tell, 28 of the revision."""
        whose = hashlib.sha256(f"{state.book}|{self._vectors.name}|{_SAYS}".encode()).digest()
        untold = hashlib.sha256(str(state.uncounted).encode()).digest()
        parts = (int.from_bytes(whose[:4], "big") >> 12, int.from_bytes(untold[:2], "big") >> 2)
        return (parts[0] << 42) | (parts[1] << 28) | state.revision

    def _bring_up_to_date(self, state: Contents) -> bool:
        """Returns whether updating succeeded; it cannot if the store is empty or belongs to another book or
        embedder."""
        stamp, wanted = self._store.generation(), self._stamp(state)
        if stamp is None or stamp >> 42 != wanted >> 42 or not len(self._store):
            return False
        if stamp == wanted:
            return True
        revision = stamp & ((1 << 28) - 1)
        told = stamp >> 28 == wanted >> 28 and revision <= state.revision
        came, went = self._since(revision) if told else self._difference()
        if len(came) > max(_FEW, len(self._store)):
            return False
        self._add(came)
        if len(went):
            self._store.remove(went.tolist())
        self._store.set_generation(wanted)
        return True

    def _since(self, revision: int) -> tuple[np.ndarray, np.ndarray]:
        """Entries that became valid, and that were retired, after a revision."""
        restored = sa.select(_C.entry).where(_C.revision > revision)
        new = sa.select(_E.id).where(_KIND, _VALID, sa.or_(_E.revision > revision, _E.id.in_(restored)))
        gone = sa.select(_E.id).where(_KIND, _E.superseded_by > revision)
        with self._database.read() as connection:
            return _array(connection.execute(new)), _array(connection.execute(gone))

    def _difference(self) -> tuple[np.ndarray, np.ndarray]:
        """The same, compared with the ids that the store reports."""
        held = self._store.ids()
        if held is None:
            raise LookupError("the store cannot tell what it holds")
        with self._database.read() as connection:
            valid = _array(connection.execute(sa.select(_E.id).where(_KIND, _VALID)))
        return valid[~np.isin(valid, held)], held[~np.isin(held, valid)]

    def _add(self, ids: np.ndarray) -> None:
        for start in range(0, len(ids), _BATCH):
            part = ids[start : start + _BATCH].tolist()
            with self._database.read() as connection:
                texts = {one.id: spoken(one.kind, one.text) for one in queries.entries_by_id(connection, part).values()}
            there = [entry for entry in part if entry in texts]
            if there:
                self._store.add(there, self._vectors.get([texts[entry] for entry in there]))

    def _rebuild(self, state: Contents) -> None:
        self._store.open()
        begun = False
        for index in self._indexes.values():
            for ids, vectors in index.parts(_BATCH):
                if not begun:
                    self._store.reset(vectors.shape[1])
                    begun = True
                self._store.add(ids.tolist(), vectors)
        self._store.set_generation(self._stamp(state))


def _size(state: Contents) -> int:
    """How many entries the store should hold."""
    return int(sum(state.sizes[kind].sum() for kind in KINDS))


def _array(rows: Iterable[Sequence[int]]) -> np.ndarray:
    return np.fromiter((row[0] for row in rows), dtype=np.int64)
