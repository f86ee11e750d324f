"""`memo report --compare A B`: settings that differ, rates with intervals, and differences over the same scenes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from memo_core.cli.main import main
from memo_core.errors import InvalidArgument
from memo_core.report.comparison import compare
from tests.report.test_methods_in_reports import SETTINGS, experiment, trial


def rewritten(folder: Path, rows: list[dict]) -> Path:
    (folder / "evaluation" / "trials.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    return folder


def scenes(successes, method="memo", task="oven", **more):
    return [trial(method, task, scene, success, **more) for scene, success in enumerate(successes)]


@pytest.fixture
def two(tmp_path):
    """Two evaluations: memo with another number of steps; in B it does one scene more of the oven."""
    a, b = experiment(tmp_path / "a"), experiment(tmp_path / "b", settings=SETTINGS | {"seed": 3})
    rewritten(a, scenes([1, 0, 0, 0]) + scenes([1, 1], task="can") + scenes([0, 0], "policy"))
    rewritten(b, scenes([1, 1, 0]) + scenes([1, 1], task="can") + scenes([1, 1], task="tin") + scenes([1, 0], "policy"))
    return a, b


def test_rates_stand_side_by_side_with_the_difference_over_the_scenes_that_both_have(two):
    found = compare(*two)
    rates = {(rate.method, rate.task): rate for rate in found.rates}
    oven = rates["memo", "oven"]
    assert (oven.book, oven.a.value, oven.b.value) == ("2 h", 0.25, pytest.approx(2 / 3))
    assert (oven.a.trials, oven.b.trials, oven.pairs) == (4, 3, 3)
    assert oven.difference.value == pytest.approx(1 / 3), "without A's fourth scene, which B has not tried"
    assert oven.difference.low >= 0.0, "scene by scene B is never worse"
    whole = rates["memo", "all"]
    assert (whole.a.trials, whole.b.trials, whole.pairs) == (6, 5, 5), "the tin is only in B"
    assert ("memo", "tin") not in rates
    assert (rates["policy", "oven"].book, rates["policy", "oven"].pairs) == ("", 2)


def test_what_differs_in_the_settings_is_listed_and_methods_are_matched_by_name(two, tmp_path):
    [difference] = compare(*two).differing
    assert difference == ("seed", None, 3)
    methods = {
        "evaluation": {"methods": [{"backend": "policy", "checkpoint": "base", "steps": 9}, {"backend": "memo"}]}
    }
    c = rewritten(experiment(tmp_path / "c", settings=SETTINGS | methods), scenes([1, 0], "policy"))
    (c / "evaluation" / "code").write_text("abc")
    found = dict((path, (a, b)) for path, a, b in compare(two[0], c).differing)
    assert found == {"evaluation.methods.policy.steps": (5, 9), "code of MEMO and plugins (digest)": (None, "abc")}


def test_the_same_hours_are_compared_and_other_books_are_named(tmp_path):
    a, b = experiment(tmp_path / "a"), experiment(tmp_path / "b")
    hours = [row for hour in (0.0, 2.0, 4.0) for row in scenes([hour > 2.0] * 2, hours=hour)]
    given = scenes([1, 1], given="/x/lessons.db", history=None, hours=None)
    rewritten(a, hours + given + scenes([1, 1], mode="corrected", hours=4.0))
    rewritten(b, scenes([1, 0]) + scenes([1, 0], hours=0.0) + given + scenes([1, 1], mode="corrected", hours=2.0))
    found = compare(a, b)
    assert {(rate.mode, rate.book) for rate in found.rates} == {("zero-shot", "2 h"), ("zero-shot", "lessons")}
    assert "memo corrected has no skillbook and task in common: 4 h in A, 2 h in B" in found.notes
    assert "memo zero-shot: both evaluations are at the ceiling, so that their rates separate nothing" in found.notes


def test_a_method_with_a_skillbook_in_one_and_without_in_the_other_is_not_compared(two):
    a, b = two
    without = {"memory": False, "history": None, "hours": None}
    rewritten(b, scenes([1, 1], **without) + scenes([1, 0], "policy"))
    found = compare(a, b)
    assert {rate.method for rate in found.rates} == {"policy"}
    assert "memo has a skillbook in A and none in B: these are not compared" in found.notes
    rewritten(b, scenes([1, 1], **without))
    with pytest.raises(InvalidArgument, match=r"nothing in common.*has a skillbook in A and none in B"):
        compare(a, b)


def test_scenes_of_another_suite_are_not_paired(two, tmp_path):
    other = experiment(tmp_path / "c", settings=SETTINGS | {"suite": {"backend": "workshop"}})
    found = compare(two[0], rewritten(other, scenes([1, 1])))
    assert all(rate.difference is None and rate.pairs == 0 for rate in found.rates)
    assert "no differences: the scenes of the suites kitchen and workshop are not the same" in found.notes


def test_what_cannot_be_compared_is_refused(two, tmp_path):
    a, b = two
    (tmp_path / "empty").mkdir()
    with pytest.raises(InvalidArgument, match=r"empty holds no evaluation; expected the --out of memo evaluate"):
        compare(a, tmp_path / "empty")
    with pytest.raises(InvalidArgument, match="twice"):
        compare(a, a.parent / "b" / ".." / "a")
    rewritten(b, scenes([1], task="lid"))
    with pytest.raises(InvalidArgument, match=r"nothing in common: .*memo zero-shot 2 h.* at oven, can.*at lid"):
        compare(a, b)
    rewritten(b, [])
    with pytest.raises(InvalidArgument, match=r"no trial of the evaluation in .*b is over"):
        compare(a, b)
    for damaged in ("[", "", "seed: 0"):
        (b / "evaluation" / "config.yaml").write_text(damaged)
        with pytest.raises(
            InvalidArgument, match=r"b/evaluation/config.yaml cannot be read .*as memo evaluate wrote it"
        ):
            compare(a, b)


def test_the_command_shows_both_and_prints_json(two, capsys):
    def shown(*arguments: str) -> str:
        with pytest.raises(SystemExit) as ended:
            main(["report", "--compare", *map(str, two), *arguments])
        assert not ended.value.code
        return capsys.readouterr().out

    text = shown()
    assert "seed" in text and "33 points" in text and " of 3\n" in text
    told = json.loads(shown("--json"))
    assert told["settings"] == [{"path": "seed", "a": None, "b": 3}]
    assert told["a"]["trials"] == 8 and {rate["task"] for rate in told["rates"]} == {"all", "oven", "can"}
    assert told["rates"][0]["difference"]["low"] is not None


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((), "DIR: missing; expected the folder of an experiment or a run, or --compare A B"),
        (("x", "--compare", "a", "b"), "--compare: stands alone; expected two folders"),
        (("--compare", "a", "b", "--films"), "--compare: stands alone"),
        (("--compare", "a", "b"), "--compare: a holds no evaluation"),
    ],
)
def test_wrong_arguments_of_the_command_are_one_line(arguments, said, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["report", *arguments])
    assert ended.value.code == 2 and said in capsys.readouterr().err
