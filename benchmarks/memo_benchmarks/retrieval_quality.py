"""``memo bench retrieval-quality``: what retrieval serves, against labels that no retrieval code uses.

Settings are swept on the halves "choose" and reported on the halves "report", which share no objects with them. Only
corrections are looked at. Compared are the paper's formula and settings, the formula with MEMO's tables, the cosine of
key and text in one sentence, and ours; intervals are of a paired bootstrap over subtasks.
"""

from __future__ import annotations

import itertools
import math
import statistics
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from memo_benchmarks.labelled_book import HALVES
from memo_benchmarks.labelled_notes import LabelledNotes, people, templated
from memo_core.interfaces.embedder import Embedder
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook import exchange
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.retrieval.retriever import RetrievalSettings, as_text
from memo_core.skillbook.writing.bulk_adding import Lesson

PAPER = attrs.evolve(RetrievalSettings.preset("paper"), corrections=RetrievalSettings().corrections)  # the same k
PLAIN = "cosine of key and text"
OURS = "ours"
BY_KEY = "r with our tables"
TEXT_WEIGHTS = (0.15, 0.245, 0.35)
OVERLAP_WEIGHTS = (0.0, 0.05, 0.105, 0.2)
REACHES = (0.1, 0.15, 0.2, 0.25)
FLOORS = (0.3, 0.35, 0.4)
_SAMPLES = 2000  # of the bootstrap

Row = dict[str, Any]


@attrs.frozen
class One:
    """How one subtask was served."""

    recall: float | None  # of at most k; None where nothing is relevant
    precision: float | None  # None where nothing was served
    ndcg: float | None  # None where nothing is relevant
    f1: float
    opposites: int  # entries


def judge(gains: Sequence[int], opposites: int, ideal: Sequence[int], k: int) -> One:
    """Of the grades served, in order, and of all grades there are, largest first.

    recall@k: relevant entries (grade 1 and more) among the first k, of as many as k could hold. precision@k: of what
    was served. nDCG@k with gains 2^grade − 1 (Järvelin and Kekäläinen 2002; Burges et al. 2005). f1 is 1 where nothing
    is relevant and nothing was served.
    """
    served = gains[:k]
    relevant, possible = sum(g > 0 for g in served), min(k, sum(g > 0 for g in ideal))
    recall = relevant / possible if possible else None
    precision = relevant / len(served) if served else None
    ndcg = _dcg(served) / _dcg(ideal[:k]) if possible else None
    if not possible:
        f1 = float(not served)
    else:
        f1 = 2 * relevant / (len(served) + possible)
    return One(recall, precision, ndcg, f1, opposites)


def _dcg(gains: Sequence[int]) -> float:
    return sum((2**gain - 1) / math.log2(place + 2) for place, gain in enumerate(gains))


def _mean(values: Sequence[float | None]) -> float:
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else 0.0


def summary(rows: Sequence[One]) -> Row:
    """Means over subtasks; ``opposites`` counts entries, ``subtasks_with_opposites`` subtasks, ``silent`` those that
    were served nothing though something is relevant."""
    return {
        "f1": _mean([row.f1 for row in rows]),
        "recall": _mean([row.recall for row in rows]),
        "precision": _mean([row.precision for row in rows]),
        "ndcg": _mean([row.ndcg for row in rows]),
        "opposites": sum(row.opposites for row in rows),
        "subtasks_with_opposites": sum(row.opposites > 0 for row in rows),
        "served_nothing": sum(row.precision is None for row in rows),
        "silent": sum(row.precision is None and row.recall is not None for row in rows),
    }


def difference(ours: Sequence[One], others: Sequence[One], measure: str, seed: int = 0) -> Row:
    """Mean difference of a measure over the subtasks where both have one, with the 95 % interval of a paired bootstrap
    over subtasks."""
    pairs = [(getattr(a, measure), getattr(b, measure)) for a, b in zip(ours, others, strict=True)]
    known = np.array([a - b for a, b in pairs if a is not None and b is not None])
    if not len(known):
        return {"mean": 0.0, "low": 0.0, "high": 0.0}
    drawn = np.random.default_rng(seed).integers(0, len(known), (_SAMPLES, len(known)))
    low, high = np.quantile(known[drawn].mean(axis=1), (0.025, 0.975))
    return {"mean": float(known.mean()), "low": float(low), "high": float(high)}


