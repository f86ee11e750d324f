"""The arguments of a method's run. Its results: ``memo_core.policy.results``."""

from __future__ import annotations

from collections.abc import Callable

import attrs

from memo_core.events import Event
from memo_core.interfaces.environment import Environment
from memo_core.interfaces.llm import LanguageModel
from memo_core.llm.budget import Budget
from memo_core.llm.prompt_files import Prompts
from memo_core.policy.person import Person
from memo_core.policy.settings import RunSettings, TeachingSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.run_log import RunLog
from memo_core.sandbox.sandbox import Sandbox
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.functions import FunctionUse
from memo_core.skills.skill import Skill


@attrs.frozen(eq=False)
class Session:
    """Everything that belongs to one run. ``book`` is None if nothing is stored. All of the method's effects on the
    world, people and the book go through ``log``."""

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
    person: Person = attrs.field(factory=Person)
    seed: int = 0
    teaching: TeachingSettings = attrs.field(factory=TeachingSettings)
    images: bool = False  # whether plan and code prompts come with the cameras' pictures
    functions: FunctionUse = "call"
    approvals: int = 3  # of programs written with an untested function before it may be called
    prompts: Prompts = attrs.field(factory=Prompts)
    budget: Budget = attrs.field(factory=Budget)
    on_text: Callable[[str, str], None] | None = None  # called with (phase, piece) while an answer is written

    def release(self) -> None:
        """Let the robot move again after a stop was answered."""
        self.stop.release()
        self.environment.link.release()
