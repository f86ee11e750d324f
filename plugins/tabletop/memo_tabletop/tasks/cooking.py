"""Cook the food: the pan on the burner, the food in the pan, the knob turned."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from memo_core.plugin import Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.appliances import BURNER, BURNER_RADIUS, STOVE_SIZE, stove
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import PAN_APOTHEM, PAN_HEIGHT, cameras, food, pan
from memo_tabletop.reference import solution

ON_RAD = 0.35
ON_BURNER = 0.7  # share of the burner's radius within which the pan's middle is
TURNING = ("TURN_ON", "TURN", "ROTATE", "SWITCH_ON", "START")


class CookTheFood(Task):
    """Success: the pan stands on the burner with the food in it, both let go, and the knob is turned and stays so."""

    name = "cook-the-food"
    instruction = "cook the food"
    goal = ("the pan is on the stove", "the food is in the pan", "the stove knob is turned")
    kind = "SR"

    def __init__(self, knob_friction: float = 0.3) -> None:
        """``knob_friction`` in Nm."""
        self.knob_friction = knob_friction

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.42, 0.12]) + rng.uniform(-0.02, 0.02, 2)
        cooker = stove("stove", (x, y, 0.0), rng.uniform(-math.radians(5), math.radians(5)), self.knob_friction)
        u, v = np.array([0.45, -0.22]) + rng.uniform(-0.02, 0.02, 2)
        skillet = pan("pan", (u, v, 0.001), rng.uniform(-0.35, 0.35))
        s, t = np.array([0.56, -0.36]) + rng.uniform(-0.02, 0.02, 2)
        loaf = food((s, t, 0.001), rng.uniform(-0.35, 0.35))
        return SceneDescription((cooker, skillet, loaf), cameras((x, y - 0.1, 0.12)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(("pan", "food"), upright=("pan",)),)

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        angle, off = world.joint_position("stove/knob"), self._off_burner(world)
        measures = {"knob_rad": angle, "pan_to_burner_m": off}
        mishaps = story_of(monitors, world)
        conditions = (
            (self._on_burner(world), f"the pan does not stand on the burner but {off * 100:.0f} cm from its middle"),
            (self._in_pan(world), "the food is not in the pan"),
            (angle >= ON_RAD, f"the knob stands at {math.degrees(angle):.0f} degrees"),
            *checks.let_go(world, "pan"),
            *checks.let_go(world, "food"),
            (checks.released(world, "stove/dial"), "the robot still touches the knob"),
        )
        return checks.judge("the food is in the pan on the burner, which is on", conditions, measures, mishaps)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action in checks.PICKING:
            return checks.picked(world, ("pan", "food"), names)
        if action in checks.PLACING and names and names[0] == "pan":
            off = self._off_burner(world)
            done = self._on_burner(world) and checks.released(world, "pan")
            return Outcome(done, f"the pan's middle is {off * 100:.0f} cm from the burner's", {"pan_to_burner_m": off})
        if action in checks.PLACING and names and names[0] == "food":
            done = self._in_pan(world) and checks.released(world, "food")
            return Outcome(done, f"the food {'is' if done else 'is not'} in the pan")
        if action in TURNING:
            angle = world.joint_position("stove/knob")
            return Outcome(
                angle >= ON_RAD, f"the knob is turned by {math.degrees(angle):.0f} degrees", {"knob_rad": angle}
            )
        return None

    def _off_burner(self, world: WorldState) -> float:
        """Level distance of the pan's middle from the burner's (m)."""
        at = world.body_pose("stove").inverse().apply(np.asarray(world.body_pose("pan").position))
        return math.hypot(at[0] - BURNER[0], at[1] - BURNER[1])

    def _on_burner(self, world: WorldState) -> bool:
        at = world.body_pose("stove").inverse().apply(np.asarray(world.body_pose("pan").position))
        stands = (
            checks.upright(world, "pan") and abs(at[2] - STOVE_SIZE[2]) < 0.02 and checks.touches(world, "pan", "stove")
        )
        return stands and self._off_burner(world) <= ON_BURNER * BURNER_RADIUS

    def _in_pan(self, world: WorldState) -> bool:
        """Whether it rests in the pan: it touches it, and its middle is over the pan's floor, hardly above the rim."""
        at = world.body_pose("pan").inverse().apply(np.asarray(world.body_pose("food").position))
        over = math.hypot(at[0], at[1]) < PAN_APOTHEM and 0.0 < at[2] < PAN_HEIGHT + 0.005
        return over and checks.touches(world, "food", "pan")

    @property
    def reference_solution(self) -> str:
        calls = 'put_pan_on_burner()\nput_food_in(floor_of("pan"))\nturn_knob(math.radians(60))\n'
        return solution("cook", calls=calls)
