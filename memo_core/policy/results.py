"""How a run and its subtasks ended: what a method returns. Imports nothing heavy, since plugins with a method do."""

from __future__ import annotations

from typing import Literal

import attrs

from memo_core.errors import MemoError

Status = Literal["approved", "corrected", "unobserved"]
STATUS_IN_WORDS = {
    "approved": "approved",
    "corrected": "corrected, never approved",
    "unobserved": "nobody said whether it worked",
}


@attrs.frozen
class SubtaskResult:
    """How one subtask ended. ``code`` is the last program that was tried; ``problem`` says why the subtask was given
    up, if it was."""

    subtask: str
    status: Status
    attempts: int
    code: str = ""
    problem: str = ""
    interrupted: int = 0  # times somebody pressed stop
    printed: str = ""  # by that code
    error: str = ""  # what that code ended with, if it did
    corrected: int = 0  # times somebody found fault with it
    taken_back: bool = False  # everything was put back to its start, and something else was planned


@attrs.frozen
class RunResult:
    """How a run ended. ``reason`` is one sentence; only the success check decides whether the task is done."""

    reason: str
    finished: bool  # the planner said DONE
    subtasks: tuple[SubtaskResult, ...] = ()
    robot_s: float = 0.0  # of all attempts together
    resumable: bool = False  # it broke off for a reason that may pass
    error: MemoError | None = None  # by which it could not be carried out
    verdict: Status = "unobserved"  # of whoever watched, on the whole task
    corrections: int = 0  # times somebody found fault with a subtask
    planning_remarks: int = 0  # times somebody found fault with the plan or the whole task
    interruptions: int = 0  # times somebody pressed stop
