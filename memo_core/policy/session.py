"""What a method is given to do a run with, and what it gives back."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, Protocol

import attrs

from memo_core.events import Event
from memo_core.interfaces.llm import Answer, LanguageModel, Request, Usage
from memo_core.interfaces.teacher import Episode, Verdict
from memo_core.policy.budget import Budget
from memo_core.policy.prompt_files import Prompts
from memo_core.policy.settings import RunSettings
from memo_core.policy.stage import Stage
from memo_core.policy.stopping import StopSwitch
from memo_core.sandbox.sandbox import Sandbox
from memo_core.skillbook.book import Skillbook
from memo_core.skills.skill import Skill

if TYPE_CHECKING:
    from memo_core.policy.progress import Progress, Resumed

Status = Literal["approved", "corrected", "unobserved"]


class Journal(Protocol):
    """Where a run keeps what it must not lose. Every call returns when it is on disk."""

    def model_call(
        self, request: Request, answer: Answer | None, problem: str, abandoned: bool, usage: Usage | None = None
    ) -> str:
        """Keep a question and its answer (or why there is none, and what it cost all the same); returns the file's name
        in the run folder."""

    def code(self, subtask: str, attempt: int, repair: int, code: str, take: int = 1) -> str: ...

    def planning_start(self, number: int, done: tuple[str, ...], checkpoint: bytes) -> None: ...

    def subtask_start(self, number: int, subtask: str, done: tuple[str, ...], checkpoint: bytes) -> None: ...

    def attempt_over(self, number: int, subtask: str, done: tuple[str, ...], checkpoint: bytes) -> None:
        """The world as an attempt left it that nobody found fault with."""

    def progress(self, progress: Progress) -> None:
        """How far the run has come: a resumed run goes on from the last of these."""

    def attempt_begins(self, number: int, attempt: int, take: int = 1) -> None: ...

    def attempt_ends(self, number: int, attempt: int) -> None: ...


class AskTeacher(Protocol):
    """Puts an episode to whoever watches, in the thread that owns the terminal."""

    def __call__(self, episode: Episode, interrupted: bool) -> Verdict: ...


class PutBack(Protocol):
    """Asks whoever is there to put the world back as it was in ``episode.before``; False where nobody did."""

    def __call__(self, episode: Episode) -> bool: ...


@attrs.frozen(eq=False)
class Session:
    """Everything of one run. ``book`` is None where nothing is remembered; ``teacher`` None where nobody watches."""

    run: str
    stage: Stage
    llm: LanguageModel
    skills: dict[str, Skill]
    sandbox: Sandbox
    settings: RunSettings
    stop: StopSwitch
    journal: Journal
    emit: Callable[[Event], None]
    book: Skillbook | None = None
    teacher: AskTeacher | None = None
    who: str = "anonymous"
    seed: int = 0
    ending: Callable[[], bool] = lambda: False  # whether the run itself is to end
    put_back: PutBack | None = None  # None where nobody is there
    time_limit_s: float = math.inf  # of the task, on the clock of a world that is put back after corrections
    resumed: Resumed | None = None  # where a run that was cut off goes on
    prompts: Prompts = attrs.field(factory=Prompts)
    budget: Budget = attrs.field(factory=Budget)
    on_text: Callable[[str, str], None] | None = None  # hears (phase, piece) while an answer is written

    def release(self) -> None:
        """After a stop was answered: let the robot move again."""
        self.stop.release()
        self.stage.link.release()


@attrs.frozen
class SubtaskResult:
    """How one subtask ended. ``code`` is the last that was tried; ``problem`` why it was given up, if it was."""

    subtask: str
    status: Status
    attempts: int
    code: str = ""
    problem: str = ""
    interrupted: int = 0  # times somebody pressed stop
    printed: str = ""  # by that code
    error: str = ""  # what that code ended with, if it did


@attrs.frozen
class RunResult:
    """How a run ended. ``reason`` is one sentence; whether the task is done only the success check says."""

    reason: str
    finished: bool  # the planner said DONE
    subtasks: tuple[SubtaskResult, ...] = ()
    robot_s: float = 0.0  # of all attempts together
    resumable: bool = False  # it broke off for a reason that may pass
