"""The ``faiss`` backend: a flat inner-product index with ids of our own."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.vectorstore import VectorStore
from memo_vectorstore.settings import FaissSettings

log = logging.getLogger(__name__)


class FaissStore(VectorStore):
    """``IndexIDMap2`` over ``IndexFlatIP``. With a file, what ``set_generation`` was called on survives the process."""

    def __init__(self, settings: FaissSettings) -> None:
        self._file = Path(settings.file).expanduser() if settings.file else None
        self._faiss: Any = None
        self._index: Any = None
        self._ids: set[int] = set()
        self._generation: int | None = None

    def open(self) -> None:
        """Idempotent. A file that is damaged counts as none."""
        if self._faiss is not None:
            return
        try:
            import faiss
        except ImportError as error:
            raise BackendUnavailable("vectorstore", "faiss", f"{error}", "pip install faiss-cpu") from error
        faiss.omp_set_num_threads(1)  # some hundred keys: starting threads would cost more than the search
        self._faiss = faiss
        if self._file is not None and self._file.exists():
            self._read(self._file)

    def close(self) -> None:
        self._faiss = self._index = None
        self._ids = set()
        self._generation = None

    def reset(self, dimension: int) -> None:
        if dimension < 1:
            raise InvalidArgument("dimension", f"{dimension} is not right", "1 or more")
        faiss = self._opened()
        self._index = faiss.IndexIDMap2(faiss.IndexFlatIP(dimension))
        self._ids = set()
        self._generation = None

    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
        self._opened()
        given = np.ascontiguousarray(vectors, dtype=np.float32)
        dimension = self._index.d if self._index is not None else 0
        if given.shape != (len(ids), dimension):
            raise InvalidArgument(
                "vectors", f"shape {given.shape}", f"({len(ids)}, {dimension}), the dimension of reset()"
            )
        if len(set(ids)) != len(ids):
            raise InvalidArgument("ids", "an id occurs twice", "different ids")
        self.remove(ids)
        if len(ids):
            self._index.add_with_ids(given, np.asarray(ids, dtype=np.int64))
            self._ids.update(int(i) for i in ids)

    def remove(self, ids: Sequence[int]) -> None:
        self._opened()
        there = [int(i) for i in ids if int(i) in self._ids]
        if there:
            self._index.remove_ids(np.asarray(there, dtype=np.int64))
            self._ids.difference_update(there)

    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        self._opened()
        wanted = min(count, len(self._ids))
        if wanted < 1:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.float32)
        question = np.ascontiguousarray(query, dtype=np.float32)
        if question.shape != (self._index.d,):
            raise InvalidArgument("query", f"shape {question.shape}", f"({self._index.d},)")
        products, ids = self._index.search(question[None, :], wanted)
        return ids[0], products[0]

    def __len__(self) -> int:
        return len(self._ids)

    def ids(self) -> np.ndarray:
        return np.fromiter(self._ids, dtype=np.int64, count=len(self._ids))

    def generation(self) -> int | None:
        return self._generation

    def set_generation(self, generation: int) -> None:
        self._generation = generation
        if self._file is None or self._index is None:
            return
        try:
            self._write(self._file)
        except OSError as error:  # a full disk or a read-only folder: the next process makes it anew
            log.warning("the index %s cannot be kept: %s", self._file, error)

    # -- inside --------------------------------------------------------------------------------------------------------
    def _opened(self) -> Any:
        if self._faiss is None:
            raise BackendUnavailable("vectorstore", "faiss", "it is not open", "call open() first")
        return self._faiss

    def _write(self, file: Path) -> None:
        body = self._faiss.serialize_index(self._index).tobytes()
        header = {"generation": self._generation, "sha256": hashlib.sha256(body).hexdigest()}
        file.parent.mkdir(parents=True, exist_ok=True)
        descriptor, scratch = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}-")
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(json.dumps(header).encode() + b"\n" + body)
            os.replace(scratch, file)
        except BaseException:
            Path(scratch).unlink(missing_ok=True)
            raise

    def _read(self, file: Path) -> None:
        try:
            first, _, body = file.read_bytes().partition(b"\n")
            header = json.loads(first)
            if hashlib.sha256(body).hexdigest() != header["sha256"]:
                raise ValueError("its checksum does not match")
            index = self._faiss.deserialize_index(np.frombuffer(body, dtype=np.uint8))
            ids = self._faiss.vector_to_array(index.id_map)
            self._index, self._ids, self._generation = index, {int(i) for i in ids}, int(header["generation"])
        except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
            log.warning("the index %s cannot be read and is made anew: %s", file, error)
