"""The arguments of a method's run. Its results: ``memo_core.policy.results``."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import attrs

from memo_core.events import Event
from memo_core.interfaces.environment import Environment
from memo_core.interfaces.llm import LanguageModel
from memo_core.interfaces.teacher import Episode, Noted, Program, Proposal, ReadBack, TaskEpisode, Verdict
from memo_core.llm.budget import Budget
from memo_core.llm.prompt_files import Prompts
from memo_core.policy.pictures import Picture
from memo_core.policy.settings import RunSettings, TeachingSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.sandbox.sandbox import Sandbox
from memo_core.scene.graph import SceneGraph
from memo_core.scene.name_corrections import NameCorrection
from memo_core.skillbook.book import Skillbook
from memo_core.skills.skill import Skill


class AskTeacher(Protocol):
    """Asks the teacher about an episode, in the thread that owns the terminal."""

    def __call__(self, episode: Episode, interrupted: bool) -> Verdict: ...


class PutBack(Protocol):
    """Asks the teacher to put the scene back as it was in ``episode.before``; False if that was not done."""

    def __call__(self, episode: Episode) -> bool: ...


@attrs.frozen(eq=False)
class Session:
    """Everything that belongs to one run. ``book`` is None if nothing is stored; ``teacher`` is None if nobody watches.
    All of the method's effects on the world, people and the book go through ``log``."""

    run: str
    environment: Environment
    llm: LanguageModel
    skills: dict[str, Skill]
    sandbox: Sandbox
    settings: RunSettings
    stop: StopSwitch
    emit: Callable[[Event], None]
    log: RunLog = attrs.field(factory=RunLog)  # in memory: the run cannot be resumed
    book: Skillbook | None = None
    teacher: AskTeacher | None = None
    who: str = "anonymous"
    seed: int = 0
    ending: Callable[[], bool] = lambda: False  # whether the run itself is to end
    teaching: TeachingSettings = attrs.field(factory=TeachingSettings)
    correct_names: Callable[[tuple[NameCorrection, ...]], None] = lambda corrections: None  # of what perception sees
    pictures: Callable[[SceneGraph], tuple[Picture, ...]] | None = None  # of a look, for prompts; None: without
    # What else whoever watches is asked; None where nobody is there, or nobody who answers that.
    judge_task: Callable[[TaskEpisode], Verdict] | None = None
    judge_plan: Callable[[Proposal], Verdict] | None = None
    read_back: Callable[[Noted], ReadBack] | None = None
    permit: Callable[[Program], Verdict] | None = None  # asked before each program; None: programs run unasked
    put_back: PutBack | None = None
    confirm: PutBack | None = None  # the same for "may the robot go on from the scene as it is now?"
    teacher_state: Callable[[], str] = lambda: ""  # what the teacher needs to go on in a resumed run
    restore_teacher: Callable[[str], None] = lambda state: None
    time_limit_s: float = math.inf  # of the task, on the clock of a world that is put back after corrections
    prompts: Prompts = attrs.field(factory=Prompts)
    budget: Budget = attrs.field(factory=Budget)
    # Whether whoever watches has no more time, by (seconds of the robot, attempts, calls of models); None: never.
    time_is_up: Callable[[float, int, int], bool] | None = None
    on_text: Callable[[str, str], None] | None = None  # hears (phase, piece) while an answer is written

    def release(self) -> None:
        """Let the robot move again after a stop was answered."""
        self.stop.release()
        self.environment.link.release()
