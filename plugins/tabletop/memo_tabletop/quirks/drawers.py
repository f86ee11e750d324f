"""Drawers that do not just slide."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from memo_core.interfaces.simulator import WorldState
from memo_core.interfaces.task import Outcome
from memo_core.scene.description import Body, SceneDescription, Vector
from memo_core.scene.mechanisms import Mechanism
from memo_tabletop import judging
from memo_tabletop.furniture import Handle, chest
from memo_tabletop.quirks.code import quirk_code
from memo_tabletop.quirks.fixtures import with_joint, with_lifting_handle, with_mover
from memo_tabletop.quirks.latches import half_way_catch, lifted_bolt, push_latch
from memo_tabletop.quirks.task import QuirkTask
from memo_tabletop.things import cameras

PLINTH = 0.06  # m, as under the tabletop suite's chest
REACHED_INTO_M = 0.10  # a drawer this far out can be reached into
TRAVEL = 0.18  # m


class OpenADrawer(QuirkTask):
    """Success: the drawer is out so far that a hand reaches into it, still and let go."""

    thing: str  # "dresser"
    size: Vector = (0.28, 0.30, 0.16)  # depth, width, height
    place: tuple[float, float] = (0.66, 0.10)
    handle = Handle(length=0.12, distance=0.055, height=0.08)

    def furniture(self, rng: np.random.Generator) -> Body:
        x, y = np.asarray(self.place) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        fixture = chest(self.thing, (x, y, 0.0), yaw, self.size, PLINTH, self.handle, TRAVEL)
        return self.changed(with_mover(fixture, self._named))

    def _named(self, drawer: Body) -> Body:
        part, cavity = drawer.parts[0], drawer.cavities[0]
        return attrs.evolve(
            drawer,
            label=f"{self.thing} drawer",
            parts=(attrs.evolve(part, label=f"{self.thing} handle"),),
            cavities=(attrs.evolve(cavity, label=f"{self.thing} inside"),),
        )

    def changed(self, fixture: Body) -> Body:
        """The chest with what is particular about it."""
        return fixture

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return ()

    @property
    def joint(self) -> str:
        return f"{self.thing}/slide"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        fixture = self.furniture(rng)
        x, y, _ = fixture.pose.position
        return SceneDescription((fixture,), cameras((x, y, 0.15)), mechanisms=self.mechanisms())

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        out = world.joint_position(self.joint)
        measures = {"drawer_m": out}
        if out < REACHED_INTO_M:
            how = "is shut" if out < 0.01 else f"is only {out * 1000:.0f} mm out"
            return Outcome(False, f"the {self.thing} drawer {how}", measures)
        if not judging.released(world, f"{self.thing}/drawer"):
            return Outcome(False, "the robot still touches the drawer", measures)
        if abs(world.joint_velocity(self.joint)) > judging.AT_REST_M_S:
            return Outcome(False, "the drawer is still moving", measures)
        return Outcome(True, f"the {self.thing} drawer is {out * 1000:.0f} mm out", measures)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        return self.check(world, {}) if judging.read_subtask(subtask)[0] in ("OPEN", "PULL_OUT", "PULL") else None

    @property
    def plain_attempt(self) -> str:
        return quirk_code("geometry", "slide", calls=f'pull_drawer("{self.thing}", 0.16)\n')


class OpenTheDresser(OpenADrawer):
    """The drawer catches half-way; eased and pulled a second time it comes free."""

    name = "open-the-dresser"
    instruction = "open the dresser"
    quirk = "sticks half-way"
    lesson = "The dresser drawer sticks halfway, ease off and pull it a second time."
    thing = "dresser"

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return half_way_catch(self.joint, stop=0.06, strain=0.004, hard=0.009, stiffness=2500.0)

    @property
    def reference_solution(self) -> str:
        return quirk_code("geometry", "slide", calls=f'pull_twice("{self.thing}", 0.066, 0.16)\n')


class OpenTheWorkbench(OpenADrawer):
    """A bolt that the handle draws: it must be lifted before the drawer can be pulled."""

    name = "open-the-workbench"
    instruction = "open the workbench"
    split = "held-out"
    quirk = "lift the handle"
    lesson = "Lift the workbench handle up first and keep it up while you pull."
    thing = "workbench"

    def changed(self, fixture: Body) -> Body:
        return with_lifting_handle(fixture, 0.03)

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return lifted_bolt(self.thing, self.joint, play=0.004)

    @property
    def reference_solution(self) -> str:
        return quirk_code("geometry", "slide", calls=f'lift_and_pull("{self.thing}", 0.026, 0.16)\n')


class OpenTheNightstand(OpenADrawer):
    """A push latch: pushed in by 4 mm, the drawer springs out by itself."""

    name = "open-the-nightstand"
    instruction = "open the nightstand"
    split = "held-out"
    quirk = "push in first"
    lesson = "Push the nightstand drawer in a little and it pops out by itself."
    thing = "nightstand"

    def changed(self, fixture: Body) -> Body:
        return with_joint(fixture, range=(-0.006, TRAVEL), stiffness=18.0, rest=0.30, friction=0.5, damping=12.0)

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return push_latch(self.joint, lowest=-0.006, pushed=-0.003)

    @property
    def reference_solution(self) -> str:
        return quirk_code("geometry", "slide", calls=f'push_in("{self.thing}")\n')
