"""Put the food in the oven: its door drops down about its lower edge. Held out: nobody ever teaches this one."""

from __future__ import annotations

import math

import numpy as np

from memo_core.plugin import Body
from memo_tabletop.furniture import DARK, STEEL, DoorHinge, Handle, cabinet, stand
from memo_tabletop.tasks.food_in_cabinet import FoodInCabinet

SIZE = (0.32, 0.34, 0.27)  # depth, width, height
BOTTOM = 0.40  # m above the table; lower than 0.35, and the arm meets the table below the open door


class PutTheFoodInTheOven(FoodInCabinet):
    """The door stays where it is let go, as an oven's springs see to."""

    name = "put-the-food-in-the-oven"
    instruction = "put the food in the oven"
    goal = ("the food is in the oven", "the oven door is wide open", "the hand has let go of the food")
    kind = "CR"
    split = "held-out"
    cabinet_name = "oven"

    def __init__(self, hinge_friction: float = 1.2, handle_length: float = 0.20, bar_friction: float = 0.8) -> None:
        """``hinge_friction`` in Nm; less than 0.95 lets the door fall open by itself from some angle on."""
        self.hinge = DoorHinge("bottom", math.radians(95), friction=hinge_friction, mass=0.7, window=True)
        self.handle = Handle(length=handle_length, distance=0.05, inset=0.014, friction=bar_friction)

    def cabinet(self, rng: np.random.Generator) -> tuple[Body, ...]:
        x, y = np.array([0.68, 0.12]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        oven = cabinet("oven", (x, y, BOTTOM), yaw, SIZE, self.hinge, self.handle, STEEL, DARK, "steel")
        return oven, stand("stand", (x, y, 0.0), yaw, (SIZE[0], SIZE[1], BOTTOM))
