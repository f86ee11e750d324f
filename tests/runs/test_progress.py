"""The events of a run say at any moment where it stands."""

from __future__ import annotations

from memo_core.events import (
    CodeEnded,
    Event,
    ModelAsked,
    ModelCalled,
    QuestionAsked,
    RunResumed,
    RunStarted,
    SessionTask,
    SkillStarted,
    SubtaskEnded,
    SubtaskStarted,
    TimeLeft,
)
from memo_core.runs.progress import RunProgress

BEGUN = (RunStarted("r", "open", "open the cupboard", 0, {}, True), SubtaskStarted("OPEN(cupboard)", 1, 1))


def after(*events: Event, now: list[float] | None = None) -> RunProgress:
    progress = RunProgress(clock=lambda: (now or [0.0])[0])
    for event in events:
        progress(event)
    return progress


def answered(abandoned: bool = False) -> ModelCalled:
    return ModelCalled("code", "m", 1, 1, None, 0.1, abandoned)


def test_the_task_the_plan_so_far_and_the_current_subtask():
    at = after(*BEGUN, SubtaskEnded("OPEN(cupboard)", "approved", 1), SubtaskStarted("PICK_UP(bowl)", 2, 3))
    assert (at.instruction, at.live) == ("open the cupboard", True)
    assert (at.done, at.subtask, at.attempt) == ((("OPEN(cupboard)", "approved"),), "PICK_UP(bowl)", 3)


def test_a_resumed_run_is_where_it_was():
    done = (("OPEN(cupboard)", "approved"),)
    at = after(RunResumed("r", 2, "PICK_UP(bowl)", 2, 7, "put the bowl away", done, True))
    assert (at.instruction, at.done, at.subtask, at.attempt) == ("put the bowl away", done, "PICK_UP(bowl)", 2)


def test_thinking_and_moving_are_activities_until_they_end():
    assert after(*BEGUN, ModelAsked("code", "m")).activity == "writing a program"
    assert after(*BEGUN, ModelAsked("code", "m"), answered()).activity == ""
    assert after(*BEGUN, ModelAsked("look", "m")).activity == "looking at the scene", "with a model of perception"
    moving = after(*BEGUN, SkillStarted("close_gripper", 7, "close_gripper()"))
    assert moving.activity == "line 7: close_gripper()"
    assert after(*BEGUN, SkillStarted("move_to", 9, "lift(0.1)")).activity == "line 9: move_to, by lift(0.1)"
    for end in (CodeEnded("OPEN(cupboard)", 1, ""), QuestionAsked("stop", "OPEN(cupboard)")):
        moving(end)
        assert moving.activity == ""


def test_an_abandoned_call_that_ends_late_does_not_end_what_goes_on_now():
    assert after(*BEGUN, ModelAsked("plan", "m"), answered(abandoned=True)).activity


def test_the_session_s_clock_runs_on_between_events_and_ends_at_nothing():
    now = [50.0]
    at = after(SessionTask("P01", 1, 1, False, 1800.0, 60.0, False), now=now)
    assert at.time_left == 60.0 and after().time_left is None
    now[0] += 45.0
    assert at.time_left == 15.0
    at(TimeLeft(-2.0))
    assert at.time_left == 0.0
