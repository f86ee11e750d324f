"""A person takes part in a study at a real terminal, from the consent to the export."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.pseudo_terminal import PseudoTerminal

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="pseudo terminals"),
    pytest.mark.process,
    pytest.mark.slow,
]

FILE = """
llm: offline
suite: quirks
simulator: SIMULATOR
run: {video: "off", pace: "PACE"}
study:
  tasks: [open-the-cupboard]
  participants: [{id: P01, teacher: {backend: terminal}}]
  rounds: 1
  session_minutes: MINUTES
  clock: real
  consent: consent.txt
"""
CONSENT = "Words go to the provider of the language model. You may withdraw at any time."
MEMO = (sys.executable, "-m", "memo_core.cli.main")
RUN = (*MEMO, "study", "run", "study.yaml", "--out", "out")
QUESTIONS = ("Your age", "Your gender", "with robots", "with language models")
AT_WORK = "close_gripper"  # in the middle of the program

Start = Callable[..., PseudoTerminal]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Start a command at a terminal, in a folder with the files of a study."""
    opened: list[PseudoTerminal] = []

    def begin(
        *command: str, minutes: float = 30, simulator: str = "mujoco", pace: str = "auto", **given: object
    ) -> PseudoTerminal:
        text = FILE.replace("MINUTES", str(minutes)).replace("SIMULATOR", simulator).replace("PACE", pace)
        (tmp_path / "study.yaml").write_text(text)
        (tmp_path / "consent.txt").write_text(CONSENT)
        opened.append(PseudoTerminal(*command, cwd=tmp_path, **given))  # type: ignore[arg-type]
        return opened[-1]

    yield begin
    for one in opened:
        one.close()


def answer(there: PseudoTerminal, question: str, words: str) -> None:
    assert there.wait_for_next(question, 60) and there.wait_for_next(">"), there.unread
    there.type(f"{words}\r")


def introduce(there: PseudoTerminal) -> None:
    answer(there, "type 'I agree'", "I agree")
    for question, words in zip(QUESTIONS, ("30", "f", "none", "daily"), strict=True):
        answer(there, question, words)


def approve_the_rest(there: PseudoTerminal) -> None:
    while there.wait_for_next("Did it work?", 40):
        assert there.wait_for_next(">")
        there.type("y\r")


def test_a_person_teaches_in_a_narrow_window_from_consent_to_export(start: Start, tmp_path: Path):
    there = start(*RUN, columns=40)
    introduce(there)
    for words in ("Session 1 of P01, 30 minutes", "Ctrl-C stops the robot", "Task 1 of this session",
                  '"open the cupboard"', "Plan: now OPEN(cupboard)", "29:", AT_WORK):  # fmt: skip
        assert there.wait_for_next(words), f"{words!r} is not shown: {there.unread}"
    there.type("\x03")
    answer(there, "Stopped during OPEN(cupboard). What was wrong?", "pull further")
    there.resize(70)
    answer(there, "I noted:", "y")
    assert there.wait_for_next("Plan: now OPEN(cupboard), attempt 2"), there.unread
    approve_the_rest(there)
    assert there.exit_code() == 0 and "1 round of 1 task is done" in there.shown
    assert "That was your session, P01" in there.shown
    for line in there.shown.splitlines():
        assert "done, 1 correction" not in line, "the participant is told what the hidden check says"
    events = events_of(tmp_path)
    assert events[0]["live"]
    began = max(one["time"] for one in events if one["event"] == "CodeWritten" and one["attempt"] == 2)
    ended = next(one for one in events if one["event"] == "CodeEnded" and one["attempt"] == 2)
    assert ended["time"] - began > 0.95 * ended["sim_seconds"] > 2.0, "the robot moves faster than the clock"
    exported = subprocess.run([*MEMO, "study", "export", "out", "--to", "public"], cwd=tmp_path, capture_output=True)
    assert exported.returncode == 0
    assert "pull further" in (tmp_path / "public" / "remarks.jsonl").read_text()


