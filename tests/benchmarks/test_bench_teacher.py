"""The table of a teacher's verdicts against the success checks, on a task with a plain attempt and one without."""

from __future__ import annotations

import json

import pytest
from memo_benchmarks.teacher import AGREEMENT, Watched, bench_teacher, judge

from memo_core.cli.main import main
from memo_core.cli.options import load
from memo_core.errors import UnknownName
from memo_core.interfaces.teacher import Teacher, Verdict
from memo_core.testing.teacher import task_episodes


def test_what_was_watched_is_judged_beside_the_success_check(capsys):
    with pytest.raises(SystemExit) as ended:
        main(
            [
                "bench",
                "teacher",
                "turn-on-the-faucet",
                "turn-on-the-heater",
                "--suite",
                "tabletop",
                "--suite",
                "quirks",
                "--json",
            ]
        )
    told = json.loads(capsys.readouterr().out)
    assert ended.value.code == 0
    found = {(row["task"], row["behaviour"]): (row["success"], row["verdict"]) for row in told["verdicts"]}
    assert found == {
        ("turn-on-the-faucet", "reference"): (True, "approve"),
        ("turn-on-the-faucet", "nothing"): (False, "correct"),
        ("turn-on-the-heater", "reference"): (True, "approve"),
        ("turn-on-the-heater", "plain"): (False, "correct"),
        ("turn-on-the-heater", "nothing"): (False, "correct"),
    }
    assert told["counts"] == {"agrees": 5}
    assert all(row["task"].rsplit("-", 1)[1] in row["words"] for row in told["verdicts"] if row["words"])


class Says(Teacher):
    def __init__(self, kind):
        self.kind = kind

    def judge(self, episode):
        raise AssertionError("the whole task is judged")

    def judge_task(self, episode):
        return Verdict(self.kind, "no" if self.kind == "correct" else "")


@pytest.mark.parametrize("kind", ["approve", "correct", "silent"])
@pytest.mark.parametrize("success", [True, False])
def test_every_disagreement_has_a_name(kind, success):
    watched = Watched("a task", 0, "plain", task_episodes()[0], success, "why")
    row = judge(watched, Says(kind))
    assert row.agreement == AGREEMENT[kind, success]
    assert (row.agreement == "agrees") == ((kind, success) in {("approve", True), ("correct", False)})


def test_an_unknown_task_is_named_before_anything_runs():
    experiment = load(None, ["teacher=simulated"])[1]
    with pytest.raises(UnknownName, match="turn-on-the-faucte"):
        bench_teacher([experiment], ["turn-on-the-faucte"], [0])
