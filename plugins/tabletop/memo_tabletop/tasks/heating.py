"""Heat the food: into the microwave, the door shut, then the button."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import Body, Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.appliances import button_panel
from memo_tabletop.furniture import DARK, GAP, PANEL, WHITE, DoorHinge, Handle, cabinet
from memo_tabletop.monitors import Mishaps
from memo_tabletop.objects import cameras, food
from memo_tabletop.reference import solution

SIZE = (0.30, 0.36, 0.34)  # depth, width, height
PANEL_WIDTH = 0.09  # m
BUTTON_HEIGHT = 0.16  # m above the table
PRESSED_M = 0.005
LET_OUT_M = 0.002  # a button this far in counts as let out
SHUT_RAD = math.radians(3)


class HeatTheFood(Task):
    """Success: the button was pressed, from its rest, while the food lay in the microwave and the door was shut; both
    are still so."""

    name = "heat-the-food"
    instruction = "heat the food"
    goal = (
        "the food is in the microwave",
        "the microwave door is closed",
        "the microwave button was pressed while the microwave door was closed",
    )
    kind = "SR"

    def __init__(self, handle_height: float = 0.20, hinge_friction: float = 1.0, bar_friction: float = 0.8) -> None:
        """``handle_height`` in m, ``hinge_friction`` in Nm."""
        self.hinge = DoorHinge("left", math.radians(110), friction=hinge_friction, window=True)
        self.handle = Handle(length=0.16, distance=0.045, inset=0.03, height=handle_height, friction=bar_friction)

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        machine = self._microwave(rng)
        x, y = np.array([0.45, -0.32]) + rng.uniform(-0.02, 0.02, 2)
        loaf = food((x, y, 0.001), rng.uniform(-0.35, 0.35))
        front = machine.pose.position
        return SceneDescription((machine, loaf), cameras((front[0], front[1], 0.25)))

    def _microwave(self, rng: np.random.Generator) -> Body:
        x, y = np.array([0.70, 0.04]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        machine = cabinet("microwave", (x, y, 0.0), yaw, SIZE, self.hinge, self.handle, WHITE, DARK)
        depth, width, height = SIZE
        front = -GAP - PANEL  # flush with the door
        at = (front, -(width + PANEL_WIDTH) / 2 - GAP, 0.0)
        parts = button_panel("microwave", at, (depth - front, PANEL_WIDTH, height), BUTTON_HEIGHT)
        return attrs.evolve(machine, bodies=(*machine.bodies, *parts))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Started(self._holds), Mishaps(("food",)))

    def _holds(self, world: WorldState) -> bool:
        """Whether the food lies inside and the door is shut."""
        return world.joint_position("microwave/hinge") < SHUT_RAD and self._inside(world)

    def _inside(self, world: WorldState) -> bool:
        described = self._microwave(np.random.default_rng(0))
        return checks.inside(world, "microwave", described.cavities[0], food((0.0, 0.0, 0.0), 0.0))

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        door = world.joint_position("microwave/hinge")
        measures = {"door_rad": door, "button_m": world.joint_position("microwave/press")}
        started, mishaps = monitors["started"], monitors["mishaps"].story(world)
        why = "the button was not pressed"
        if started.idle:
            why = "the button was pressed, but not with the food inside and the door shut"
        conditions = (
            (self._inside(world), "the food is not inside the microwave"),
            (door < SHUT_RAD, f"the door stands at {math.degrees(door):.0f} degrees"),
            (started.done, why),
            *checks.let_go(world, "food"),
            (checks.released(world, "microwave/button"), "the robot still touches the button"),
        )
        return checks.judge("the food is in the microwave, which was started", conditions, measures, mishaps)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        door = world.joint_position("microwave/hinge")
        measures, told = {"door_rad": door}, f"the door stands at {math.degrees(door):.0f} degrees"
        if action == "OPEN":
            clear = checks.passage(door, SIZE[1] - 0.024, SIZE[1])
            return Outcome(clear >= checks.HAND_PASSAGE_M, told, measures)
        if action in checks.CLOSING:
            return Outcome(door < SHUT_RAD, told, measures)
        if action in checks.PICKING:
            return checks.picked(world, ("food",), names)
        if action in checks.PLACING and names and names[0] == "food":
            done = self._inside(world) and checks.released(world, "food") and checks.at_rest(world, "food")
            return Outcome(done, f"the food {'lies' if done else 'does not lie'} inside the microwave", measures)
        return None

    @property
    def reference_solution(self) -> str:
        calls = (
            'open_door("microwave", math.radians(88))\nput_inside("food", "microwave")\nlook()\n'
            'out = get_opening("microwave inside")\nclose_door("microwave")\npress_button("microwave", out)\n'
        )
        return solution("open_door", "put_inside", "close_door", "press_button", calls=calls)


class Started(Monitor):
    """Whether the button has gone from its rest to its stop while ``holds`` was true; ``idle``: while it was not."""

    name = "started"

    def __init__(self, holds) -> None:
        self._holds = holds
        self.armed, self.done, self.idle = True, False, False

    def reset(self, world: WorldState) -> None:
        self.armed, self.done, self.idle = True, False, False

    def update(self, world: WorldState) -> None:
        depth = world.joint_position("microwave/press")
        if depth < LET_OUT_M:
            self.armed = True
        elif self.armed and depth >= PRESSED_M:
            self.armed = False
            if self._holds(world):
                self.done = True
            else:
                self.idle = True

    def memory(self) -> dict[str, Any]:
        return {"armed": self.armed, "done": self.done, "idle": self.idle}

    def recall(self, memory: dict[str, Any]) -> None:
        self.armed, self.done, self.idle = memory["armed"], memory["done"], memory["idle"]