class NotesOnDisk:
    """Labelled notes in a book on disk, asked under any settings."""

    def __init__(
        self, notes: LabelledNotes, path: Path, embedder: Embedder, make_store: Callable[[], VectorStore]
    ) -> None:
        self.notes, self._path, self._embedder, self._make_store = notes, path, embedder, make_store
        with Skillbook(str(path), embedder) as book:
            if not book.entries():
                exchange.add_many(
                    book, [Lesson("no, not like that", "labels", note.key, (note.text,)) for note in notes.notes]
                )
            self._place = {entry.id: place for place, entry in enumerate(book.entries("correction"))}

    def ours(self, settings: RetrievalSettings) -> list[One]:
        """Each subtask under one setting."""
        with Skillbook(str(self._path), self._embedder, self._make_store(), settings) as book:
            served = [
                [self._place[one.entry.id] for one in book.retrieve(asked.subtask).corrections]
                for asked in self.notes.asked
            ]
        return self._judged(served, settings.corrections)

    def plain(self, k: int) -> list[One]:
        """The k notes with the largest cosine of the subtask's words and key and text in one sentence."""
        sentences = [f"{as_text(note.key)}: {note.text}" for note in self.notes.notes]
        asked = self._embedder.embed([as_text(one.subtask) for one in self.notes.asked])
        likeness = asked @ self._embedder.embed(sentences).T
        return self._judged([np.argsort(-row, kind="stable")[:k].tolist() for row in likeness], k)

    def _judged(self, served: Sequence[Sequence[int]], k: int) -> list[One]:
        return [
            judge(
                [asked.grades[place] for place in places],
                sum(asked.undone[place] for place in places),
                sorted(asked.grades, reverse=True),
                k,
            )
            for asked, places in zip(self.notes.asked, served, strict=True)
        ]


def bench_retrieval_quality(
    embedder: Embedder,
    make_store: Callable[[], VectorStore],
    settings: RetrievalSettings | None = None,
    sweep: bool = False,
    more: Sequence[LabelledNotes] = (),
    progress: Callable[[float], None] = lambda share: None,
) -> Row:
    """The paper's settings, its formula with our tables, the plain cosine and ours on every set of labels; ``more``:
    further sets. With ``sweep`` also weights, reach and floor of ours on the halves "choose"."""
    ours = settings or RetrievalSettings()
    sets = [*(templated(half) for half in HALVES), *(people(half) for half in HALVES), *more]
    with tempfile.TemporaryDirectory(prefix="memo-bench-") as folder:
        embedder.open()
        books = [
            NotesOnDisk(one, Path(folder) / f"{number}.db", embedder, make_store) for number, one in enumerate(sets)
        ]
        compared = []
        for number, book in enumerate(books):
            compared.append(_compared(book, ours))
            progress((number + 1) / len(books) * (0.2 if sweep else 1.0))
        swept = _sweep(books[0], books[2], ours, lambda share: progress(0.2 + 0.8 * share)) if sweep else []
        return {"k": ours.corrections, "embedder": embedder.name, "sets": compared, "sweep": swept}


def _compared(book: NotesOnDisk, ours: RetrievalSettings) -> Row:
    contenders = {
        "paper": PAPER,
        BY_KEY: attrs.evolve(ours, ranking="key", newest=False),
        "ours without tables": attrs.evolve(ours, shipped_actions=False),
        OURS: ours,
    }
    judged = {name: book.ours(one) for name, one in contenders.items()} | {PLAIN: book.plain(ours.corrections)}
    return {
        "name": book.notes.name,
        "notes": len(book.notes.notes),
        "subtasks": len(book.notes.asked),
        "contenders": [{"name": name, **summary(rows)} for name, rows in judged.items()],
        "ours_minus": {
            name: {one: difference(judged[OURS], judged[name], one) for one in ("recall", "ndcg", "precision")}
            for name in (PLAIN, BY_KEY)
        },
    }


def _sweep(
    one: NotesOnDisk, other: NotesOnDisk, ours: RetrievalSettings, progress: Callable[[float], None]
) -> list[Row]:
    found = []
    grid = list(itertools.product(TEXT_WEIGHTS, OVERLAP_WEIGHTS, REACHES, FLOORS))
    for number, (text, overlap, reach, floor) in enumerate(grid):
        chosen: Row = {"text_weight": text, "overlap_weight": overlap, "reach": reach, "text_floor": floor}
        settings = attrs.evolve(ours, ranking="key-and-text", **chosen)
        found.append({"settings": chosen} | {book.notes.name: summary(book.ours(settings)) for book in (one, other)})
        progress((number + 1) / len(grid))
    return found
