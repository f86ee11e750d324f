"""An embedder for tests: deterministic, no downloads, no model, and yet similar texts get similar vectors."""

from __future__ import annotations

import re
import zlib
from collections.abc import Sequence

import numpy as np

from memo_core.interfaces.embedder import Embedder


class FakeEmbedder(Embedder):
    """Hashed bag of words and character trigrams. Texts that share words are similar, equal texts are equal."""

    def __init__(self, dimension: int = 96, name: str = "fake-embedder") -> None:
        self.name = f"{name}-{dimension}"
        self.dimension = dimension
        self.embedded = 0  # texts this instance was asked for

    def open(self) -> None: ...

    def close(self) -> None: ...

    def embed(self, texts: Sequence[str]) -> np.ndarray:
        self.embedded += len(texts)
        vectors = np.stack([self._vector(text) for text in texts]) if texts else np.zeros((0, self.dimension))
        return vectors.astype(np.float32)

    def _vector(self, text: str) -> np.ndarray:
        vector = np.full(self.dimension, 1e-3)
        for word in re.findall(r"\w+|[^\w\s]", text.lower()) or [text]:
            padded = f" {word} "
            for weight, piece in [(2.0, word), *((0.5, padded[i : i + 3]) for i in range(len(padded) - 2))]:
                code = zlib.crc32(piece.encode())
                vector[code % self.dimension] += weight if code >> 16 & 1 else -weight
        return vector / np.linalg.norm(vector)