def events_of(tmp_path: Path) -> list[dict[str, Any]]:
    [events] = (tmp_path / "out").rglob("events.jsonl")
    return [json.loads(line) for line in events.read_text().splitlines()]


@pytest.mark.parametrize("errors", ["", "2>&1 "], ids=["results", "everything"])
def test_output_can_be_piped_through_tee(start: Start, tmp_path: Path, errors: str):
    there = start("sh", "-c", f"{' '.join(RUN)} {errors}| tee log", pace="off")
    introduce(there)
    approve_the_rest(there)
    assert there.exit_code() == 0
    log = (tmp_path / "log").read_text()
    assert "1 round of 1 task is done" in log
    assert (f": {AT_WORK}()" in log and "[29:" in log) == bool(errors)


def test_input_that_ends_pauses_and_the_resumed_session_shows_where_it_is(start: Start):
    there = start(*RUN, pace="off")
    introduce(there)
    assert there.wait_for_next("Did it work?", 60) and there.wait_for_next(">")
    there.type("\x04")
    assert there.exit_code() == 130 and "to continue: memo study resume out" in there.shown
    back = start(*MEMO, "study", "resume", "out", pace="off")
    for words in ("Task 1 of this session, continued", '"open the cupboard"', "Plan: now OPEN(cupboard)"):
        assert back.wait_for_next(words), back.unread
    assert "type 'I agree'" not in back.shown
    approve_the_rest(back)
    assert back.exit_code() == 0


def test_ctrl_c_twice_ends_for_now_and_a_closed_window_loses_nothing(start: Start):
    there = start(*RUN)
    introduce(there)
    assert there.wait_for_next(AT_WORK), there.unread
    there.type("\x03")
    assert there.wait_for_next("What was wrong?", 5), there.unread
    there.type("\x03")
    assert there.exit_code() == 130 and "to continue: memo study resume out" in there.shown
    back = start(*MEMO, "study", "resume", "out")
    assert back.wait_for_next(AT_WORK), back.unread
    back.hang_up()
    back.process.wait(30)
    again = start(*MEMO, "study", "resume", "out")
    assert again.wait_for_next("Plan: now OPEN(cupboard)"), again.unread


def test_when_the_time_is_over_the_attempt_is_finished_and_the_session_ends(start: Start):
    there = start(*RUN, minutes=0.02, pace="off")
    introduce(there)
    approve_the_rest(there)
    assert there.exit_code() == 0
    assert "[0:00 left]" in there.shown and there.shown.count("Did it work?") == 1
    assert "The time of this session is over." in there.shown


# -- the window --------------------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def display() -> Iterator[str]:
    if shutil.which("Xvfb") is None:
        pytest.skip("no Xvfb to show a window in")
    read, write = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(write)], pass_fds=(write,), stderr=subprocess.DEVNULL)
    yield f":{os.read(read, 16).decode().strip()}"
    server.terminate()
    server.wait()


def picture(display: str) -> bytes:
    from PIL import ImageGrab

    return ImageGrab.grab(xdisplay=display).tobytes()


@pytest.mark.parametrize("simulator", ["mujoco", "pybullet"])
def test_a_window_shows_the_robot_move_and_ctrl_c_stops_it(start: Start, display: str, simulator: str):
    there = start(*RUN, "--view", simulator=simulator, environment={"DISPLAY": display})
    introduce(there)
    assert there.wait_for_next(AT_WORK, 90), there.unread
    first = picture(display)
    assert len(set(first)) > 20, "the window is empty"
    time.sleep(2)
    assert picture(display) != first, "nothing moves in the window"
    there.type("\x03")
    assert there.wait_for_next("What was wrong?", 5), there.unread
    there.type("\x03")
    assert there.exit_code() == 130
    assert "GL_" not in there.shown, "the window's messages are between the questions"


def test_a_window_that_cannot_be_opened_is_refused_before_anybody_is_asked(start: Start):
    there = start(*RUN, "--view", environment={"DISPLAY": "", "WAYLAND_DISPLAY": ""})
    assert there.exit_code() != 0
    assert "there is no display" in there.shown and "I agree" not in there.shown
