"""The ``faiss`` backend: inner products with ids of our own, exact in a small book, by inverted lists in a large one.

A flat index reads every vector for every question. From ``flat_up_to`` vectors on they are therefore kept in inverted
lists: k-means on a sample makes the lists' centres, a vector is kept in the list of the nearest one, rounded to 8 bits
a component, and a search looks through the ``probes`` lists with the nearest centres. Who asks scores the vectors found
again, so rounding never shows in a score; a vector in a list that was not looked through is missed.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from memo_core.plugin import BackendUnavailable, InvalidArgument, VectorStore, parse_json
from memo_vectorstore.settings import FaissSettings

log = logging.getLogger(__name__)

_GATHERED = 200_000  # vectors are gathered up to this many before lists are made of them: 300 MB at 384 components
_SAMPLE = 40  # vectors for each centre that k-means looks at
_ROUNDS = 8  # of k-means
_OUTGROWN = 10  # lists that were made of so many times fewer vectors are too long, and made anew
_UNSAVED = 100  # one vector in so many may be missing in the file; what was removed never stays in it
_CHUNK = 1 << 24  # bytes


class FaissStore(VectorStore):
    """``IndexIDMap2`` over ``IndexFlatIP``, or ``IndexIVFScalarQuantizer``. With a file, what ``set_generation`` was
    called on survives the process; of a large index only when one vector in a hundred is new, or one was removed."""

    def __init__(self, settings: FaissSettings) -> None:
        self._settings = settings
        self._file = Path(settings.file).expanduser() if settings.file else None
        self._faiss: Any = None
        self._index: Any = None
        # Ascending. A set of a million numbers would be walked through at each collection of garbage: 100 ms.
        self._ids = np.zeros(0, np.int64)
        self._trained_on = 0  # vectors that the lists were made of; 0: the index is flat
        self._generation: int | None = None
        self._added = 0  # vectors that the file does not have
        self._removed = False  # whether the file has vectors that went

    def open(self) -> None:
        """Idempotent. A file that is damaged, or whose lists have grown too long, counts as none."""
        if self._faiss is not None:
            return
        try:
            import faiss
        except ImportError as error:
            raise BackendUnavailable("vectorstore", "faiss", f"{error}", "pip install faiss-cpu") from error
        faiss.omp_set_num_threads(1)  # a search takes less than starting threads, and others use the processors as well
        self._faiss = faiss
        if self._file is not None and self._file.exists():
            self._read(self._file)

    def close(self) -> None:
        self._faiss = None
        self._forget()

    def reset(self, dimension: int) -> None:
        if dimension < 1:
            raise InvalidArgument("dimension", f"{dimension} is not right", "1 or more")
        faiss = self._opened()
        self._forget()
        self._index = faiss.IndexIDMap2(faiss.IndexFlatIP(dimension))

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
            new = np.sort(np.asarray(ids, dtype=np.int64))
            self._ids = np.insert(self._ids, np.searchsorted(self._ids, new), new)
            self._added += len(ids)
            self._make_lists(most=max(_GATHERED, self._settings.flat_up_to))

    def remove(self, ids: Sequence[int]) -> None:
        self._opened()
        asked = np.unique(np.asarray(ids, dtype=np.int64))
        first, end = (np.searchsorted(self._ids, asked, side) for side in ("left", "right"))
        if (there := end > first).any():
            self._index.remove_ids(asked[there])
            self._ids = np.delete(self._ids, first[there])
            self._removed = True

    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        self._opened()
        wanted = min(count, len(self._ids))
        if wanted < 1:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.float32)
        question = np.ascontiguousarray(query, dtype=np.float32)
        if question.shape != (self._index.d,):
            raise InvalidArgument("query", f"shape {question.shape}", f"({self._index.d},)")
        self._make_lists(most=self._settings.flat_up_to)
        products, ids = self._index.search(question[None, :], wanted)
        found = ids[0] >= 0  # the lists that were looked through may hold fewer
        return ids[0][found], products[0][found]

    def __len__(self) -> int:
        return len(self._ids)

    def ids(self) -> np.ndarray:
        return self._ids.copy()

    def generation(self) -> int | None:
        return self._generation

    def set_generation(self, generation: int) -> None:
        self._generation = generation
        if self._file is None or self._index is None or not self._unsaved():
            return
        self._make_lists(most=self._settings.flat_up_to)
        try:
            self._write(self._file)
            self._added, self._removed = 0, False
        except OSError as error:  # a full disk or a read-only folder: the next process makes it anew
            log.warning("the index %s cannot be kept: %s", self._file, error)

    # -- inside --------------------------------------------------------------------------------------------------------
    def _opened(self) -> Any:
        if self._faiss is None:
            raise BackendUnavailable("vectorstore", "faiss", "it is not open", "call open() first")
        return self._faiss

    def _unsaved(self) -> bool:
        return self._removed or self._added * _UNSAVED >= max(1, len(self._ids))

    def _forget(self) -> None:
        self._index = None
        self._ids = np.zeros(0, np.int64)
        self._trained_on = self._added = 0
        self._removed = True
        self._generation = None

    def _make_lists(self, most: int) -> None:
        """Of a flat index with more than ``most`` vectors."""
        count = len(self._ids)
        if self._trained_on or count <= most:
            return
        faiss, flat = self._faiss, self._index.index
        vectors = flat.reconstruct_n(0, count)
        ids = faiss.vector_to_array(self._index.id_map)
        lists = min(int(4 * np.sqrt(count)), count // _SAMPLE)
        kind = faiss.ScalarQuantizer.QT_8bit_uniform  # compared a third faster than with a range for each component
        centres = faiss.IndexFlatIP(flat.d)
        index = faiss.IndexIVFScalarQuantizer(centres, flat.d, lists, kind, faiss.METRIC_INNER_PRODUCT, False)
        index.cp.niter, index.cp.max_points_per_centroid, index.cp.spherical = _ROUNDS, _SAMPLE, True
        drawn = np.random.default_rng(0).permutation(count)[: _SAMPLE * lists]
        index.train(vectors[np.sort(drawn)])
        index.nprobe = self._settings.probes
        index.add_with_ids(vectors, ids)
        self._index, self._trained_on = index, count

    def _write(self, file: Path) -> None:
        """A line of JSON, then the index as FAISS writes it."""
        file.parent.mkdir(parents=True, exist_ok=True)
        descriptor, scratch = tempfile.mkstemp(dir=file.parent, prefix=f".{file.name}-")
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(b" " * _HEADER + b"\n")
                digest = hashlib.sha256()

                def write(part: bytes) -> int:
                    digest.update(part)
                    return stream.write(part)

                self._faiss.write_index(self._index, self._faiss.PyCallbackIOWriter(write, _CHUNK))
                header = {
                    "generation": self._generation,
                    "trained_on": self._trained_on,
                    "sha256": digest.hexdigest(),
                }
                stream.seek(0)
                stream.write(json.dumps(header).encode().ljust(_HEADER))
            os.replace(scratch, file)
        except BaseException:
            Path(scratch).unlink(missing_ok=True)
            raise

    def _read(self, file: Path) -> None:
        try:
            with file.open("rb") as stream:
                header = parse_json(stream.readline())
                start, digest = stream.tell(), hashlib.sha256()
                for part in _parts(stream):
                    digest.update(part)
                if digest.hexdigest() != header["sha256"]:
                    raise ValueError("its checksum does not match")
                generation, trained_on = int(header["generation"]), int(header["trained_on"])
                stream.seek(start)
                index = self._faiss.read_index(self._faiss.PyCallbackIOReader(stream.read, _CHUNK))
            if trained_on and index.ntotal > _OUTGROWN * trained_on:
                log.info("the index %s has outgrown its lists and is rebuilt", file)
                return
            if trained_on:
                index.nprobe = self._settings.probes
            ids = self._ids_in_lists(index) if trained_on else self._faiss.vector_to_array(index.id_map)
            self._index, self._ids, self._generation = index, np.unique(ids), generation
            self._trained_on, self._added, self._removed = trained_on, 0, False
        except (OSError, ValueError, KeyError, TypeError, RuntimeError) as error:
            log.warning("the index %s cannot be read and is recreated: %s", file, error)

    def _ids_in_lists(self, index: Any) -> np.ndarray:
        lists = index.invlists
        sizes = [(number, lists.list_size(number)) for number in range(index.nlist)]
        some = [self._faiss.rev_swig_ptr(lists.get_ids(number), size).copy() for number, size in sizes if size]
        return np.concatenate(some) if some else np.zeros(0, np.int64)


_HEADER = 160  # bytes


def _parts(stream: BinaryIO) -> Iterator[bytes]:
    while part := stream.read(_CHUNK):
        yield part
