"""What clustering does to a book with planted contradictions and repetitions (``memo bench clustering``).

The book and its labels come from ``memo_benchmarks.planted_book``, which shares no code with clustering.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

import attrs

from memo_benchmarks.planted_book import judge_book, plan_book, write_book
from memo_core.config import Experiment
from memo_core.runs.clustering import Spending, clustering_of
from memo_core.runs.factories import book_of
from memo_core.stop_switch import StopSwitch


@attrs.frozen
class ClusteringBench:
    """Shares are of statements; entries and characters are of all corrections and general statements."""

    model: str
    seed: int
    keys: int
    templates: int
    statements: int
    contradictions: int
    contradictions_gone: int
    gone_share: float
    rest: int
    rest_kept: int
    kept_share: float
    rest_in_template: int
    drop_covered: bool
    repetitions: int
    repetitions_left: int
    entries_before: int
    entries_after: int
    characters_before: int
    characters_after: int
    clusters: int
    left_as_they_were: int
    calls: int
    prompt_tokens: int
    completion_tokens: int
    cost: float | None
    missed: tuple[str, ...]
    problems: tuple[str, ...]


def bench_clustering(
    experiment: Experiment,
    keys: int,
    seed: int = 0,
    keep: Path | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> ClusteringBench:
    """Generate the book, cluster it with the experiment's model, and judge the result. ``keep``: a new folder for the
    book, questions and answers."""
    planted = plan_book(keys, seed)
    spending, outcomes = Spending(), []
    with tempfile.TemporaryDirectory() as scratch:
        folder = keep or Path(scratch) / "kept"
        folder.mkdir(parents=True)
        with book_of(experiment, f"sqlite:///{folder / 'book.db'}", read_only=False) as book:
            write_book(book, planted)
            before = [entry.text for entry in book.entries() if entry.kind != "template"]
            with clustering_of(experiment, book, spending.note, StopSwitch(), folder / "cluster") as clustering:
                model = clustering.model
                clusters = clustering.clusters()
                for cluster in clusters:
                    outcomes.append(clustering.condense(cluster))
                    progress(len(outcomes) / len(clusters))
            verdict = judge_book(book, planted)
            after = [entry.text for entry in book.entries() if entry.kind != "template"]
    problems = tuple(f"{one.cluster.label}: {one.problem}" for one in outcomes if one.problem)
    spent = spending.record()
    return ClusteringBench(
        model=model,
        seed=seed,
        keys=keys,
        drop_covered=experiment.section("clustering").drop_covered,
        templates=len(planted.templates),
        **attrs.asdict(verdict),
        gone_share=round(verdict.gone_share, 4),
        kept_share=round(verdict.kept_share, 4),
        entries_before=len(before),
        entries_after=len(after),
        characters_before=sum(map(len, before)),
        characters_after=sum(map(len, after)),
        clusters=len(outcomes),
        left_as_they_were=len(problems),
        problems=problems,
        **spent,
    )
