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
        """Embed texts; equal texts give equal vectors, whatever is embedded with them.

        Args:
            texts: any strings, also empty and very long ones; the sequence may be empty.

        Returns:
            Vectors of length 1, float32, shape (len(texts), dimension).
        """
