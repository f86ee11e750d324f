"""The ``chroma`` backend: approximate inner products (HNSW) in memory, in a folder, or on a Chroma server.

A filling of the index is a collection of its own: it is named by its time and a random part, filled, and only then
stamped with its generation. So two processes that make the index anew at the same time on one server never mix their
vectors, and one that was killed while it filled leaves a collection without a stamp, which nobody takes for an index.
A change of a stamped collection takes the stamp off until the next one is set.

Chroma's native code ends the whole process when the files of its graph (HNSW) are damaged. Therefore the
digests of a collection's files are noted, and a collection whose files have others is not asked: it is filled again.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import sqlite3
import time
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from memo_core.plugin import BackendUnavailable, InvalidArgument, VectorStore
from memo_vectorstore.settings import ChromaSettings

_NEIGHBOURS = 32  # links a vector; 16 (the default) finds 99.75 % where 32 finds all
_BATCH = 1000
_DIGESTS = "memo-digests.json"  # of the graphs' files, by folder, as they were when their store wrote last
_STALE_S = 600.0  # collections of others are cleared away when they are older; who still uses one makes it anew


def _naming_damage(method: Callable[..., Any]) -> Callable[..., Any]:
    """Raise ``BackendUnavailable`` in place of Chroma's own errors, which name no remedy."""

    @functools.wraps(method)
    def named(self: ChromaStore, *arguments: Any) -> Any:
        from chromadb.errors import ChromaError

        try:
            return method(self, *arguments)
        except ChromaError as error:
            raise self._damaged(error) from error

    return named


