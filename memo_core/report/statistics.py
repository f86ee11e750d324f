"""Success rates with intervals that do not take trials for independent.

Trials of one teaching history share its books, and trials of one scene share the scene, so both are resampled:
histories with replacement, and within each task its scenes with replacement (a bootstrap of crossed random effects:
A. B. Owen, "The pigeonhole bootstrap", Annals of Applied Statistics 1(2), 2007). Probability of improvement and
performance
profiles are those of R. Agarwal et al., "Deep reinforcement learning at the edge of the statistical precipice",
NeurIPS 2021 (rliable)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from statistics import NormalDist
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from memo_core.errors import InvalidArgument
from memo_core.evaluation.table import has_memory

Scores = NDArray[np.float64]
Draw = tuple[NDArray[np.int64], dict[str, NDArray[np.int64]]]
RESAMPLES = 1000
LEVEL = 0.95


@attrs.frozen
class Interval:
    """An estimate with its bootstrap interval (percentiles at 95 %); NaN where there is nothing. A single history and a
    single scene of each task cannot be resampled: then the limits alone are NaN."""

    value: float
    low: float
    high: float
    trials: int = 0

    def text(self, scale: float = 100.0, digits: int = 0, unit: str = " %") -> str:
        """As a table shows it: ``40 % (20 to 60)``."""
        if np.isnan(self.value):
            return "-"
        value, low, high = (f"{scale * one:.{digits}f}" for one in (self.value, self.low, self.high))
        if np.isnan(self.low):
            return f"{value}{unit}"
        return f"{value}{unit} ({low} to {high})"


def poolable(rows: Iterable[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The rows, which may be averaged: all are with a skillbook, or all are without. Raises ``InvalidArgument``."""
    listed = list(rows)
    if len({has_memory(row) for row in listed}) > 1:
        problem = "some are of a method with a skillbook, some of one without; these are never averaged together"
        raise InvalidArgument("rows", problem, "rows of one kind")
    return listed


@attrs.frozen(eq=False)
class Outcomes:
    """One number a trial, by task: an array of histories x scenes. A method without a book has one history."""

    by_task: dict[str, Scores]

    @classmethod
    def of(cls, rows: Iterable[dict[str, Any]], column: str = "success") -> Outcomes:
        """Make outcomes of rows of an evaluation's table; trials of one scene are averaged, missing ones are NaN.
        Raises ``InvalidArgument`` for rows with and without a skillbook together."""
        cells: dict[str, dict[tuple[Any, int], list[float]]] = {}
        for row in poolable(rows):
            cells.setdefault(row["task"], {}).setdefault((row["history"], row["scene"]), []).append(float(row[column]))
        histories = sorted({key[0] for cell in cells.values() for key in cell}, key=lambda one: (one is not None, one))
        made = {}
        for task, cell in cells.items():
            scenes = sorted({scene for _, scene in cell})
            empty = [np.nan]
            made[task] = np.array(
                [[np.mean(cell.get((history, scene), empty)) for scene in scenes] for history in histories]
            )
        return cls(made)

    @property
    def trials(self) -> int:
        return sum(int(np.isfinite(scores).sum()) for scores in self.by_task.values())

    @property
    def histories(self) -> int:
        return max((len(scores) for scores in self.by_task.values()), default=0)

    def mean(self) -> float:
        """Over all trials."""
        return _mean(self.by_task.values())

    def drawn(self, draw: Draw) -> Outcomes:
        """The outcomes as if other histories and scenes had come up."""
        rows, columns = draw
        made = {}
        for task, scores in self.by_task.items():
            picked = scores[rows % len(scores)]  # one history is always itself
            made[task] = picked[:, columns[task][columns[task] < scores.shape[1]]]
        return Outcomes(made)


def interval(
    outcomes: Sequence[Outcomes],
    statistic: Callable[..., float] = Outcomes.mean,
    seed: int = 0,
    resamples: int = RESAMPLES,
) -> Interval:
    """``statistic(*outcomes)`` with its interval. All are drawn alike, so that a difference of two methods is one of
    the same histories and scenes."""
    trials = sum(one.trials for one in outcomes)
    if not trials or any(one.trials == 0 for one in outcomes):
        return Interval(float("nan"), float("nan"), float("nan"), trials)
    rng = np.random.default_rng(seed)
    histories = max(one.histories for one in outcomes)
    scenes: dict[str, int] = {}
    for one in outcomes:
        for task, scores in one.by_task.items():
            scenes[task] = max(scenes.get(task, 0), scores.shape[1])
    if histories < 2 and max(scenes.values()) < 2:
        return Interval(float(statistic(*outcomes)), float("nan"), float("nan"), trials)
    found = []
    for _ in range(resamples):
        rows = rng.integers(histories, size=histories)
        columns = {task: rng.integers(count, size=count) for task, count in scenes.items()}
        found.append(statistic(*(one.drawn((rows, columns)) for one in outcomes)))
    low, high = np.nanquantile(found, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return Interval(float(statistic(*outcomes)), float(low), float(high), trials)


def wilson(successes: int, trials: int) -> Interval:
    """The rate of independent trials with its Wilson score interval (E. B. Wilson, "Probable inference, the law of
    succession, and statistical inference", JASA 22(158), 1927); NaN without trials."""
    if not trials:
        return Interval(float("nan"), float("nan"), float("nan"))
    z = NormalDist().inv_cdf((1 + LEVEL) / 2)
    rate, n = successes / trials, trials
    middle = (rate + z**2 / (2 * n)) / (1 + z**2 / n)
    half = z / (1 + z**2 / n) * (rate * (1 - rate) / n + z**2 / (4 * n**2)) ** 0.5
    return Interval(rate, max(middle - half, 0.0), min(middle + half, 1.0), trials)


def difference(one: Outcomes, other: Outcomes) -> float:
    """How much larger the mean of the first is."""
    return one.mean() - other.mean()


def probability_of_improvement(one: Outcomes, other: Outcomes) -> float:
    """The chance that a trial of the first comes out better than one of the other, on the mean of the tasks that both
    have; a draw counts half."""
    found = []
    for task in one.by_task.keys() & other.by_task.keys():
        x, y = (scores[np.isfinite(scores)] for scores in (one.by_task[task], other.by_task[task]))
        if len(x) and len(y):
            found.append(float(np.mean((x[:, None] > y) + 0.5 * (x[:, None] == y))))
    return float(np.mean(found)) if found else float("nan")


def performance_profile(outcomes: Outcomes, thresholds: Scores) -> Scores:
    """For each threshold, the share of tasks and histories whose mean over scenes is greater."""
    means = [np.nanmean(row) for scores in outcomes.by_task.values() for row in scores if np.isfinite(row).any()]
    return np.array([np.mean(np.array(means) > threshold) if means else np.nan for threshold in thresholds])


def _mean(scores: Iterable[Scores]) -> float:
    values = np.concatenate([one.ravel() for one in scores] or [np.array([])])
    values = values[np.isfinite(values)]
    return float(values.mean()) if len(values) else float("nan")
