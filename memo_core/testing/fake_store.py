"""An exact vector store for tests: one matrix product."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from memo_core.interfaces.vectorstore import VectorStore


class FakeStore(VectorStore):
    """Keeps vectors in a dictionary and compares all of them."""

    def __init__(self) -> None:
        self._vectors: dict[int, np.ndarray] = {}
        self._dimension = 0
        self._generation: int | None = None
        self.rebuilt = 0  # how often ``reset`` was called

    def open(self) -> None: ...

    def close(self) -> None: ...

    def reset(self, dimension: int) -> None:
        self._vectors.clear()
        self._dimension = dimension
        self._generation = None
        self.rebuilt += 1

    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
        if np.shape(vectors) != (len(ids), self._dimension):
            raise ValueError(f"vectors have shape {np.shape(vectors)}, expected {(len(ids), self._dimension)}")
        self._vectors.update(zip((int(i) for i in ids), np.array(vectors, dtype=np.float32), strict=True))

    def remove(self, ids: Sequence[int]) -> None:
        for i in ids:
            self._vectors.pop(int(i), None)

    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        if not self._vectors or count < 1:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.float32)
        ids = np.fromiter(self._vectors, dtype=np.int64)
        products = np.stack(list(self._vectors.values())) @ np.asarray(query, dtype=np.float32)
        best = np.argsort(-products, kind="stable")[:count]
        return ids[best], products[best].astype(np.float32)

    def __len__(self) -> int:
        return len(self._vectors)

    def ids(self) -> np.ndarray:
        return np.array(sorted(self._vectors), dtype=np.int64)

    def generation(self) -> int | None:
        return self._generation

    def set_generation(self, generation: int) -> None:
        self._generation = generation
