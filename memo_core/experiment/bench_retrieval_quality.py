"""``memo bench retrieval-quality``: what retrieval serves, against labels that no retrieval code uses.

Settings are swept on one half of the subtasks and reported on the other; the halves share neither objects nor, but for
the commonest, verbs. Only corrections are looked at; templates follow the same rule.
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

from memo_core.experiment.labelled_book import HALVES, Meaning, Query, fill, grade, queries, undoes
from memo_core.interfaces.embedder import Embedder
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.keys import Key
from memo_core.skillbook.retrieval import RetrievalSettings

AUTHORS = RetrievalSettings(
    lambda_action=0.75,
    lambda_objects=0.25,
    cut=0.8,
    corrections=20,
    general=10,
    action_phrase="{}",
    object_phrase="{}",
    shipped_actions=False,
)
WORDINGS = (
    ("{}", "{}"),
    ("to {} an object with a robot arm", "to use a {} with a robot arm"),
    ("to {} something", "a {}"),
    ("to {} an object with a robot arm", "a {}"),
    ("to {} an object with a robot arm", "how a {} is built and handled"),
)
SHARES = (0.9, 0.75, 0.6, 0.5, 0.35, 0.2)  # λ1 of λ1 + λ2
CUTS = tuple(round(0.5 + 0.025 * n, 3) for n in range(20))

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


@attrs.frozen
class Measured:
    """The labelled book under one setting, cut aside: what each subtask would be served, best first."""

    ranked: list[list[tuple[float, int, bool]]]  # r, grade, whether it is an opposite
    ideal: list[list[int]]

    def rows(self, cut: float, k: int) -> list[One]:
        judged = []
        for ranked, ideal in zip(self.ranked, self.ideal, strict=True):
            served = [(gain, against) for r, gain, against in ranked[:k] if r >= cut - 1e-6]
            judged.append(judge([gain for gain, _ in served], sum(against for _, against in served), ideal, k))
        return judged


def summary(rows: Sequence[One]) -> Row:
    """Means over subtasks; ``opposites`` counts entries, ``subtasks_with_opposites`` subtasks."""
    return {
        "f1": _mean([row.f1 for row in rows]),
        "recall": _mean([row.recall for row in rows]),
        "precision": _mean([row.precision for row in rows]),
        "ndcg": _mean([row.ndcg for row in rows]),
        "opposites": sum(row.opposites for row in rows),
        "subtasks_with_opposites": sum(row.opposites > 0 for row in rows),
        "served_nothing": sum(row.precision is None for row in rows),
    }


class LabelledBook:
    """The labelled book on disk, asked under any settings."""

    def __init__(self, path: Path, embedder: Embedder, make_store: Callable[[], VectorStore]) -> None:
        self._path, self._embedder, self._make_store = path, embedder, make_store
        with Skillbook(str(path), embedder) as book:
            self._meanings: dict[Key, Meaning] = fill(book)
            self.entries = len(book.entries())
        self.keys = len(self._meanings)
        self._per_key: dict[Key, int] = {}
        with Skillbook(str(path)) as book:
            for entry in book.entries():
                self._per_key[entry.key] = self._per_key.get(entry.key, 0) + 1

    def measure(self, settings: RetrievalSettings, asked: Sequence[Query]) -> Measured:
        """With the cut and the limits of ``settings`` as they are."""
        ranked, ideal = [], []
        with Skillbook(str(self._path), self._embedder, self._make_store(), settings) as book:
            for query in asked:
                served = book.retrieve(query.subtask).corrections
                about = [self._meanings[one.entry.key] for one in served]
                ranked.append(
                    [
                        (one.score, grade(query.meaning, m), undoes(query.meaning, m))
                        for one, m in zip(served, about, strict=True)
                    ]
                )
                every = [
                    grade(query.meaning, meaning)
                    for key, meaning in self._meanings.items()
                    for _ in range(self._per_key[key])
                ]
                ideal.append(sorted(every, reverse=True))
        return Measured(ranked, ideal)


def bench_retrieval_quality(
    embedder: Embedder,
    make_store: Callable[[], VectorStore],
    settings: RetrievalSettings | None = None,
    sweep: bool = True,
    progress: Callable[[float], None] = lambda share: None,
) -> Row:
    """The authors' settings and ours on both halves; with ``sweep`` also wordings, weights and cuts on the half
    "choose", and the best of those (largest mean f1 with no opposite served) on the half "report"."""
    ours = settings or RetrievalSettings()
    asked = {half: queries(half) for half in HALVES}
    with tempfile.TemporaryDirectory(prefix="memo-bench-") as folder:
        embedder.open()
        book = LabelledBook(Path(folder) / "book.db", embedder, make_store)
        compared = {
            "authors": AUTHORS,
            "authors, opposites and synonyms kept apart": attrs.evolve(AUTHORS, shipped_actions=True),
            "ours": ours,
            "ours, no tables": attrs.evolve(ours, shipped_actions=False),
        }
        swept = _sweep(book, ours, asked["choose"], progress) if sweep else []
        if swept:
            best = max(
                (row for row in swept if row["choose"]["opposites"] == 0),
                key=lambda row: (row["choose"]["f1"], row["choose"]["ndcg"]),
            )
            compared["best of the sweep"] = attrs.evolve(ours, **best["settings"])
        return {
            "entries": book.entries,
            "keys": book.keys,
            "queries": {half: len(found) for half, found in asked.items()},
            "k": {"corrections": ours.corrections},
            "embedder": embedder.name,
            "compared": [_compared(book, name, one, asked) for name, one in compared.items()],
            "sweep": swept,
        }


def _compared(book: LabelledBook, name: str, settings: RetrievalSettings, asked: dict[Any, list[Query]]) -> Row:
    halves: Row = {}
    for half, found in asked.items():
        measured = book.measure(settings, found)
        halves[half] = summary(measured.rows(settings.cut, settings.corrections))
        halves[half] |= {f"{name}@5": value for name, value in _at_5(measured, settings).items()}
    return {"name": name, "settings": _of(settings), **halves}


def _at_5(measured: Measured, settings: RetrievalSettings) -> Row:
    found = summary(measured.rows(settings.cut, 5))
    return {name: found[name] for name in ("recall", "precision", "ndcg")}


def _of(settings: RetrievalSettings) -> Row:
    names = ("lambda_action", "lambda_objects", "cut", "action_phrase", "object_phrase")
    return {name: getattr(settings, name) for name in names}


def _sweep(
    book: LabelledBook, ours: RetrievalSettings, asked: list[Query], progress: Callable[[float], None]
) -> list[Row]:
    """Every wording, weight and cut. Entries come in order of r and the cut takes the first ones, so one retrieval
    without a cut tells what each cut would serve."""
    found, pairs = [], list(itertools.product(WORDINGS, SHARES))
    for n, ((action, thing), share) in enumerate(pairs):
        weights: Row = {"lambda_action": share, "lambda_objects": round(1 - share, 3)}
        wording: Row = {"action_phrase": action, "object_phrase": thing}
        measured = book.measure(attrs.evolve(ours, cut=-1.0, **weights, **wording), asked)
        for cut in CUTS:
            row = summary(measured.rows(cut, ours.corrections))
            found.append({"settings": weights | wording | {"cut": cut}, "choose": row})
        progress((n + 1) / len(pairs))
    return found
