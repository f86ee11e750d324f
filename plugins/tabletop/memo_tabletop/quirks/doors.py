"""Doors with a vertical hinge and a peculiarity."""

from __future__ import annotations

import math

import numpy as np

from memo_core.plugin import Body, Colour, Mechanism, Vector, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.furniture import DARK, STEEL, WALL, WHITE, WOOD, DoorHinge, Handle, cabinet
from memo_tabletop.quirks.code import quirk_code
from memo_tabletop.quirks.fixtures import with_joint, with_lifting_handle
from memo_tabletop.quirks.latches import half_way_catch, lifted_bolt, push_latch
from memo_tabletop.quirks.opening import OpenAThing

OPENING = math.radians(88)


class OpenADoor(OpenAThing):
    """Success: the door stands open so far that a hand reaches straight in, still and let go."""

    mover, motion, still, looked_at = "door", "hinge", checks.AT_REST_RAD_S, 0.25
    size: Vector = (0.30, 0.36, 0.34)  # depth, width, height
    place: tuple[float, float] = (0.70, 0.0)
    hinge = DoorHinge("left", math.radians(110))
    handle = Handle(length=0.16, distance=0.045, inset=0.03, height=0.20)
    colours: tuple[Colour, Colour] = (WHITE, DARK)
    made_of = ""

    def furniture(self, rng: np.random.Generator) -> Body:
        x, y = np.asarray(self.place) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        return cabinet(
            self.thing, (x, y, 0.0), yaw, self.size, self.hinge, self.handle, *self.colours, made_of=self.made_of
        )

    def opened(self, world: WorldState) -> tuple[bool, str, dict[str, float]]:
        angle = world.joint_position(self.joint)
        width = checks.passage(angle, self.size[1] - 2 * WALL, self.size[1])
        wide = width >= checks.HAND_PASSAGE_M
        how = f"is open by {100 * width:.0f} cm" if wide else checks.gap(width)
        return wide, "is shut" if angle < math.radians(3) else how, {"door_rad": angle, "passage_m": width}

    @property
    def plain_attempt(self) -> str:
        return quirk_code(using=("open_door",), calls=f'open_door("{self.thing}", {OPENING})\n')


class OpenTheCupboard(OpenADoor):
    """A push latch: pushed in by 4 mm at the bar, the door springs open by itself."""

    name = "open-the-cupboard"
    needed_at: tuple[str, ...] = ("OPEN(cupboard)",)
    instruction = "open the cupboard"
    goal = ("the cupboard door is wide open", "the hand has let go of the cupboard handle")
    trick = "push in first"
    lesson = "Push the cupboard door in first, then it springs open by itself."
    thing = "cupboard"
    handle = Handle(length=0.12, distance=0.045, inset=0.03, height=0.22)
    colours, made_of = (WOOD, WOOD), "wood"

    def changed(self, fixture: Body) -> Body:
        joint = {"range": (-0.02, self.hinge.opens_to), "stiffness": 0.55, "rest": 2.5, "friction": 0.1}
        return with_joint(fixture, **joint)

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return push_latch(self.joint, lowest=-0.02, pushed=-0.012)

    @property
    def reference_solution(self) -> str:
        return quirk_code("geometry", "push_open", calls=f'push_open("{self.thing}")\n')


class OpenTheLocker(OpenADoor):
    """A bolt that the handle draws: it must be lifted before the door can be pulled."""

    name = "open-the-locker"
    needed_at: tuple[str, ...] = ("OPEN(locker)",)
    instruction = "open the locker"
    goal = ("the locker door is wide open", "the hand has let go of the locker handle")
    trick = "lift the handle"
    lesson = "You have to lift the locker's handle up before you pull the door."
    thing = "locker"
    colours, made_of = (STEEL, STEEL), "steel"

    def changed(self, fixture: Body) -> Body:
        return with_lifting_handle(fixture, 0.03)

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return lifted_bolt(self.thing, self.joint, play=0.012)

    @property
    def reference_solution(self) -> str:
        return quirk_code("geometry", "swing", "lift_and_open", calls=f'lift_and_open("{self.thing}")\n')


class OpenTheWardrobe(OpenADoor):
    """The door catches half-way; eased back and pulled a second time it comes free."""

    name = "open-the-wardrobe"
    needed_at: tuple[str, ...] = (
        "OPEN(wardrobe)",
        "PULL(wardrobe door)",
        "SWING_OPEN(wardrobe door)",
        "PULL_HANDLE(wardrobe)",
    )
    instruction = "open the wardrobe"
    goal = ("the wardrobe door is wide open", "the hand has let go of the wardrobe handle")
    split = "held-out"
    trick = "sticks half-way"
    lesson = "The wardrobe door sticks halfway, let it come back a little and pull a second time."
    thing = "wardrobe"
    size = (0.30, 0.36, 0.50)
    place = (0.72, 0.05)
    hinge = DoorHinge("left", math.radians(115))
    handle = Handle(length=0.20, distance=0.045, inset=0.03, height=0.30)
    colours, made_of = (WOOD, WOOD), "wood"

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return half_way_catch(self.joint, stop=0.68, strain=0.06, hard=0.12, stiffness=60.0)

    @property
    def reference_solution(self) -> str:
        return quirk_code("geometry", "swing", "second_pull", calls=f'open_door_twice("{self.thing}", 0.72)\n')


class OpenTheMedicineCabinet(OpenADoor):
    """The bar sits 10 cm from the hinge, on its side of the door."""

    name = "open-the-medicine-cabinet"
    needed_at: tuple[str, ...] = ("OPEN(medicine cabinet)",)
    instruction = "open the medicine cabinet"
    goal = ("the medicine cabinet door is wide open", "the hand has let go of the medicine cabinet handle")
    trick = "hinge on the handle's side"
    lesson = "The hinge is on the same side as the handle, so swing it around that edge."
    thing = "medicine cabinet"
    handle = Handle(length=0.16, distance=0.045, inset=0.26, height=0.20)
    colours = (WHITE, WHITE)

    @property
    def reference_solution(self) -> str:
        return quirk_code("geometry", "swing", "near_hinge", calls=f'open_near_hinge("{self.thing}")\n')


class OpenTheFreezer(OpenTheMedicineCabinet):
    """The same on a taller body, mirrored."""

    name = "open-the-freezer"
    needed_at: tuple[str, ...] = (
        "OPEN(freezer)",
        "PULL(freezer door)",
        "SWING_OPEN(freezer door)",
        "PULL_HANDLE(freezer)",
    )
    instruction = "open the freezer"
    goal = ("the freezer door is wide open", "the hand has let go of the freezer handle")
    split = "held-out"
    thing = "freezer"
    size = (0.30, 0.36, 0.50)
    place = (0.72, 0.05)
    hinge = DoorHinge("right", math.radians(115))
    handle = Handle(length=0.20, distance=0.045, inset=0.26, height=0.30)
    colours = (WHITE, STEEL)
