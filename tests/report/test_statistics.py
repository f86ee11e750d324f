"""Intervals follow histories and scenes, not single trials; the measures are those of rliable."""

from __future__ import annotations

import numpy as np
import pytest

from memo_core.report.statistics import (
    Interval,
    Outcomes,
    difference,
    interval,
    performance_profile,
    probability_of_improvement,
    wilson,
)


def rows(values, task="open", column="success"):
    """``values``: histories x scenes."""
    return [
        {"task": task, "history": history, "scene": scene, column: value}
        for history, row in enumerate(values)
        for scene, value in enumerate(row)
    ]


def test_the_mean_is_of_all_trials_and_repeated_ones_of_a_scene_are_averaged():
    outcomes = Outcomes.of([*rows([[1, 0], [1, 1]]), {"task": "open", "history": 0, "scene": 1, "success": 1}])
    assert outcomes.trials == 4 and outcomes.histories == 2
    assert outcomes.mean() == pytest.approx((1 + 0.5 + 1 + 1) / 4)


def test_histories_that_differ_make_a_wide_interval_however_many_scenes_there_are():
    by_history = Outcomes.of(rows([[1] * 50, [0] * 50, [1] * 50, [0] * 50]))
    alternating = [[(history + scene) % 2 for scene in range(50)] for history in range(4)]
    wide, narrow = interval([by_history]), interval([Outcomes.of(rows(alternating))])
    assert wide.value == narrow.value == 0.5
    assert wide.high - wide.low >= 0.9  # four histories say little, though there are 200 trials
    assert narrow.high - narrow.low < 0.35


def test_tasks_are_not_resampled():
    fixed = Outcomes.of([*rows([[1, 1], [1, 1]], "a"), *rows([[0, 0], [0, 0]], "b")])
    found = interval([fixed])
    assert (found.value, found.low, found.high) == (0.5, 0.5, 0.5)


def test_a_difference_is_one_of_the_same_histories_and_scenes():
    hard_scenes = [[1, 0, 1, 0, 1, 0, 1, 0]] * 3
    better = [[1, 1, 1, 0, 1, 0, 1, 0]] * 3
    paired = interval([Outcomes.of(rows(better)), Outcomes.of(rows(hard_scenes))], difference)
    assert paired.value == pytest.approx(1 / 8)
    assert paired.low >= 0.0 and paired.high < 0.5


def test_a_method_without_a_book_is_compared_with_one_that_has_several_histories():
    alone = [row | {"history": None} for row in rows([[0, 0, 0]])]
    found = interval([Outcomes.of(rows([[1, 1, 1], [1, 1, 1]])), Outcomes.of(alone)], difference)
    assert (found.value, found.low, found.high) == (1.0, 1.0, 1.0)


def test_probability_of_improvement_counts_draws_half():
    x, y = Outcomes.of(rows([[1, 1, 0, 0]])), Outcomes.of(rows([[1, 0, 0, 0]]))
    # of 16 pairs: 2 x 3 better, 2 x 1 worse is none; equal: 2 x 1 + 2 x 3
    assert probability_of_improvement(x, y) == pytest.approx((6 + 0.5 * 8) / 16)
    assert probability_of_improvement(y, x) == pytest.approx(1 - (6 + 0.5 * 8) / 16)


def test_a_profile_is_the_share_of_tasks_and_histories_above_each_threshold():
    outcomes = Outcomes.of([*rows([[1, 1], [1, 0]], "a"), *rows([[0, 0], [0, 1]], "b")])
    assert performance_profile(outcomes, np.array([0.0, 0.5, 0.99])) == pytest.approx([0.75, 0.25, 0.25])


def test_nothing_gives_no_number():
    assert interval([Outcomes.of([])]).text() == "-"
    alone = interval([Outcomes.of([*rows([[1]], "a"), *rows([[0]], "b")])])
    assert alone.text() == "50 %" and np.isnan(alone.low)  # one history and one scene cannot be resampled
    assert Interval(0.4, 0.2, 0.6, trials=5).text() == "40 % (20 to 60)"


def test_wilson_intervals_are_those_of_the_textbook():
    found = wilson(5, 16)
    assert (round(found.value, 4), round(found.low, 2), round(found.high, 2)) == (0.3125, 0.14, 0.56)
    assert wilson(0, 8).low == 0.0 and round(wilson(0, 8).high, 2) == 0.32
    assert np.isnan(wilson(0, 0).value)
