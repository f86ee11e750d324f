"""Put the food in the microwave: its door swings about an upright edge."""

from __future__ import annotations

import math

import numpy as np

from memo_core.plugin import Body
from memo_tabletop.furniture import DARK, WHITE, DoorHinge, Handle, cabinet
from memo_tabletop.tasks.food_in_cabinet import FoodInCabinet

SIZE = (0.30, 0.36, 0.34)  # depth, width, height


class PutTheFoodInTheMicrowave(FoodInCabinet):
    """The door hangs on its left edge as the robot sees it."""

    name = "put-the-food-in-the-microwave"
    instruction = "put the food in the microwave"
    goal = ("the food is in the microwave", "the microwave door is wide open", "the hand has let go of the food")
    kind = "TR"
    cabinet_name = "microwave"

    def __init__(
        self,
        mirrored: bool = False,
        handle_height: float = 0.20,
        hinge_friction: float = 1.0,
        bar_friction: float = 0.8,
    ) -> None:
        """``mirrored`` hangs the door on the other edge, ``handle_height`` in m, ``hinge_friction`` in Nm."""
        self.hinge = DoorHinge("right" if mirrored else "left", math.radians(110), friction=hinge_friction, window=True)
        self.handle = Handle(length=0.16, distance=0.045, inset=0.03, height=handle_height, friction=bar_friction)
        side = 1.0 if mirrored else -1.0  # the food lies where the open door does not stand
        self.food_place = (0.45, side * 0.32)

    def cabinet(self, rng: np.random.Generator) -> tuple[Body, ...]:
        x, y = np.array([0.70, 0.0]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        return (cabinet("microwave", (x, y, 0.0), yaw, SIZE, self.hinge, self.handle, WHITE, DARK),)
