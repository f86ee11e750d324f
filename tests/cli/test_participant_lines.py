"""A participant of a study sees between the questions what the robot does, and how much time is left."""

from __future__ import annotations

import io
import re

import pytest
from rich.console import Console

from memo_core.cli.participant_lines import ParticipantLines
from memo_core.events import (
    Event,
    ModelAsked,
    QuestionAsked,
    RunStarted,
    SessionTask,
    SkillStarted,
    SubtaskEnded,
    SubtaskStarted,
)

SESSION = SessionTask("P01", 1, 1, False, 1800.0, 1800.0, False)
STARTED = RunStarted("r", "open", "open the cupboard", 0, {}, True)
CALL = "follow_path([along(path[-1][0], opposite(leaving), CLEARANCE)], speed=0.25)"
MOVING = (ModelAsked("code", "m"), SkillStarted("follow_path", 62, CALL), SkillStarted("follow_path", 62, CALL))
ATTEMPT = (SubtaskStarted("OPEN(cupboard)", 1, 1), *MOVING, QuestionAsked("attempt", "OPEN(cupboard)"))


@pytest.fixture
def shown() -> io.StringIO:
    return io.StringIO()


def show(shown: io.StringIO, *events: Event, terminal: bool, width: int = 100) -> str:
    console = Console(file=shown, width=width, force_terminal=terminal, no_color=True, highlight=False)
    lines = ParticipantLines(console)
    for event in events:
        lines(event)
    text = shown.getvalue()
    lines.close()
    return text


def test_the_sentence_the_plan_and_the_time_left_are_shown(shown):
    ended = SubtaskEnded("OPEN(cupboard)", "approved", 1), SubtaskStarted("PICK_UP(bowl)", 2, 1)
    text = show(shown, SESSION, STARTED, *ATTEMPT, *ended, terminal=False)
    for words in ("30 minutes", "Ctrl-C stops", '"open the cupboard"', "Plan: now OPEN(cupboard)", "[30:00 left]",
                  "Plan: OPEN(cupboard) ✓ → now PICK_UP(bowl)"):  # fmt: skip
        assert words in text


def test_without_a_terminal_each_activity_is_a_line_and_said_once(shown):
    text = show(shown, SESSION, STARTED, *ATTEMPT, terminal=False)
    assert text.count("line 62: follow_path") == 1 and "writing a program\n" in text and "\x1b" not in text


@pytest.mark.parametrize("width", [12, 40, 200])
def test_the_status_line_fits_the_terminal_and_is_gone_before_a_question(shown, width):
    text = re.sub(r"\x1b\[[0-9;]*m", "", show(shown, SESSION, STARTED, *ATTEMPT, terminal=True, width=width))
    *before, question = re.split(r"\x1b\[1G\x1b\[2K", text)
    assert "line 62" not in question and question.endswith("\n")
    pictures = [one for one in before if one.startswith("  [")]
    assert pictures and all(len(one.split("\n")[0]) < width for one in pictures)


@pytest.mark.parametrize("terminal", [False, True])
def test_simulated_participants_are_shown_nothing(shown, terminal):
    simulated = SessionTask("S01", 1, 1, False, 1800.0, 1800.0, True)
    assert show(shown, simulated, STARTED, *ATTEMPT, terminal=terminal) == ""
