"""What the tasks of opening a door, a drawer and a lid have in common: one fixture, of which a part has to move."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np

from memo_core.plugin import Body, Mechanism, Outcome, SceneDescription, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.objects import cameras
from memo_tabletop.quirks.task import QuirkTask


class OpenAThing(QuirkTask):
    """Success: what moves is open wide enough, still, and let go."""

    thing: str  # "cupboard"
    mover: str  # "door": the body is THING/MOVER
    motion: str  # "hinge": the joint is THING/MOTION
    still: float  # rad/s or m/s; a slower joint is at rest
    looked_at: float  # m above the table, where the cameras aim
    verbs: tuple[str, ...] = ("OPEN",)

    @abstractmethod
    def furniture(self, rng: np.random.Generator) -> Body:
        """The fixture, placed."""

    def changed(self, fixture: Body) -> Body:
        """The fixture with its peculiarity."""
        return fixture

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return ()

    @abstractmethod
    def opened(self, world: WorldState) -> tuple[bool, str, dict[str, float]]:
        """Whether it is open wide enough, how it stands ("is shut"), and the outcome's measures."""

    @property
    def joint(self) -> str:
        return f"{self.thing}/{self.motion}"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        fixture = self.changed(self.furniture(rng))
        x, y, _ = fixture.pose.position
        return SceneDescription((fixture,), cameras((x, y, self.looked_at)), mechanisms=self.mechanisms())

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        wide, how, measures = self.opened(world)
        how = f"the {self.thing} {self.mover} {how}"
        conditions = (
            (wide, how),
            (checks.released(world, f"{self.thing}/{self.mover}"), f"the robot still touches the {self.mover}"),
            (abs(world.joint_velocity(self.joint)) < self.still, f"the {self.mover} is still moving"),
        )
        return checks.judge(how, conditions, measures)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        return self.check(world, {}) if checks.read_subtask(subtask)[0] in self.verbs else None
