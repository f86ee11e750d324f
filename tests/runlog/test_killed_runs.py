"""A run that is killed (SIGKILL) at any line of its log, and resumed, comes to what it would have come to."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

SAME = ("reason", "subtasks", "robot_s", "spent", "holding", "drawn", "feedback", "entries")


def runs(folder: Path, *arguments: str) -> tuple[dict, list[dict]]:
    """The run that was left alone, and those that were killed."""
    program = Path(__file__).with_name("killed_run.py")
    done = subprocess.run(
        [sys.executable, str(program), str(folder), *arguments],
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr
    whole, *killed = (json.loads(line) for line in done.stdout.splitlines())
    return whole, killed


def events(run: dict) -> Counter[str]:
    """What was sent, but for the calls of skills: code that was cut short runs again, and is heard again."""
    repeated = ("SkillStarted", "SkillCalled", "ModelAsked", "QuestionAsked")  # of what was interrupted
    return Counter(line for line in run["events"] if json.loads(line)["event"] not in repeated)


@pytest.mark.timeout(600)
def test_killed_at_every_line_of_its_log_a_run_ends_as_if_it_had_been_left_alone(tmp_path):
    whole, killed = runs(tmp_path, os.environ.get("MEMO_TEST_KILLS", "some"))
    assert whole["subtasks"][0]["status"] == "approved" and len(whole["entries"]) == 3
    assert {run["line"] for run in killed} == set(range(3, whole["lines"] + 1))
    for run in killed:
        at = (run["line"], run["when"])
        assert {name: run[name] for name in SAME} == {name: whole[name] for name in SAME}, at
        assert events(run) == events(whole), at
        assert Counter(run["answered"]) == Counter(whole["answered"]), "each answer is kept, and none twice"
        lost = Counter(run["asked"]) - Counter(run["answered"])  # the answer was under way when the process died
        assert Counter(run["asked"]) - Counter(whole["asked"]) <= lost and lost.total() <= 1, at
