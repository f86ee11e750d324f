"""The loop and its log: a run that broke off at any effect is the same loop run again, and says what it cannot know."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from memo_core.errors import InvalidArgument
from memo_core.interfaces.teacher import Episode, Verdict
from memo_core.runlog.log_file import read_lines
from memo_core.runlog.log_history import read_history
from memo_core.runlog.run_log import RunLog
from memo_core.testing.fake_environment import FakeEnvironment
from tests.support.loop_setup import BESIDE, GRASP, NO, NOTES, SAID, TEMPLATE, YES, Bench

TWICE = {"plan": ["PICK_UP(red cube)", "DONE"], "code": [BESIDE, GRASP], "feedback": [NOTES], "template": [TEMPLATE]}


def by_hand() -> FakeEnvironment:
    """An environment whose world cannot be put back by itself, as with hardware."""
    environment = FakeEnvironment()
    environment.link.can_restore = False
    return environment


def log_in(folder: Path) -> RunLog:
    """The log of a run that begins, or of one that was cut off."""
    resumed = (folder / "log.jsonl").exists()
    log = RunLog(folder, read_history(folder, read_lines(folder).records) if resumed else None)
    log.begin({"run": "run-1"}, {})
    return log


def cut_after(folder: Path, text: str) -> None:
    """The log as a process leaves it that is killed right after it wrote a line with this text."""
    lines = (folder / "log.jsonl").read_text().splitlines(keepends=True)
    last = next(number for number, line in enumerate(lines) if text in line)
    (folder / "log.jsonl").write_text("".join(lines[: last + 1]))


@pytest.mark.process
def test_what_hardware_did_before_a_crash_is_never_repeated_but_confirmed_and_planned_anew(sandbox, book, tmp_path):
    Bench(sandbox, book, TWICE, [NO, YES], environment=by_hand(), session={"log": log_in(tmp_path)}).run()
    cut_after(tmp_path, '"begin": "execute"')
    asked: list[Episode] = []

    def confirm(episode: Episode) -> bool:
        asked.append(episode)
        return True

    script = {"plan": ["PICK_UP(red cube)", "DONE"], "code": [GRASP], "template": [TEMPLATE]}
    again = by_hand()
    session = {"log": log_in(tmp_path), "confirm": confirm}
    bench = Bench(sandbox, book, script, [YES], environment=again, session=session)
    first, second = bench.run().subtasks
    assert (first.status, second.status) == ("unobserved", "approved")
    assert [episode.subtask for episode in asked] == ["PICK_UP(red cube)"]
    assert "unknown" in bench.llm.prompts("plan")[0], "the planner is told"
    assert again.control.commands.count("close_gripper") == 1, "only the code that was written anew has run"


@pytest.mark.parametrize("confirm", [None, lambda episode: False])
def test_where_nobody_confirms_the_scene_the_run_does_not_go_on(sandbox, book, tmp_path, confirm):
    Bench(sandbox, book, TWICE, [NO, YES], environment=by_hand(), session={"log": log_in(tmp_path)}).run()
    cut_after(tmp_path, '"begin": "execute"')
    again = by_hand()
    session = {"log": log_in(tmp_path), "confirm": confirm}
    bench = Bench(sandbox, book, TWICE, [YES], environment=again, session=session)
    with pytest.raises(InvalidArgument, match=r"PICK_UP\(red cube\) before the interruption is in doubt"):
        bench.run()
    assert not again.control.commands


def test_a_run_without_a_book_keeps_words_in_one_file_a_person_and_the_log_has_their_number(sandbox, tmp_path):
    script = TWICE | {"feedback": []}
    session = {"log": log_in(tmp_path)}
    Bench(sandbox, None, script, [NO, Verdict("approve", "well done")], method="memo-s", session=session).run()
    kept = [json.loads(line) for line in (tmp_path / "words" / "ana.jsonl").read_text().splitlines()]
    assert [line["words"] for line in kept] == [SAID, "well done"]
    assert (
        "well done" not in (tmp_path / "log.jsonl").read_text() and "über" not in (tmp_path / "log.jsonl").read_text()
    )
    cut_after(tmp_path, '"begin": "restore"')
    bench = Bench(sandbox, None, {}, [YES], method="memo-s", session={"log": log_in(tmp_path)})
    assert not bench.run().finished  # this model has no answer
    assert SAID.strip() in bench.llm.prompts("code")[0], "the words of before the crash are in the next prompt"
    os.unlink(tmp_path / "words" / "ana.jsonl")
    with pytest.raises(InvalidArgument, match="were withdrawn"):
        Bench(sandbox, None, {}, [YES], method="memo-s", session={"log": log_in(tmp_path)}).run()
