"""Open the fridge: a tall door on an upright edge, milk on a shelf behind it."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import Monitor, Outcome, SceneDescription, Task, WorldState, shelf
from memo_tabletop import success_checks as checks
from memo_tabletop.furniture import STEEL, WALL, WHITE, DoorHinge, Handle, cabinet
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import BLUE, block, cameras
from memo_tabletop.reference import solution

SIZE = (0.30, 0.36, 0.50)  # depth, width, height
SHELF = 0.22  # m, top of the shelf above the table
SHELF_DEPTH = 0.09


class OpenTheFridge(Task):
    """Success: the door stands open so far that a hand with the milk in it comes straight out, and the hand has let go
    of the door."""

    name = "open-the-fridge"
    instruction = "open the fridge"
    goal = ("the fridge door is wide open", "the hand has let go of the fridge handle")
    kind = "TR"

    def __init__(
        self,
        mirrored: bool = False,
        handle_height: float = 0.30,
        hinge_friction: float = 1.0,
        bar_friction: float = 0.8,
    ) -> None:
        """``mirrored`` hangs the door on the other edge, ``handle_height`` in m, ``hinge_friction`` in Nm."""
        self.hinge = DoorHinge("right" if mirrored else "left", math.radians(115), friction=hinge_friction)
        self.handle = Handle(length=0.20, distance=0.045, inset=0.03, height=handle_height, friction=bar_friction)

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.72, 0.05]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        fridge = cabinet("fridge", (x, y, 0.0), yaw, SIZE, self.hinge, self.handle, WHITE, STEEL)
        board = shelf(SIZE, WALL, SHELF, SHELF_DEPTH)
        fridge = attrs.evolve(fridge, geoms=(*fridge.geoms, board))
        place = fridge.pose.apply((SIZE[0] - WALL - SHELF_DEPTH / 2, 0.0, SHELF + 0.001))
        milk = block("milk", "milk", tuple(place), yaw, (0.05, 0.05, 0.11), 0.25, BLUE)
        return SceneDescription((fridge, milk), cameras((x, y, 0.25)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(("milk",), upright=("milk",)),)

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        angle = world.joint_position("fridge/hinge")
        width = checks.passage(angle, SIZE[1] - 2 * WALL, SIZE[1])
        conditions = (
            (width >= checks.HAND_PASSAGE_M, f"the fridge door {checks.gap(width)}"),
            (checks.released(world, "fridge/door"), "the robot still touches the door"),
            (abs(world.joint_velocity("fridge/hinge")) < checks.AT_REST_RAD_S, "the door is still moving"),
        )
        done, measures = f"the fridge stands open, {width:.2f} m wide", {"door_rad": angle, "passage_m": width}
        return checks.judge(done, conditions, measures, story_of(monitors, world))

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        return self.check(world, {}) if checks.read_subtask(subtask)[0] == "OPEN" else None

    @property
    def reference_solution(self) -> str:
        return solution("open_door", calls='open_door("fridge", math.radians(88))\n')
