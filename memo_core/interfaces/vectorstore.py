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
        """Remove all vectors.

        Args:
            dimension: dimension of the vectors that will be added.
        """

    @abstractmethod
    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
        """Add vectors, or replace those of ids that are stored already. The vectors are copied.

        Args:
            ids: different integers, 0 to 2**63 - 1.
            vectors: shape (len(ids), dimension), any length; they are not normalised.

        Raises:
            InvalidArgument: if the shape does not fit or an id occurs twice; the store stays as it was.
        """

    @abstractmethod
    def remove(self, ids: Sequence[int]) -> None:
        """Remove these vectors; unknown ids are ignored."""

    @abstractmethod
    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Find the stored vectors with the largest inner products with a query.

        Args:
            query: float32, shape (dimension,); it is not normalised.
            count: most results; an approximate store may find fewer.

        Returns:
            Ids (int64) and inner products (float32), both of shape (k,) with k <= count, largest product first.

        Raises:
            InvalidArgument: if the query has another dimension.
        """

    @abstractmethod
    def __len__(self) -> int: ...

    def ids(self) -> np.ndarray | None:
        """All stored ids (int64, in any order); None if the store cannot list them."""
        return None

    def generation(self) -> int | None:
        """The database generation a persistent store was last synchronised with; None when in memory or unknown."""
        return None

    def set_generation(self, generation: int) -> None: ...
