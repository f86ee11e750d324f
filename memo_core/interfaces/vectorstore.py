"""What a vector store must provide: search for the largest inner products.

The store is derived data; the database is authoritative.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np


class VectorStore(ABC):
    """Maps integer ids to float32 vectors and finds the largest inner products. Scores are recomputed by the core."""

    @abstractmethod
    def open(self) -> None: ...

    @abstractmethod
    def close(self) -> None: ...

    @abstractmethod
    def reset(self, dimension: int) -> None:
        """Remove all vectors and set the dimension of those to come."""

    @abstractmethod
    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
        """Add or replace. ``vectors`` has shape (len(ids), dimension)."""

    @abstractmethod
    def remove(self, ids: Sequence[int]) -> None:
        """Remove these vectors; unknown ids are ignored."""

    @abstractmethod
    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Ids (int64) and inner products (float32), largest first, at most ``count``; ``query`` has shape
        (dimension,)."""

    @abstractmethod
    def __len__(self) -> int: ...

    def ids(self) -> np.ndarray | None:
        """All stored ids (int64, in any order); None if the store cannot list them."""
        return None

    def generation(self) -> int | None:
        """The database generation a persistent store was last synchronised with; None when in memory or unknown."""
        return None

    def set_generation(self, generation: int) -> None: ...
