"""``memo bench retrieval``: a complete retrieval by key compared with a flat index over all entries.

Both answer the same questions from the same book and fetch their rows from the same database; embedding is left out
(all vectors are cached). The baseline is what one would write first: every entry's [action ; objects] vector in one
flat index, the as many rows as a retrieval serves fetched by id.
"""

from __future__ import annotations

import itertools
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.interfaces.embedder import Embedder
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook import queries
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import GLOBAL_KEY
from memo_core.skillbook.key_embedding import KeyVectors
from memo_core.skillbook.keys import Key
from memo_core.skillbook.retrieval import RetrievalSettings
from memo_core.skillbook.text_vectors import TextVectors

_VERBS = ("open", "close", "pick", "place", "push", "pull", "pour", "wipe", "rotate", "stack", "turn on", "lift")
_THINGS = (
    "microwave", "oven", "fridge", "drawer", "cabinet", "cup", "plate", "bottle", "red cube", "food", "lamp", "toaster",
    "kettle", "jar", "pan", "bowl", "door", "box", "faucet", "knob", "spoon", "towel", "bin", "tray", "lid",
)  # fmt: skip
_BLOCK = 20  # questions in a row to each
_PARTS = ("handle", "edge", "left side", "rim", "top", "hinge", "front", "bottom", "corner", "middle")
_WAYS = ("from above", "from the side", "more slowly", "a bit higher", "along an arc", "with a firmer grip", "straight")


@attrs.frozen
class RetrievalBench:
    """Times in milliseconds, medians over all questions; ``ratio`` is what the promise is about (at most 0.5)."""

    entries: int
    keys: int
    dimension: int
    questions: int
    store: str
    by_key_ms: float
    flat_ms: float
    ratio: float
    by_key_p99_ms: float
    flat_p99_ms: float
    flat_search_ms: float  # of flat_ms: the search
    row_fetch_ms: float  # of flat_ms: fetching the rows
    wide_flat_ms: float  # the baseline with vectors as wide as the index's own, roles kept


def bench_retrieval(
    make_embedder: Callable[[], Embedder],
    make_store: Callable[[], VectorStore],
    entries: int = 10_000,
    keys: int = 300,
    questions: int = 300,
    settings: RetrievalSettings | None = None,
) -> dict[str, Any]:
    """Fill a book of its own in a temporary folder and measure. The store should be one that runs in memory.

    Returns the fields of ``RetrievalBench``. Raises ``BackendUnavailable`` when a backend cannot be opened.
    """
    most = len(_THINGS) * len(_VERBS) + 1
    if not 2 <= keys <= most:
        raise InvalidArgument("keys", f"{keys} is not right", f"2 to {most}")
    if entries < 3 * keys:
        raise InvalidArgument("entries", f"{entries} is not right for {keys} keys", f"{3 * keys} or more")
    settings = settings or RetrievalSettings()
    embedder, store, flat, wide = make_embedder(), make_store(), make_store(), make_store()
    with tempfile.TemporaryDirectory(prefix="memo-bench-") as folder:
        path = Path(folder) / "book.db"
        all_keys = [Key(v, (t,)) for t, v in itertools.product(_THINGS, _VERBS)][: keys - 1]
        try:
            _fill(path, all_keys, entries, embedder)
            with Skillbook(str(path), embedder, store, settings) as book:
                database = Database(str(path), read_only=True)
                database.open()
                try:
                    vectors = TextVectors(database, embedder)
                    narrow = _Flat(database, vectors, flat, settings, roles=False)
                    broad = _Flat(database, vectors, wide, settings, roles=True)
                    asked = [all_keys[(7 * i) % len(all_keys)] for i in range(questions)]
                    return attrs.asdict(_measure(book, narrow, broad, asked, entries, store))
                finally:
                    database.close()
        finally:
            embedder.close()
            for one in (store, flat, wide):
                one.close()


