"""Drawers with a peculiarity."""

from __future__ import annotations

import math

import attrs
import numpy as np

from memo_core.plugin import Body, Mechanism, Vector, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.furniture import Handle, chest
from memo_tabletop.quirks.code import quirk_code
from memo_tabletop.quirks.fixtures import with_joint, with_lifting_handle, with_mover
from memo_tabletop.quirks.latches import half_way_catch, lifted_bolt, push_latch
from memo_tabletop.quirks.opening import OpenAThing

PLINTH = 0.06  # m, as under the tabletop suite's chest
REACHED_INTO_M = 0.10  # a drawer this far out can be reached into
TRAVEL = 0.18  # m


class OpenADrawer(OpenAThing):
    """Success: the drawer is out so far that a hand reaches into it, still and let go."""

    mover, motion, still, looked_at = "drawer", "slide", checks.AT_REST_M_S, 0.15
    verbs = ("OPEN", "PULL_OUT", "PULL")
    size: Vector = (0.28, 0.30, 0.16)  # depth, width, height
    place: tuple[float, float] = (0.66, 0.10)
    handle = Handle(length=0.12, distance=0.055, height=0.08)

    def furniture(self, rng: np.random.Generator) -> Body:
        x, y = np.asarray(self.place) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        fixture = chest(self.thing, (x, y, 0.0), yaw, self.size, PLINTH, self.handle, TRAVEL)
        return with_mover(fixture, self._named)

    def _named(self, drawer: Body) -> Body:
        part, cavity = drawer.parts[0], drawer.cavities[0]
        return attrs.evolve(
            drawer,
            label=f"{self.thing} drawer",
            parts=(attrs.evolve(part, label=f"{self.thing} handle"),),
            cavities=(attrs.evolve(cavity, label=f"{self.thing} inside"),),
        )

    def opened(self, world: WorldState) -> tuple[bool, str, dict[str, float]]:
        out = world.joint_position(self.joint)
        far = out >= REACHED_INTO_M
        how = f"is {'' if far else 'only '}{out * 1000:.0f} mm out"
        return far, "is shut" if out < 0.01 else how, {"drawer_m": out}

    @property
    def plain_attempt(self) -> str:
        return quirk_code("geometry", "slide", calls=f'pull_drawer("{self.thing}", 0.16)\n')


class OpenTheDresser(OpenADrawer):
    """The drawer catches half-way; eased and pulled a second time it comes free."""

    name = "open-the-dresser"
    needed_at: tuple[str, ...] = ("OPEN(dresser)",)
    instruction = "open the dresser"
    goal = ("the dresser drawer is wide open", "the hand has let go of the dresser handle")
    trick = "sticks half-way"
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
    needed_at: tuple[str, ...] = (
        "OPEN(workbench drawer)",
        "PULL(workbench handle)",
        "OPEN(workbench)",
        "PULL_OUT(workbench drawer)",
        "GRASP_HANDLE(workbench)",
    )
    instruction = "open the workbench"
    goal = ("the workbench drawer is wide open", "the hand has let go of the workbench handle")
    split = "held-out"
    trick = "lift the handle"
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
    needed_at: tuple[str, ...] = (
        "OPEN(nightstand drawer)",
        "PULL(nightstand drawer)",
        "OPEN(nightstand)",
        "PULL_OPEN(nightstand drawer)",
        "PULL_HANDLE(nightstand)",
        "SLIDE_OUT(nightstand drawer)",
    )
    instruction = "open the nightstand"
    goal = ("the nightstand drawer is wide open", "the hand has let go of the nightstand handle")
    split = "held-out"
    trick = "push in first"
    lesson = "Push the nightstand drawer in a little and it pops out by itself."
    thing = "nightstand"

    def changed(self, fixture: Body) -> Body:
        return with_joint(fixture, range=(-0.006, TRAVEL), stiffness=18.0, rest=0.30, friction=0.5, damping=12.0)

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return push_latch(self.joint, lowest=-0.006, pushed=-0.003)

    @property
    def reference_solution(self) -> str:
        return quirk_code("geometry", "slide", calls=f'push_in("{self.thing}")\n')
