"""A demo in which rules are told before its runs: taught on one thing, followed on another, changed later."""

from __future__ import annotations

import pytest

from memo_core.cli.options import load
from memo_core.demo.result import CHAPTERS, chapters_of
from memo_core.demo.running import run_demo
from memo_core.interfaces.backend import Demo, DemoRun
from memo_core.runs.record_replay import replayed, shipped


def test_a_demo_without_runs_of_its_own_has_the_four_with_a_teacher():
    assert chapters_of(Demo(taught="a", transfer="b")) == CHAPTERS
    [only] = chapters_of(Demo(taught="a", transfer="b", runs=(DemoRun("told", "Told", "b", True),)))
    assert (only.name, only.folder, only.expected) == ("told", "1-told", True)


@pytest.mark.sim
@pytest.mark.process
@pytest.mark.slow
def test_the_recorded_rule_is_followed_on_another_thing_and_replaced_by_a_newer_one(tmp_path):
    registry, experiment = load(None, ["suite.backend=house-rules", "run.repairs=1", "run.video=off"])
    recording, seed = shipped(experiment)
    assert seed == 0
    report = run_demo(replayed(experiment, registry, recording, match="situation"), registry, tmp_path)
    assert report.told, report.why()
    assert list(report.runs) == ["untold", "told", "older_rule", "newer_rule"]
    assert "Plastic things go in the blue crate from now on" in report.page.read_text(encoding="utf-8")
