"""State of a run as a person follows it, kept from its events for any kind of display."""

from __future__ import annotations

import time
from collections.abc import Callable

import attrs

from memo_core.events import (
    CodeEnded,
    Event,
    ModelAsked,
    ModelCalled,
    QuestionAsked,
    RunEnded,
    RunResumed,
    RunStarted,
    SessionTask,
    SkillStarted,
    SubtaskEnded,
    SubtaskStarted,
    TimeLeft,
)

THINKING = {
    "look": "looking at the scene",
    "plan": "thinking about what to do next",
    "code": "writing a program",
    "feedback": "making notes of your words",
    "template": "keeping the program that worked",
    "merge": "putting the programs together",
}


@attrs.define
class RunProgress:
    """Call it with every event of a run or a study.

    Attributes:
        instruction: the task's sentence.
        live: whether a person follows the motion as it happens.
        done: the subtasks that ended and how (``approved``, ``corrected``, ``unobserved``), in order.
        subtask: the current one; empty while the next is planned.
        attempt: at the current subtask, from 1.
        activity: what goes on now, such as "writing a program" or "line 7: close_gripper()"; empty while a
            person is asked.
        since: when the activity began (s, ``clock``).
    """

    instruction: str = ""
    live: bool = False
    done: tuple[tuple[str, str], ...] = ()
    subtask: str = ""
    attempt: int = 1
    activity: str = ""
    since: float = 0.0
    clock: Callable[[], float] = time.monotonic
    _session_over: float | None = None

    def __call__(self, event: Event) -> None:
        take = getattr(self, f"_on_{type(event).__name__}", None)
        if take is not None:
            take(event)

    @property
    def time_left(self) -> float | None:
        """Seconds until the session of a study is over, not below 0; None outside of a study."""
        return None if self._session_over is None else max(0.0, self._session_over - self.clock())

    def _begin(self, activity: str) -> None:
        if activity != self.activity:
            self.activity, self.since = activity, self.clock()

    # -- events --------------------------------------------------------------------------------------------------------
    def _on_SessionTask(self, event: SessionTask) -> None:
        self._session_over = self.clock() + event.left_s

    def _on_TimeLeft(self, event: TimeLeft) -> None:
        self._session_over = self.clock() + event.left_s

    def _on_RunStarted(self, event: RunStarted) -> None:
        self.instruction, self.live = event.instruction, event.live
        self.done, self.subtask, self.attempt = (), "", 1
        self._begin("getting ready")

    def _on_RunResumed(self, event: RunResumed) -> None:
        self.instruction, self.live = event.instruction, event.live
        self.done, self.subtask, self.attempt = event.subtasks, event.subtask, event.attempt
        self._begin("getting ready")

    def _on_SubtaskStarted(self, event: SubtaskStarted) -> None:
        self.subtask, self.attempt = event.subtask, event.attempt

    def _on_SubtaskEnded(self, event: SubtaskEnded) -> None:
        self.done, self.subtask = (*self.done, (event.subtask, event.status)), ""

    def _on_ModelAsked(self, event: ModelAsked) -> None:
        self._begin(THINKING.get(event.phase, f"asking a model ({event.phase})"))

    def _on_ModelCalled(self, event: ModelCalled) -> None:
        if not event.abandoned:  # else it comes late
            self._begin("")

    def _on_SkillStarted(self, event: SkillStarted) -> None:
        call = event.call if event.skill in event.call else f"{event.skill}, by {event.call}"
        self._begin(f"line {event.line}: {call}")

    def _on_CodeEnded(self, event: CodeEnded) -> None:
        self._begin("")

    def _on_QuestionAsked(self, event: QuestionAsked) -> None:
        self._begin("")

    def _on_RunEnded(self, event: RunEnded) -> None:
        self._begin("")
