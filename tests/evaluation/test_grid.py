"""The grid of an evaluation: each trial once, with a name of its own."""

from __future__ import annotations

from collections import Counter

import pytest

from memo_core.config import ConfigErrors, load_experiment
from memo_core.errors import InvalidArgument, UnknownName
from memo_core.evaluation.books import book_key
from memo_core.evaluation.grid import trials_of
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.plugins.registry import Registry


def grid(*overrides: str, histories: int = 2):
    experiment = load_experiment(Registry(), None, ["suite.backend=tabletop", *overrides], ALL_SECTIONS)
    return trials_of(experiment, histories)


def test_the_grid_is_methods_hours_tasks_scenes_and_histories():
    trials = grid("evaluation.hours=[0, 2, 10]", "evaluation.scenes=3")
    zero_shot = [trial for trial in trials if trial.mode == "zero-shot"]
    assert len({trial.id for trial in trials}) == len(trials)
    assert Counter(trial.method for trial in zero_shot) == {
        "memo": 5 * 3 * 3 * 2,
        "memo-c": 5 * 3 * 3 * 2,
        "droc-v": 5 * 3 * 3 * 2,
        "memo-s": 5 * 3,  # it has no book
    }
    corrected = [trial for trial in trials if trial.mode == "corrected"]
    assert {trial.hours for trial in corrected} == {10.0, None}
    assert len({trial.scene for trial in trials}) == 3 and min(trial.scene for trial in trials) == 1_000_000


def test_ablations_are_of_the_largest_book_of_memo():
    trials = grid("evaluation.hours=[0, 2]", "evaluation.ablations=[nonsense, paper-preset, no-read-back]")
    ablated = [trial for trial in trials if trial.ablation]
    assert {(trial.method, trial.hours, trial.mode) for trial in ablated} == {("memo", 2.0, "zero-shot")}
    files = {trial.ablation: book_key(trial).file for trial in ablated if trial.history == 0}
    assert files == {
        "nonsense": "history-0/memo-h2-nonsense.db",
        "paper-preset": "history-0/memo-h2.db",
        "no-read-back": "history-0/memo-h2-no-read-back.db",
    }


def test_given_books_need_no_study():
    trials = grid("evaluation.hours=[]", "evaluation.books=[other.db]", "evaluation.methods=[memo]", histories=0)
    assert {(trial.given, trial.history) for trial in trials} == {("other.db", None)}


def test_what_does_not_exist_is_refused():
    with pytest.raises(ConfigErrors, match=r"evaluation\.methods\[0\].*memo-x.*did you mean"):
        grid("evaluation.methods=[memo-x]")
    with pytest.raises(UnknownName, match="open-the-door"):
        grid("evaluation.tasks=[open-the-door]")
    with pytest.raises(ConfigErrors, match="nonsens"):
        grid("evaluation.ablations=[nonsens]")
    with pytest.raises(InvalidArgument, match=r"3 is none of evaluation\.hours"):
        grid("evaluation.corrected.hours=[3]")
