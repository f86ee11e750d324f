"""What the tasks of putting food into a microwave and into an oven have in common: a door to open and food to put
inside."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from memo_core.plugin import Body, Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.furniture import WALL, DoorHinge
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import cameras, food
from memo_tabletop.reference import solution

SHUT_RAD = math.radians(3)


class FoodInCabinet(Task):
    """Success: the door stands open so far that a hand can reach straight in, and the food lies inside, let go and at
    rest."""

    cabinet_name: str
    hinge: DoorHinge
    food_place: tuple[float, float] = (0.45, -0.32)

    def cabinet(self, rng: np.random.Generator) -> tuple[Body, ...]:
        """The cabinet first, then what it stands on."""
        raise NotImplementedError

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        furniture = self.cabinet(rng)
        x, y = self.food_place + rng.uniform(-0.02, 0.02, 2)
        loaf = food((x, y, 0.001), rng.uniform(-0.35, 0.35))
        front = furniture[0].pose.position
        return SceneDescription((*furniture, loaf), cameras((front[0], front[1], 0.25)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(("food",)),)

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        name, described = self.cabinet_name, self._described()
        angle = world.joint_position(f"{name}/hinge")
        passage = self._passage(angle, described)
        inside = checks.inside(world, name, described.cavities[0], food((0.0, 0.0, 0.0), 0.0))
        conditions = (
            (passage >= self._needed_passage(), f"the {name} door {checks.gap(passage)}"),
            (inside, f"the food is not wholly inside the {name}"),
            *checks.let_go(world, "food"),
        )
        measures = {"door_rad": angle, "passage_m": passage}
        return checks.judge(f"the food lies inside the open {name}", conditions, measures, story_of(monitors, world))

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        angle = world.joint_position(f"{self.cabinet_name}/hinge")
        door = f"the door stands at {math.degrees(angle):.0f} degrees"
        if action == "OPEN":
            wide = self._passage(angle, self._described()) >= self._needed_passage()
            return Outcome(wide, door, {"door_rad": angle})
        if action in checks.CLOSING:
            return Outcome(angle < SHUT_RAD, door, {"door_rad": angle})
        if action in checks.PICKING:
            return checks.picked(world, ("food",), names)
        if action in checks.PLACING and names and names[0] == "food":
            return self.check(world, {})
        return None

    def _described(self) -> Body:
        return self.cabinet(np.random.default_rng(0))[0]

    def _passage(self, angle: float, described: Body) -> float:
        extents = described.cavities[0].size
        clear = extents[2] if self.hinge.edge == "bottom" else extents[1]
        return checks.passage(angle, clear, clear + 2 * WALL)

    def _needed_passage(self) -> float:
        return checks.DROP_DOOR_PASSAGE_M if self.hinge.edge == "bottom" else checks.HAND_PASSAGE_M

    @property
    def reference_solution(self) -> str:
        name = self.cabinet_name
        calls = f'open_door("{name}", math.radians(88))\nput_inside("food", "{name}")\n'
        return solution("open_door", "put_inside", calls=calls)
