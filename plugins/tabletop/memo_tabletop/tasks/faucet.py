"""Turn on the faucet: push its lever aside."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from memo_core.plugin import Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.appliances import Lever, faucet
from memo_tabletop.objects import cameras
from memo_tabletop.reference import solution

ON_RAD = 0.25
TURNING = ("TURN_ON", "OPEN", "TURN", "PUSH", "ROTATE")


class TurnOnTheFaucet(Task):
    """Success: the lever has been turned by a quarter radian or more and stays there, let go."""

    name = "turn-on-the-faucet"
    instruction = "turn on the faucet"
    goal = ("the faucet lever is turned", "the hand has let go of the faucet lever")
    kind = "TR"

    def __init__(self, mirrored: bool = False, friction: float = 0.8, length: float = 0.08) -> None:
        """``mirrored``: the lever goes to the right; ``friction`` in Nm, ``length`` of the lever in m."""
        self.lever = Lever(length, "right" if mirrored else "left", friction=friction)

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.60, 0.05]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        return SceneDescription((faucet("faucet", (x, y, 0.0), yaw, self.lever),), cameras((x - 0.1, y, 0.15)))

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        angle = world.joint_position("faucet/lever")
        measures = {"lever_rad": angle}
        if angle < ON_RAD:
            return Outcome(False, f"the lever stands at {math.degrees(angle):.0f} degrees: hardly a drop", measures)
        if not checks.released(world, "faucet/handle"):
            return Outcome(False, "the robot still touches the lever", measures)
        if abs(world.joint_velocity("faucet/lever")) > checks.AT_REST_RAD_S:
            return Outcome(False, "the lever is still moving", measures)
        return Outcome(True, f"the lever stands at {math.degrees(angle):.0f} degrees: the water runs", measures)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        return self.check(world, {}) if checks.read_subtask(subtask)[0] in TURNING else None

    @property
    def reference_solution(self) -> str:
        side = 1 if self.lever.turns == "left" else -1
        return solution("turn_lever", calls=f'turn_lever("faucet", {side}, math.radians(50))\n')
