"""``memo bench skillbook``: a large book, side by side with what one would write first.

Ours, every installed vector store with one vector an entry, and a loop over the entries that computes one cosine after
another. All answer the same questions from the same book, fetch as many rows from the same database, and each runs in a
fresh process, so that its memory is its own. Embedding is left out: every vector is cached. The embedder is a
bag of random word vectors, as wide as all-MiniLM-L6-v2's: a million texts would take that model most of an hour, and
what is measured never asks it.
"""

from __future__ import annotations

import itertools
import json
import multiprocessing
import random
import re
import resource
import statistics
import sys
import tempfile
import time
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np
import sqlalchemy as sa

from memo_benchmarks.exact_serving import recall_of_exact
from memo_benchmarks.generated_book import BookSize, fill, keys_of
from memo_core.config import load_experiment
from memo_core.errors import MemoError
from memo_core.interfaces.embedder import Embedder
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.plugins import Registry, missing_needs
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook import queries, tables
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import GLOBAL_KEY
from memo_core.skillbook.key_embedding import KeyVectors
from memo_core.skillbook.keys import Key
from memo_core.skillbook.retrieval import RetrievalSettings, as_text
from memo_core.skillbook.text_vectors import TextVectors

DIMENSION = 384
_WRITE = 2_000  # vectors given to a store at once
_LOOPED = 5  # questions to the loop
_ASKING = 60.0  # s; a contender is asked as many questions as it answers until then
_CHANGES = 20  # times the book is changed and asked
_ALONE = "plain loop"
_OURS = "skillbook"


class WordVectors(Embedder):
    """A text is the sum of fixed random vectors of its words, made a unit vector."""

    name = f"random-words-{DIMENSION}"
    dimension = DIMENSION

    def __init__(self) -> None:
        self._words: dict[str, np.ndarray] = {}

    def open(self) -> None: ...

    def close(self) -> None: ...

    def embed(self, texts: Sequence[str]) -> np.ndarray:
        made = np.stack(
            [sum((self._word(w) for w in re.findall(r"\w+", text.lower())), self._word("")) for text in texts]
        )
        return (made / np.linalg.norm(made, axis=1, keepdims=True)).astype(np.float32)

    def _word(self, word: str) -> np.ndarray:
        found = self._words.get(word)
        if found is None:
            found = np.random.default_rng(zlib.crc32(word.encode())).standard_normal(DIMENSION).astype(np.float32)
            self._words[word] = found
        return found


@attrs.frozen
class Source:
    """What a fresh process needs to make the same experiment: its file and overrides."""

    config: Path | None = None
    overrides: tuple[str, ...] = ()

    def settings(self) -> RetrievalSettings:
        found: RetrievalSettings = load_experiment(Registry(), self.config, self.overrides, SECTIONS).section(
            "retrieval"
        )
        return found

    def store(self, name: str) -> VectorStore:
        """The experiment's store for "", else a backend with its defaults."""
        registry = Registry()
        if not name:
            made: VectorStore = load_experiment(registry, self.config, self.overrides, SECTIONS).create("vectorstore")
            return made
        backend = registry.get("vectorstore", name)
        other: VectorStore = backend.factory(backend.config())
        return other


@attrs.frozen
class Asked:
    """What every contender is given."""

    source: Source
    book: Path
    keys: tuple[Key, ...]
    questions: int
    seed: int
    seconds: float  # for filling an index of entries

    def subtasks(self) -> list[Key]:
        """Different keys where there are enough, drawn evenly."""
        draw = random.Random(f"{self.seed} questions")
        if self.questions <= len(self.keys):
            return draw.sample(list(self.keys), self.questions)
        return [draw.choice(self.keys) for _ in range(self.questions)]


