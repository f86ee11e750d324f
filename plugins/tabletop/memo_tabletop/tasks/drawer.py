"""Put the cube away: into the drawer of a chest, which is shut again."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from memo_core.plugin import Body, Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.furniture import Handle, chest
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import RED, block, cameras
from memo_tabletop.reference import solution

SIZE = (0.28, 0.30, 0.16)  # depth, width, height
PLINTH = 0.06  # m; lower, and a hand that closes vertically about the bar hits the table
SHUT_M = 0.015  # a drawer this far in looks shut
REACHED_INTO_M = 0.10  # a drawer this far out can be reached into


class PutTheCubeAway(Task):
    """Success: the cube lies in the drawer, let go and at rest, and the drawer is shut."""

    name = "put-the-cube-away"
    instruction = "put the cube away"
    goal = ("the cube is in the drawer", "the drawer is closed")
    kind = "LH"

    def __init__(self, handle_height: float = 0.08, handle_length: float = 0.12, bar_friction: float = 0.8) -> None:
        self.handle = Handle(length=handle_length, distance=0.055, height=handle_height, friction=bar_friction)

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.45, -0.30]) + rng.uniform(-0.02, 0.02, 2)
        cube = block("cube", "cube", (x, y, 0.001), rng.uniform(-0.5, 0.5), (0.045, 0.045, 0.045), 0.08, RED)
        furniture = self._chest(rng)
        front = furniture.pose.position
        return SceneDescription((furniture, cube), cameras((front[0], front[1], 0.15)))

    def _chest(self, rng: np.random.Generator) -> Body:
        x, y = np.array([0.66, 0.10]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        return chest("chest", (x, y, 0.0), yaw, SIZE, PLINTH, self.handle, opens_to=0.18)

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(("cube",)),)

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        out = world.joint_position("chest/slide")
        conditions = (
            (self._inside(world), "the cube is not in the drawer"),
            (out <= SHUT_M, f"the drawer stands {out * 1000:.0f} mm open"),
            *checks.let_go(world, "cube"),
        )
        story = story_of(monitors, world)
        return checks.judge("the cube lies in the shut drawer", conditions, {"drawer_m": out}, story)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        out = world.joint_position("chest/slide")
        measures = {"drawer_m": out}
        if action == "OPEN":
            return Outcome(out >= REACHED_INTO_M, f"the drawer stands {out * 1000:.0f} mm open", measures)
        if action in checks.CLOSING:
            return Outcome(out <= SHUT_M, f"the drawer stands {out * 1000:.0f} mm open", measures)
        if action in checks.PICKING:
            return checks.picked(world, ("cube",), names)
        if action in checks.PLACING and names and names[0] == "cube":
            done = self._inside(world) and checks.at_rest(world, "cube") and checks.released(world, "cube")
            return Outcome(done, f"the cube {'lies' if done else 'does not lie'} in the drawer", measures)
        return None

    def _inside(self, world: WorldState) -> bool:
        drawer = self._chest(np.random.default_rng(0)).bodies[0]
        cube = block("cube", "cube", (0, 0, 0), 0.0, (0.045, 0.045, 0.045), 0.08, RED)
        return checks.inside(world, drawer.name, drawer.cavities[0], cube)

    @property
    def reference_solution(self) -> str:
        return solution("put_the_cube_away", calls="pull(0.16)\nput_in()\npush_shut()\n")
