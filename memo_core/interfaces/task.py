"""What a task suite must provide: tasks made of a scene, an instruction, monitors and a success check."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import attrs
import numpy as np

from memo_core.interfaces.simulator import WorldState
from memo_core.scene.description import SceneDescription

TASK_TYPES = {  # of the paper's tasks
    "LH": "long horizon",
    "CR": "contact-rich",
    "SR": "semantic reasoning",
    "TR": "translation and rotation",
}


class Monitor(ABC):
    """Observes every tick and keeps a state. The state is part of a checkpoint, so a retry does not inherit what
    happened in the attempt before."""

    name: str

    @abstractmethod
    def reset(self, world: WorldState) -> None: ...

    @abstractmethod
    def update(self, world: WorldState) -> None:
        """Observe the state after a tick; must be quick.

        Args:
            world: true state of the simulation, poses in the robot's base frame.
        """

    @abstractmethod
    def memory(self) -> dict[str, Any]:
        """The state as JSON values, for ``recall``."""

    @abstractmethod
    def recall(self, memory: dict[str, Any]) -> None: ...


@attrs.frozen
class Outcome:
    """The verdict of a success check, with its reason. ``measures`` are in SI units."""

    success: bool
    reason: str
    measures: dict[str, float] = attrs.field(factory=dict)


class Task(ABC):
    """One task of a suite."""

    name: str  # e.g. "put-the-food-in-the-microwave"
    instruction: str  # e.g. "put the food in the microwave"
    # What a person in the room wants to see at the end, a sentence a condition, in terms of what is visible:
    # ("the food is in the microwave", "the hand has let go of the food"). For teachers; no check is derived from it.
    goal: tuple[str, ...] = ()
    kind: str = ""  # a key of ``TASK_TYPES``
    split: str = "training"  # or "held-out"
    time_limit: float = 300.0  # simulated seconds
    settle: float = 2.5  # simulated seconds to let pass with the arm still before ``check``
    unsolved: str = ""  # why there is no reference solution, where there is none
    # Of a task with a property that only a person can tell; for reports and simulated teachers, not shown to models.
    lesson: str = ""  # what a person who knows the trick would say, in one sentence
    trick: str = ""  # a name of the property, the same for every task that has it
    needed_at: tuple[
        str, ...
    ] = ()  # the subtask at which ``lesson`` is needed, as planners may word it, plainest first

    @abstractmethod
    def scene(self, rng: np.random.Generator) -> SceneDescription:
        """Describe the scene of one episode.

        Args:
            rng: only source of randomness, so that equal seeds give equal scenes.

        Returns:
            The scene, poses in the robot's base frame.
        """

    def monitors(self) -> tuple[Monitor, ...]:
        return ()

    @abstractmethod
    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        """Check whether the task is done. An error raised here ends the run as ``TaskCodeError``.

        Args:
            world: true state of the simulation, poses in the robot's base frame.
            monitors: the task's monitors by name, updated after every tick so far.

        Returns:
            The verdict with its reason.
        """

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        """Check whether a subtask is done, for reports only.

        Args:
            subtask: the subtask as planned, such as ``OPEN(microwave)``.
            world: true state of the simulation, poses in the robot's base frame.

        Returns:
            The verdict with its reason; None, the default, if the task has no check for this subtask.
        """
        return None

    @property
    def reference_solution(self) -> str:
        """Robot code written by hand that solves the task; used by tests and ``memo tasks verify`` only. Empty only
        where ``unsolved`` says why."""
        return ""

    @property
    def plain_attempt(self) -> str:
        """For a task with a property that only a person can tell: robot code for what anybody would try first without
        knowing it. It must fail. Used by tests and ``memo tasks verify --plain`` only."""
        return ""
