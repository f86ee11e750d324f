"""What an embedder must provide: unit vectors for texts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np


class Embedder(ABC):
    """Turns texts into vectors whose inner product is their cosine similarity. ``open`` does the heavy imports."""

    name: str  # identifies model and version; stored in the book, another name, or fingerprint after a #, is refused
    dimension: int  # known after open()

    @abstractmethod
    def open(self) -> None: ...

    @abstractmethod
    def close(self) -> None: ...

    @abstractmethod
    def embed(self, texts: Sequence[str]) -> np.ndarray:
        """Unit vectors, float32, shape (len(texts), dimension); the same text always gives the same vector."""
