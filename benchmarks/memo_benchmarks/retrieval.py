"""``memo bench retrieval``: the time of one retrieval from a book of a given size, beside a plain search."""

from __future__ import annotations

import random
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from memo_benchmarks.generated_book import BookSize, WordVectors, fill, keys_of
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.retrieval.retriever import RetrievalSettings

_SHOWN = 50  # entries of the plain search: as many as a retrieval returns at most, or more


def bench_retrieval(
    make_store: Callable[[], VectorStore],
    entries: int = 20_000,
    keys: int = 1_000,
    questions: int = 200,
    settings: RetrievalSettings | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> dict[str, Any]:
    """Fill a book in a temporary folder and measure.

    Args:
        make_store: makes the vector store.
        entries: entries in the book.
        keys: distinct keys.
        questions: subtasks that are asked for; each is one of the keys.
        settings: of retrieval.
        progress: called with the share that is done.

    Returns:
        Milliseconds without embedding: median and 99th percentile of a retrieval; the first one, which loads the book;
        one after a change; and the median of the plain search, the dot product of all texts' vectors with the question
        and the rows of the best 50 entries. ``ratio`` is retrieval over plain search.

    Raises:
        InvalidArgument: for a size that cannot be made.
        BackendUnavailable: if the store cannot be used.
    """
    size = BookSize(entries, keys)
    asked = random.Random(0).choices(keys_of(size), k=questions)
    with tempfile.TemporaryDirectory(prefix="memo-bench-") as folder:
        path = str(Path(folder) / "book.db")
        with Skillbook(path, WordVectors()) as book:
            fill(book, size, lambda share: progress(0.4 * share))
            book.prepare(lambda share: progress(0.4 + 0.3 * share))
        with Skillbook(path, WordVectors(), make_store(), settings) as book:
            first = _milliseconds(lambda: book.retrieve(asked[0]))
            for key in asked:  # vectors and terms of the texts are in memory afterwards, as in a session
                book.retrieve(key)
            times = [_milliseconds(lambda key=key: book.retrieve(key)) for key in asked]  # type: ignore[misc]
            book.add_lessons(book.record_feedback("no", "bench", subtask=str(asked[0])), asked[0], ["Go lower."])
            changed = _milliseconds(lambda: book.retrieve(asked[0]))
            progress(0.9)
            plain = _plain(book, asked)
    return {
        "entries": entries,
        "keys": keys,
        "questions": questions,
        "p50_ms": statistics.median(times),
        "p99_ms": float(np.quantile(times, 0.99)),
        "first_ms": first,
        "after_a_change_ms": changed,
        "plain_p50_ms": plain,
        "ratio": statistics.median(times) / plain,
    }


def _plain(book: Skillbook, asked: list[Any]) -> float:
    entries = book.entries()
    embedder = WordVectors()
    vectors = embedder.embed([entry.text for entry in entries])
    questions = embedder.embed([str(key) for key in asked])

    def search(question: np.ndarray) -> None:
        best = np.argpartition(-(vectors @ question), _SHOWN)[:_SHOWN]
        for place in best.tolist():
            book.entry(entries[place].id)

    return statistics.median(_milliseconds(lambda q=q: search(q)) for q in questions)  # type: ignore[misc]


def _milliseconds(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return 1000 * (time.perf_counter() - began)