def _fill(path: Path, keys: list[Key], entries: int, embedder: Embedder) -> None:
    texts = [f"Hold the {part} of the {thing} {way}." for thing in _THINGS for part in _PARTS for way in _WAYS]
    with Skillbook(str(path), embedder) as book:
        for number, key in enumerate(keys):
            feedback = book.record_feedback("measured", "bench", subtask=str(key))
            mine = [texts[i % len(texts)] for i in range(number, entries, len(keys))]
            book.add_lessons(feedback, key, mine[2:], mine[:1])
            approval = book.record_feedback("", "bench", subtask=str(key), kind="approval")
            book.add_template(approval, key, f'def work():\n    """{mine[1]}"""')


class _Flat:
    """The baseline: all entries in one index, rows by id."""

    def __init__(
        self, database: Database, vectors: TextVectors, store: VectorStore, settings: RetrievalSettings, roles: bool
    ) -> None:
        self._database = database
        self._store = store
        self._weights = settings.weights
        self._count = settings.corrections + settings.general + settings.templates
        self._key_vectors = KeyVectors(vectors, settings.wording, settings.actions)
        self._roles = roles
        with database.read() as connection:
            found = queries.valid_entry_rows(connection)
        self._known = {row.key_id: row.key for row in found}
        store.open()
        keyed = [row for row in found if row.key != GLOBAL_KEY]
        actions, objects = self._vectors([row.key for row in keyed])
        store.reset(actions.shape[1] + objects.shape[1])
        store.add([row.id for row in keyed], np.concatenate([actions, objects], axis=1))
        everywhere = [row.id for row in found if row.key == GLOBAL_KEY]
        store.add(everywhere, np.zeros((len(everywhere), actions.shape[1] + objects.shape[1]), dtype=np.float32))
        self.dimension = actions.shape[1] + objects.shape[1]

    def _vectors(self, keys: list[Key]) -> tuple[np.ndarray, np.ndarray]:
        actions, objects = self._key_vectors.get(keys)
        return actions, objects if self._roles else objects[:, : actions.shape[1]]

    def answer(self, key: Key) -> tuple[float, float]:
        """Seconds of the search and of the row fetch."""
        begun = time.perf_counter()
        actions, objects = self._vectors([key])
        query = np.concatenate([self._weights[0] * actions[0], self._weights[1] * objects[0]]) / sum(self._weights)
        ids, _ = self._store.search(query.astype(np.float32), self._count)
        searched = time.perf_counter()
        _, found = queries.served_rows(self._database, [int(i) for i in ids], self._known)
        [found[int(i)] for i in ids]
        return searched - begun, time.perf_counter() - searched


def _measure(
    book: Skillbook, narrow: _Flat, broad: _Flat, asked: list[Key], entries: int, store: VectorStore
) -> RetrievalBench:
    for key in {*asked}:
        book.retrieve(key), narrow.answer(key), broad.answer(key)  # vectors into memory, statements compiled
    by_key, search, fetch, wide = [], [], [], []
    for begin in range(0, len(asked), _BLOCK):  # taking turns, so that whatever else the machine does meets all alike
        block = asked[begin : begin + _BLOCK]
        for key in block:
            begun = time.perf_counter()
            served = book.retrieve(key)
            by_key.append(time.perf_counter() - begun)
            assert served.corrections, f"nothing was served for {key}"
        for key in block:
            searched, fetched = narrow.answer(key)
            search.append(searched)
            fetch.append(fetched)
        wide += [sum(broad.answer(key)) for key in block]
    flat = [s + f for s, f in zip(search, fetch, strict=True)]
    by_key_ms, flat_ms = 1e3 * statistics.median(by_key), 1e3 * statistics.median(flat)
    return RetrievalBench(
        entries=entries,
        keys=len({*asked}) + 1,  # and the global one
        dimension=narrow.dimension,
        questions=len(asked),
        store=type(store).__name__,
        by_key_ms=by_key_ms,
        flat_ms=flat_ms,
        ratio=by_key_ms / flat_ms,
        by_key_p99_ms=1e3 * float(np.quantile(by_key, 0.99)),
        flat_p99_ms=1e3 * float(np.quantile(flat, 0.99)),
        flat_search_ms=1e3 * statistics.median(search),
        row_fetch_ms=1e3 * statistics.median(fetch),
        wide_flat_ms=1e3 * statistics.median(wide),
    )
