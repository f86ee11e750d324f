"""Put the food in the pan and place it in the microwave: "it" is the pan with the food in it."""

from __future__ import annotations

import math

import numpy as np

from memo_core.plugin import Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Mishaps
from memo_tabletop.objects import PAN_APOTHEM, cameras, food, pan
from memo_tabletop.reference import solution
from memo_tabletop.tasks.microwave import PutTheFoodInTheMicrowave


class PutTheFoodInThePanAndPlaceItInTheMicrowave(Task):
    """Success: the food lies in the pan, the pan with its handle wholly in the microwave, both let go and at rest. The
    door may stay open or be shut again."""

    name = "put-the-food-in-the-pan-and-place-it-in-the-microwave"
    instruction = "put the food in the pan and place it in the microwave"
    goal = ("the food is in the pan", "the pan is in the microwave", "the hand has let go of the pan")
    kind = "SR"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        (furniture,) = PutTheFoodInTheMicrowave().cabinet(rng)
        x, y = np.array([0.52, -0.30]) + rng.uniform(-0.02, 0.02, 2)
        vessel = pan("pan", (x, y, 0.001), math.atan2(y, x) + rng.uniform(-0.25, 0.25))
        x, y = np.array([0.36, -0.40]) + rng.uniform(-0.02, 0.02, 2)
        loaf = food((x, y, 0.001), rng.uniform(-0.35, 0.35))
        front = furniture.pose.position
        return SceneDescription((furniture, vessel, loaf), cameras((front[0] - 0.05, front[1] - 0.05, 0.2)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(("food", "pan"), upright=("pan",)),)

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        mishaps = monitors["mishaps"]
        assert isinstance(mishaps, Mishaps)
        angle = world.joint_position("microwave/hinge")
        return checks.judge(
            "the pan with the food in it is in the microwave",
            [
                (self._food_in_pan(world), "the food is not in the pan"),
                (self._pan_inside(world), "the pan is not wholly inside the microwave"),
                (checks.upright(world, "pan"), "the pan does not stand level"),
                *checks.let_go(world, "pan"),
                *checks.let_go(world, "food"),
            ],
            {"door_rad": angle, "food_in_pan": float(self._food_in_pan(world))},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action == "OPEN" or action in checks.CLOSING:
            return PutTheFoodInTheMicrowave().check_subtask(subtask, world)
        if action in checks.PICKING:
            return checks.picked(world, ("food", "pan"), names)
        if action in checks.PLACING and names and names[0] in ("food", "pan"):
            there = self._food_in_pan(world) if names[0] == "food" else self._pan_inside(world)
            done = there and checks.released(world, names[0])
            return Outcome(done, f"the {names[0]} is {'' if done else 'not '}where it belongs")
        return None

    def _food_in_pan(self, world: WorldState) -> bool:
        """Whether no part of it reaches over the pan's inner wall, and it rests on the pan."""
        frame = world.body_pose("pan").inverse() * world.body_pose("food")
        low, high = checks.spread(food((0.0, 0.0, 0.0), 0.0), frame)
        return (
            checks.touches(world, "food", "pan")
            and math.hypot(*frame.position[:2]) < PAN_APOTHEM
            and bool(np.all(low[:2] > -PAN_APOTHEM) and np.all(high[:2] < PAN_APOTHEM))
            and frame.position[2] > 0
        )

    def _pan_inside(self, world: WorldState) -> bool:
        [furniture] = PutTheFoodInTheMicrowave().cabinet(np.random.default_rng(0))
        return checks.inside(world, "microwave", furniture.cavities[0], pan("pan", (0.0, 0.0, 0.0), 0.0))

    @property
    def reference_solution(self) -> str:
        calls = 'open_door("microwave", math.radians(88))\nput_in_pan("food", "pan")\nput_pan_in("pan", "microwave")\n'
        return solution("handling", "open_door", "take_out", "pan", calls=calls)
