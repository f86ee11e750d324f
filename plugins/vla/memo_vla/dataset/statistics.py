"""Statistics of columns as LeRobot keeps them: of each episode, and of all of them together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from memo_vla.dataset.video import PictureStatistics

_QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

Statistics = dict[str, dict[str, Any]]  # column -> name of the statistic -> nested lists


def of_numbers(rows: np.ndarray) -> dict[str, Any]:
    """Statistics of each value of a column.

    Args:
        rows: shape (T, D) or (T,).

    Returns:
        ``min``, ``max``, ``mean``, ``std`` and quantiles as lists of D values, and ``count``.
    """
    return _statistics(rows.reshape(len(rows), -1), len(rows))


def of_pictures(pictures: PictureStatistics) -> dict[str, Any]:
    """The same of each colour, from 0 to 1, nested as (3, 1, 1); ``count`` is the number of frames looked at."""
    found = _statistics(pictures.pixels, pictures.frames)
    return {name: one if name == "count" else [[[value]] for value in one] for name, one in found.items()}


def _statistics(rows: np.ndarray, count: int) -> dict[str, Any]:
    rows = rows.astype(float)
    plain = {"min": rows.min(axis=0), "max": rows.max(axis=0), "mean": rows.mean(axis=0), "std": rows.std(axis=0)}
    quantiles = dict(zip(_QUANTILES, np.quantile(rows, list(_QUANTILES.values()), axis=0), strict=True))
    return {name: one.tolist() for name, one in (plain | quantiles).items()} | {"count": [count]}


def together(episodes: Sequence[Statistics]) -> Statistics:
    """Statistics of all episodes: exact for minimum, maximum, mean and deviation; quantiles are the means of the
    episodes' own, weighted by their counts, as LeRobot's are."""
    return {column: _together([one[column] for one in episodes]) for column in episodes[0]}


def _together(parts: Sequence[dict[str, Any]]) -> dict[str, Any]:
    counts = np.array([one["count"][0] for one in parts], dtype=float)
    weights = counts / counts.sum()

    def stacked(name: str) -> np.ndarray:
        return np.array([one[name] for one in parts], dtype=float)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.tensordot(weights, values, axes=1)

    middle = mean(stacked("mean"))
    spread = np.sqrt(mean(stacked("std") ** 2 + (stacked("mean") - middle) ** 2))
    found = {"min": stacked("min").min(axis=0), "max": stacked("max").max(axis=0), "mean": middle, "std": spread}
    found |= {name: mean(stacked(name)) for name in _QUANTILES}
    return {name: one.tolist() for name, one in found.items()} | {"count": [int(counts.sum())]}