class ChromaStore(VectorStore):
    """One collection in space "ip". Telemetry is off. The ids are kept here as well, so counting asks nobody."""

    def __init__(self, settings: ChromaSettings) -> None:
        self._settings = settings
        self._client: Any = None
        self._collection: Any = None
        self._dimension = 0
        self._ids: set[int] = set()
        self._generation: int | None = None
        self._own = False  # whether this store made the collection

    def open(self) -> None:
        """Idempotent. Takes over the newest finished collection of its name. Raises ``BackendUnavailable``."""
        if self._client is not None:
            return
        self._client = self._connect()
        if not self._settings.folder and not self._settings.server:
            return
        try:
            found = self._collections()
        except Exception as error:
            self._client = None
            raise self._damaged(error) from error
        finished = [c for c in found if "generation" in (c.metadata or {})]
        if finished and self._is_sound(newest := max(finished, key=_begun)):
            self._take_over(newest)

    def close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            if not self._settings.folder and not self._settings.server and self._collection is not None:
                client.delete_collection(self._collection.name)  # all stores in memory share one database
            client.close()
            self._note_digests()
        self._forget()

    @_naming_damage
    def reset(self, dimension: int) -> None:
        if dimension < 1:
            raise InvalidArgument("dimension", f"{dimension} is not right", "1 or more")
        client = self._opened()
        old = self._collection if self._own else None
        name = f"{self._settings.collection}.{uuid.uuid4().hex[:12]}"
        hnsw = {
            "space": "ip",
            "max_neighbors": _NEIGHBOURS,
            "ef_construction": 100,
            "ef_search": self._settings.candidates,
        }
        made = client.create_collection(
            name,
            embedding_function=None,
            configuration={"hnsw": hnsw},
            metadata={"begun": repr(time.time()), "dimension": dimension},
        )
        self._forget()
        self._collection, self._dimension, self._own = made, dimension, True
        if old is not None:
            self._delete(old.name)

    @_naming_damage
    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
        self._opened()
        given = np.ascontiguousarray(vectors, dtype=np.float32)
        if self._collection is None or given.shape != (len(ids), self._dimension):
            expected = f"({len(ids)}, {self._dimension}), the dimension of reset()"
            raise InvalidArgument("vectors", f"shape {given.shape}", expected)
        if len(set(ids)) != len(ids):
            raise InvalidArgument("ids", "an id occurs twice", "different ids")
        self._take_stamp_off()
        for start in range(0, len(ids), _BATCH):
            part = [int(i) for i in ids[start : start + _BATCH]]
            self._collection.upsert(ids=[str(i) for i in part], embeddings=given[start : start + _BATCH])
            self._ids.update(part)

    @_naming_damage
    def remove(self, ids: Sequence[int]) -> None:
        self._opened()
        there = [int(i) for i in ids if int(i) in self._ids]
        if there:
            self._take_stamp_off()
        for start in range(0, len(there), _BATCH):
            part = there[start : start + _BATCH]
            self._collection.delete(ids=[str(i) for i in part])
            self._ids.difference_update(part)

    @_naming_damage
    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        self._opened()
        wanted = min(count, len(self._ids))
        if wanted < 1:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.float32)
        question = np.ascontiguousarray(query, dtype=np.float32)
        if question.shape != (self._dimension,):
            raise InvalidArgument("query", f"shape {question.shape}", f"({self._dimension},)")
        answer = self._collection.query(query_embeddings=[question], n_results=wanted, include=["distances"])
        ids = np.array([int(i) for i in answer["ids"][0]], dtype=np.int64)
        return ids, 1 - np.array(answer["distances"][0], dtype=np.float32)  # "ip" answers with 1 - the inner product

    def __len__(self) -> int:
        return len(self._ids)

    def ids(self) -> np.ndarray:
        return np.fromiter(self._ids, dtype=np.int64, count=len(self._ids))

    def generation(self) -> int | None:
        return self._generation

    @_naming_damage
    def set_generation(self, generation: int) -> None:
        self._opened()
        if self._collection is None:
            return
        # as text: Chroma's integers are floats to its server
        self._collection.modify(metadata=self._unstamped() | {"generation": str(generation)})
        self._generation = generation
        self._note_digests()
        self._clear_away()

    # -- inside --------------------------------------------------------------------------------------------------------
    def _unstamped(self) -> dict[str, Any]:
        return {key: value for key, value in self._collection.metadata.items() if key != "generation"}

    def _take_stamp_off(self) -> None:
        """Before a change: a process that is killed in the middle of it leaves no index that looks finished."""
        if self._generation is not None:
            self._collection.modify(metadata=self._unstamped())
            self._generation = None

    def _connect(self) -> Any:
        try:
            import chromadb
            from chromadb.config import Settings
        except ImportError as error:
            raise BackendUnavailable("vectorstore", "chroma", f"{error}", "pip install chromadb") from error
        settings = Settings(anonymized_telemetry=False)
        if self._settings.server:
            parts = urlsplit(self._settings.server)
            secure = parts.scheme == "https"
            port = parts.port or (443 if secure else 80)
            try:
                return chromadb.HttpClient(str(parts.hostname), port, secure, settings=settings)
            except Exception as error:
                reason = f"no Chroma server answers at {self._settings.server}: {error}"
                remedy = f"chroma run --path FOLDER --port {port}"
                raise BackendUnavailable("vectorstore", "chroma", reason, remedy) from error
        if not self._settings.folder:
            return chromadb.EphemeralClient(settings)
        if Path(self._settings.folder).is_file():
            reason = f"vectorstore.folder: {self._settings.folder} is a file"
            raise BackendUnavailable("vectorstore", "chroma", reason, "name a folder, or one that is not there yet")
        try:
            return chromadb.PersistentClient(self._settings.folder, settings)
        except Exception as error:
            raise self._damaged(error) from error

    def _damaged(self, error: Exception) -> BackendUnavailable:
        place = self._settings.server or self._settings.folder
        cause: BaseException = error
        while cause.__context__ is not None:  # Chroma's cleaning up fails too, and hides why
            cause = cause.__context__
        reason = f"{place} cannot be used and may be damaged: {' '.join(str(cause).split())}"
        return BackendUnavailable("vectorstore", "chroma", reason, f"delete {place}: the book fills it again")

    # -- damage --------------------------------------------------------------------------------------------------------
    def _is_sound(self, collection: Any) -> bool:
        """Whether the files of a collection's graph are as they were noted."""
        if not self._settings.folder:
            return True
        graph = self._graph(collection)
        return graph is not None and self._noted().get(graph.name, {}) == _digests(graph)

    def _note_digests(self) -> None:
        if not self._settings.folder or self._collection is None or (graph := self._graph(self._collection)) is None:
            return
        there = {name: digests for name, digests in self._noted().items() if (graph.parent / name).is_dir()}
        noted = json.dumps(there | {graph.name: _digests(graph)})
        part = graph.parent / f".{_DIGESTS}.{uuid.uuid4().hex}"
        with contextlib.suppress(OSError):  # a folder that cannot be written is filled again each time
            part.write_text(noted, encoding="utf-8")
            part.replace(graph.parent / _DIGESTS)

    def _noted(self) -> dict[str, dict[str, str]]:
        try:
            return dict(json.loads((Path(self._settings.folder) / _DIGESTS).read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return {}

    def _graph(self, collection: Any) -> Path | None:
        """The folder of a collection's graph, which need not exist yet; None if Chroma's database does not say."""
        folder = Path(self._settings.folder)
        query = "SELECT id FROM segments WHERE scope = 'VECTOR' AND collection = ?"
        try:
            with contextlib.closing(sqlite3.connect(folder / "chroma.sqlite3")) as database:
                row = database.execute(query, (str(collection.id),)).fetchone()
        except sqlite3.Error:
            return None
        return None if row is None else folder / str(row[0])

    def _opened(self) -> Any:
        if self._client is None:
            raise BackendUnavailable("vectorstore", "chroma", "it is not open", "call open() first")
        return self._client

    def _forget(self) -> None:
        self._collection, self._dimension, self._own = None, 0, False
        self._ids = set()
        self._generation = None

    def _take_over(self, collection: Any) -> None:
        try:
            ids = {int(i) for i in collection.get(include=[])["ids"]}
            dimension = int(collection.metadata["dimension"])
            generation = int(collection.metadata["generation"])
        except Exception:  # deleted by another process meanwhile, or damaged: it is derived data and made anew
            return
        self._collection, self._ids, self._dimension, self._generation = collection, ids, dimension, generation

    def _collections(self) -> list[Any]:
        """Those of our name, all that were ever begun and not cleared away."""
        prefix = f"{self._settings.collection}."
        return [c for c in self._opened().list_collections() if c.name.startswith(prefix)]

    def _clear_away(self) -> None:
        for collection in self._collections():
            if collection.name != self._collection.name and _begun(collection) < time.time() - _STALE_S:
                self._delete(collection.name)

    def _delete(self, name: str) -> None:
        from chromadb.errors import NotFoundError

        with contextlib.suppress(NotFoundError):  # another process was quicker
            self._opened().delete_collection(name)


def _begun(collection: Any) -> float:
    try:
        return float((collection.metadata or {})["begun"])
    except (KeyError, ValueError):
        return 0.0


def _digests(folder: Path) -> dict[str, str]:
    found = {}
    for file in sorted(folder.glob("*")):
        with contextlib.suppress(OSError), file.open("rb") as stream:
            found[file.name] = hashlib.file_digest(stream, "sha256").hexdigest()
    return found
