"""What ``memo bench drawer`` makes of a run's events; the runs themselves take minutes."""

from __future__ import annotations

import math

import attrs
import pytest
from memo_benchmarks import drawer
from memo_benchmarks.drawer import Attempt, Heard, _Watch, sayings_in, summary

from memo_core.cli.main import main
from memo_core.errors import InvalidArgument
from memo_core.events import SkillCalled

GRIP = [0.6, 0.0, 0.2]
DOWN = [0.0, 1.0, 0.0, 0.0]
LINE = [[[0.6 - 0.02 * n, 0.0, 0.2], DOWN] for n in range(1, 8)]
ARC = [[[0.6 - 0.3 * math.sin(a / 10), 0.3 * (1 - math.cos(a / 10)), 0.2], DOWN] for a in range(1, 15)]


def shape(path: list, error: str = "") -> str:
    watch = _Watch()
    approach = SkillCalled("move_straight", {"position": GRIP})
    led = SkillCalled("follow_path", {"path": path, "then": None}, error=error)
    for event in (approach, SkillCalled("close_gripper", {}), led, SkillCalled("open_gripper", {}), approach):
        watch.heard(event)
    return watch.shape


def test_the_way_with_the_handle_is_a_line_or_an_arc():
    assert (shape(LINE), shape(ARC)) == ("straight", "arc")
    assert (shape(LINE, "MotionError"), shape(ARC, "MotionError")) == ("straight failed", "arc failed")


def test_the_summary_counts_what_was_served_and_what_opened():
    lesson = ("correction OPEN(microwave): Lead it along an arc.",)
    arc, straight, door = Attempt(lesson, "arc", False), Attempt((), "straight", True), Attempt(lesson, "arc", True)
    doors = {"fridge": door, "oven": door}
    counted = summary([Heard(0, "it slides", ("a note",), arc, straight, straight, doors, doors | {"oven": arc})])
    names = ("before_opened", "retry_opened", "later_straight", "fridge_opened", "oven_before_opened", "oven_opened")
    assert [counted[name] for name in names] == [0, 1, 1, 1, 1, 0]
    assert counted["before_served_the_lesson"] == 1 and counted["later_served_the_lesson"] == 0


def test_the_command_prints_a_row_a_sentence_and_the_summary(tmp_path, capsys, monkeypatch):
    failed, door = Attempt((), "arc failed", False), Attempt((), "straight", True)
    heard = Heard(0, "it slides", (), failed, door, door, {}, {"fridge": failed, "oven": door})
    monkeypatch.setattr(drawer, "bench_drawer", lambda *given: [attrs.evolve(heard, doors_before=heard.doors)])
    (tmp_path / "said.txt").write_text("it slides\n")
    with pytest.raises(SystemExit) as ended:
        main(["bench", "drawer", str(tmp_path / "said.txt"), "--out", str(tmp_path)])
    assert not ended.value.code
    shown = capsys.readouterr().out
    assert "it slides" in shown and "arc failed, shut" in shown and "straight, opened" in shown and "oven" in shown


def test_a_file_without_sentences_is_refused(tmp_path):
    (tmp_path / "none.txt").write_text("\n\n")
    for name in ("none.txt", "missing.txt"):
        with pytest.raises(InvalidArgument, match=name):
            sayings_in(tmp_path / name)
