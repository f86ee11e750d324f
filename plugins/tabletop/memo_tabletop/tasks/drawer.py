"""Put the cube away: into the drawer of a chest, which is shut again."""

from __future__ import annotations

import math
from importlib import resources
from typing import Any

import numpy as np

from memo_core.interfaces.simulator import WorldState
from memo_core.interfaces.task import Outcome, Task
from memo_core.scene.description import Body, SceneDescription
from memo_tabletop import judging
from memo_tabletop.furniture import Handle, chest
from memo_tabletop.things import RED, block, cameras

SIZE = (0.28, 0.30, 0.16)  # depth, width, height
PLINTH = 0.06  # m; lower, and a hand that closes vertically about the bar hits the table
SHUT_M = 0.015  # a drawer this far in looks shut
REACHED_INTO_M = 0.10  # a drawer this far out can be reached into


class PutTheCubeAway(Task):
    """Success: the cube lies in the drawer, let go and at rest, and the drawer is shut."""

    name = "put-the-cube-away"
    instruction = "put the cube away in the drawer"
    kind = "LH"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.45, -0.30]) + rng.uniform(-0.02, 0.02, 2)
        cube = block("cube", "cube", (x, y, 0.001), rng.uniform(-0.5, 0.5), (0.045, 0.045, 0.045), 0.08, RED)
        furniture = self._chest(rng)
        front = furniture.pose.position
        return SceneDescription((furniture, cube), cameras((front[0], front[1], 0.15)))

    def _chest(self, rng: np.random.Generator) -> Body:
        x, y = np.array([0.66, 0.10]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        return chest("chest", (x, y, 0.0), yaw, SIZE, PLINTH, Handle(length=0.12, distance=0.055, height=0.08), opens_to=0.18)

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        drawer = self._chest(np.random.default_rng(0)).bodies[0]
        cube = block("cube", "cube", (0, 0, 0), 0.0, (0.045, 0.045, 0.045), 0.08, RED)
        out = world.joint_position("chest/slide")
        measures = {"drawer_m": out}
        if not judging.wholly_in(world, drawer, drawer.cavities[0], "cube", cube.geoms[0]):
            return Outcome(False, "the cube is not in the drawer", measures)
        if out > SHUT_M:
            return Outcome(False, f"the drawer stands {out * 1000:.0f} mm open", measures)
        if not judging.at_rest(world, "cube") or not judging.released(world, "cube"):
            return Outcome(False, "the cube is held or still moving", measures)
        return Outcome(True, "the cube lies in the shut drawer", measures)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        out = world.joint_position("chest/slide")
        if subtask.upper().startswith("OPEN"):
            return Outcome(out >= REACHED_INTO_M, f"the drawer stands {out * 1000:.0f} mm open", {"drawer_m": out})
        if subtask.upper().startswith("CLOSE"):
            return Outcome(out <= SHUT_M, f"the drawer stands {out * 1000:.0f} mm open", {"drawer_m": out})
        return None

    @property
    def reference_solution(self) -> str:
        return resources.files("memo_tabletop.solutions").joinpath("put_the_cube_away.py").read_text(encoding="utf-8")