def bench_skillbook(
    source: Source,
    size: BookSize,
    questions: int = 500,
    seconds: float = 60.0,
    folder: Path | None = None,
    stores: Sequence[str] | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> dict[str, Any]:
    """Make a book and measure all contenders, one after the other.

    ``folder``: keep the book there and take it again next time (a million entries take a quarter of an hour); without,
    it lies in a temporary folder. ``seconds``: how long a store may take to be filled with entries; what it was given
    until then is what it is asked over, and said. ``stores``: only these backends. Raises ``InvalidArgument``.
    """
    with tempfile.TemporaryDirectory(prefix="memo-bench-") as scratch:
        path = (folder or Path(scratch)) / f"book-{size.entries}-{size.keys}-{size.general:g}-{size.seed}.db"
        asked = Asked(source, path, tuple(keys_of(size)), questions, size.seed, seconds)
        made = _made(asked, size, progress)
        names = _usable(Registry()) if stores is None else list(stores)
        measured = [_alone(_ours, asked)]
        recall = _alone(_recall, asked)
        progress(0.8)
        measured += [_alone(_store_of_entries, asked, name) for name in names]
        progress(0.95)
        measured.append(_alone(_loop, asked))
    return {
        "entries": size.entries,
        "keys": size.keys,
        "general_share": size.general,
        "dimension": DIMENSION,
        "questions": questions,
        **made,
        "recall_of_exact": recall,
        "contenders": measured,
    }


def _made(asked: Asked, size: BookSize, progress: Callable[[float], None]) -> dict[str, Any]:
    """How making the book went, this time or when it was made."""
    story = asked.book.with_suffix(".json")
    if story.exists():
        known: dict[str, Any] = json.loads(story.read_text(encoding="utf-8"))
        return known
    asked.book.parent.mkdir(parents=True, exist_ok=True)
    for rest in ("", "-wal", "-shm"):  # of a run that was interrupted
        Path(f"{asked.book}{rest}").unlink(missing_ok=True)
    made = _alone(_make, asked, size, progress=progress)
    story.write_text(json.dumps(made), encoding="utf-8")
    return made


def _usable(registry: Registry) -> list[str]:
    return [b.name for b in registry.backends("vectorstore") if not missing_needs(b.needs)]


# -- fresh processes ---------------------------------------------------------------------------------------------------
def _alone(
    work: Callable[..., dict[str, Any]], *given: Any, progress: Callable[[float], None] | None = None
) -> dict[str, Any]:
    """Run in a process of its own; what that found."""
    spawn = multiprocessing.get_context("spawn")
    here, there = spawn.Pipe(duplex=False)
    process = spawn.Process(target=_report, args=(there, work, given), daemon=True)
    process.start()
    there.close()
    try:
        while True:
            kind, value = here.recv()
            if kind == "progress" and progress is not None:
                progress(0.7 * value)
            elif kind == "found":
                found: dict[str, Any] = value
                return found
            elif kind == "failed":
                raise value
    except EOFError:
        process.join()
        raise RuntimeError(f"the process that measures {work.__name__} ended with code {process.exitcode}") from None
    finally:
        process.terminate()
        process.join()


def _report(pipe: Any, work: Callable[..., dict[str, Any]], given: tuple[Any, ...]) -> None:
    try:
        more = {"progress": lambda share: pipe.send(("progress", share))} if work is _make else {}
        pipe.send(("found", work(*given, **more)))
    except MemoError as error:
        pipe.send(("failed", RuntimeError(str(error))))


def peak_mib() -> float:
    """The largest resident size this process has had. Where the system keeps it by address space, that of this
    process alone: the usual counter also remembers the parent it was forked from."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024
    except (OSError, StopIteration):
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return peak / (1 << 20) if sys.platform == "darwin" else peak / 1024


# -- contenders --------------------------------------------------------------------------------------------------------
def _make(asked: Asked, size: BookSize, progress: Callable[[float], None]) -> dict[str, Any]:
    with Skillbook(str(asked.book), WordVectors(), settings=asked.source.settings()) as book:
        begun = time.perf_counter()
        stored = fill(book, size, lambda share: progress(0.5 * share))
        inserted = time.perf_counter()
        book.prepare(lambda share: progress(0.5 + 0.5 * share))
        prepared = time.perf_counter()
        database = Database(str(asked.book))
        database.open()
        TextVectors(database, WordVectors()).get([as_text(key) for key in asked.keys])
        database.close()
        stats = book.stats()
    assert stored == size.entries, f"{stored} entries were stored"
    return {
        "corrections": stats.corrections,
        "general": stats.general,
        "templates": stats.templates,
        "insert_per_s": stored / (inserted - begun),
        "vectors_per_s": stored / (prepared - inserted),
        "book_mib": asked.book.stat().st_size / (1 << 20),
    }


def _ours(asked: Asked) -> dict[str, Any]:
    """The book as a policy opens it. Everything that ``retrieve`` does is timed, from the subtask to the entries that
    are served; every question is about a key that was not asked before, and the book does not change meanwhile. What it
    costs when it does is measured apart: another process's writing is stood in for by another opening of the book."""
    _read_through(asked.book)
    store, settings = asked.source.store(""), asked.source.settings()
    subtasks = asked.subtasks()
    begun = time.perf_counter()
    with Skillbook(str(asked.book), WordVectors(), store, settings) as book:

        def serve(key: Key) -> int:
            return len(book.retrieve(key).corrections)

        serve(subtasks[0])
        opened = time.perf_counter() - begun
        first = [_timed(serve, key) for key in subtasks[1:]]
        again = [_timed(serve, key) for key in subtasks[-50:] * 4]
        changed = []
        with Skillbook(str(asked.book), WordVectors(), settings=settings) as other:
            for number, key in enumerate(subtasks[:_CHANGES]):
                lesson = f"Hold it gently, {asked.seed} {number}."  # the same words each time the bench is run
                TextVectors(other._database, WordVectors()).get([lesson])
                other.add_lessons(other.record_feedback("no, gently", "bench", subtask=str(key)), key, [lesson])
                changed.append(_timed(serve, key))
    assert all(served for *_, served in first), "a key that has entries was served nothing"
    return (
        {"contender": _OURS, "over": "keys", "entries": None, "open_s": opened}
        | _times(first)
        | {"again_" + name: value for name, value in _times(again).items() if name != "questions"}
        | {"after_a_change_" + name: value for name, value in _times(changed).items() if name != "questions"}
        | {"peak_mib": peak_mib()}
    )


def _recall(asked: Asked) -> dict[str, Any]:
    """Of a tenth of the questions, at least 20: what share of what comparing every entry would serve is served."""
    subtasks = asked.subtasks()[: max(20, asked.questions // 10)]
    source = asked.source
    return dict(recall_of_exact(str(asked.book), WordVectors(), source.store(""), source.settings(), subtasks))


def _read_through(file: Path) -> None:
    """So that the system has the file in memory, as after it was made: a book that was kept would be read from disk."""
    with file.open("rb", buffering=0) as stream:
        while stream.read(1 << 24):
            pass


def _timed(answer: Callable[[Key], int], key: Key) -> tuple[float, float, int]:
    """Seconds by the clock and of this thread, and how much was answered."""
    begun, cpu = time.perf_counter(), time.thread_time()
    given = answer(key)
    return time.perf_counter() - begun, time.thread_time() - cpu, given


def _times(measured: Sequence[tuple[float, float, int]]) -> dict[str, Any]:
    wall, cpu = [1e3 * w for w, _, _ in measured], [1e3 * c for _, c, _ in measured]
    return {
        "questions": len(measured),
        "p50_ms": statistics.median(wall),
        "p99_ms": float(np.quantile(wall, 0.99)),
        "cpu_p50_ms": statistics.median(cpu),
        "cpu_p99_ms": float(np.quantile(cpu, 0.99)),
    }


class _Entries:
    """One vector an entry: its key's, action and objects (roles left out, as one would at first)."""

    def __init__(self, asked: Asked) -> None:
        self.settings = asked.source.settings()
        self.database = Database(str(asked.book), read_only=True)
        self.database.open()
        self._key_vectors = KeyVectors(
            TextVectors(self.database, WordVectors()), self.settings.wording, self.settings.actions
        )
        valid = tables.entries.c.superseded_by.is_(None)
        with self.database.read() as connection:
            known = self._known = queries.keys_by_id(connection)
            found = connection.execute(sa.select(tables.entries.c.id, tables.entries.c.key).where(valid)).all()
        ids = sorted(key for key in known if known[key] != GLOBAL_KEY)
        place = {key: row for row, key in enumerate(ids)}
        keyed = [(entry, place[key]) for entry, key in found if key in place]
        self.ids = np.array([entry for entry, _ in keyed], dtype=np.int64)
        self._row = np.array([row for _, row in keyed], dtype=np.int64)
        self._vectors = self.of_keys([known[key] for key in ids])
        self.count = self.settings.corrections + self.settings.general + self.settings.templates

    def of_keys(self, keys: Sequence[Key]) -> np.ndarray:
        """Shape (len(keys), 2 · dimension)."""
        actions, objects = self._key_vectors.get(keys)
        moved = objects[:, :DIMENSION]
        return np.concatenate([actions, moved / np.linalg.norm(moved, axis=1, keepdims=True)], axis=1)

    def vectors(self, start: int, stop: int) -> np.ndarray:
        return self._vectors[self._row[start:stop]]

    def query(self, key: Key) -> np.ndarray:
        one, other = self.settings.weights
        vector = self.of_keys([key])[0]
        scaled = np.concatenate([one * vector[:DIMENSION], other * vector[DIMENSION:]]) / (one + other)
        return scaled.astype(np.float32)

    def fetch(self, ids: Sequence[int]) -> int:
        _, found = queries.served_rows(self.database, list(ids), self._known)
        return len(found)


def _store_of_entries(asked: Asked, name: str) -> dict[str, Any]:
    _read_through(asked.book)
    begun = time.perf_counter()
    entries, store = _Entries(asked), asked.source.store(name)
    subtasks = asked.subtasks()
    entries.of_keys(subtasks)  # vectors into memory
    store.open()
    try:
        store.reset(2 * DIMENSION)
        given = 0
        while given < len(entries.ids) and (not given or time.perf_counter() - begun < asked.seconds):
            stop = min(given + _WRITE, len(entries.ids))
            store.add(entries.ids[given:stop].tolist(), entries.vectors(given, stop))
            given = stop
        opened = time.perf_counter() - begun

        def answer(key: Key) -> int:
            ids, _ = store.search(entries.query(key), entries.count)
            return entries.fetch(ids.tolist())

        answer(subtasks[0])
        measured = [_timed(answer, key) for key in _until(time.perf_counter() + _ASKING, subtasks[1:])]
    finally:
        store.close()
        entries.database.close()
    found = {"contender": name, "over": "entries", "entries": given, "open_s": opened}
    return found | _times(measured) | {"peak_mib": peak_mib()}


def _until(deadline: float, subtasks: list[Key]) -> itertools.takewhile[Key]:
    """At least three, then as many as there is time for."""
    counted = itertools.count()
    return itertools.takewhile(lambda _: next(counted) < 3 or time.perf_counter() < deadline, subtasks)


def _loop(asked: Asked) -> dict[str, Any]:
    _read_through(asked.book)
    begun = time.perf_counter()
    entries = _Entries(asked)
    vectors = [*entries.vectors(0, len(entries.ids))]
    subtasks = asked.subtasks()
    one, other = entries.settings.weights
    opened = time.perf_counter() - begun

    def cosine(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.dot(a, b) / (np.linalg.norm(a) * np.linalg.norm(b)))

    def answer(key: Key) -> int:
        asked_for = entries.of_keys([key])[0]
        action, objects = asked_for[:DIMENSION], asked_for[DIMENSION:]
        scores = [one * cosine(action, v[:DIMENSION]) + other * cosine(objects, v[DIMENSION:]) for v in vectors]
        best = sorted(range(len(scores)), key=scores.__getitem__, reverse=True)[: entries.count]
        return entries.fetch([int(entries.ids[i]) for i in best])

    measured = [_timed(answer, key) for key in _until(time.perf_counter() + _ASKING, subtasks[:_LOOPED])]
    entries.database.close()
    found = {"contender": _ALONE, "over": "entries", "entries": len(entries.ids), "open_s": opened}
    return found | _times(measured) | {"peak_mib": peak_mib()}
