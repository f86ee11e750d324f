"""Lids and doors that a button opens, if it is held long enough."""

from __future__ import annotations

import math
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import (
    Body,
    Cavity,
    Colour,
    Geom,
    Hinge,
    Mechanism,
    Outcome,
    Pose,
    Slide,
    Vector,
    WorldState,
    shell,
)
from memo_tabletop import success_checks as checks
from memo_tabletop.appliances import CHROME, LYING_ALONG_X
from memo_tabletop.furniture import DARK, STEEL, WHITE, DoorHinge, Handle
from memo_tabletop.quirks.code import quirk_code
from memo_tabletop.quirks.doors import OpenADoor
from memo_tabletop.quirks.fixtures import with_joint
from memo_tabletop.quirks.latches import button_latch
from memo_tabletop.quirks.opening import OpenAThing

TRAVEL = 0.008  # m
PRESSED = 0.005  # m
SECONDS = 2.0
LID_OPEN_RAD = math.radians(60)  # a hand from above reaches in past a lid that stands like this
WALL = 0.008  # m


def button(thing: str, at: Vector, colour: Colour = CHROME) -> Body:
    """A round button that is pressed along +x, away from the robot; its joint is ``THING/press``."""
    return Body(
        name=f"{thing}/button",
        label=f"{thing} button",
        geoms=(Geom("cylinder", (0.016, 0.024), Pose((0.0, 0.0, 0.0), LYING_ALONG_X), colour),),
        pose=Pose(at),
        joint=Slide(
            f"{thing}/press", (1.0, 0.0, 0.0), (0.0, TRAVEL), damping=5.0, stiffness=400.0, rest=-0.004, armature=0.05
        ),
        mass=0.05,
    )


class OpenTheRiceCooker(OpenAThing):
    """Success: the lid stands up, still, and the robot touches neither lid nor button."""

    name = "open-the-rice-cooker"
    needed_at: tuple[str, ...] = ("OPEN(rice cooker)",)
    instruction = "open the rice cooker"
    goal = ("the rice cooker lid is wide open",)
    trick = "hold the button"
    lesson = "You have to keep the rice cooker's button pressed for two seconds until the lid pops up."
    thing = "rice cooker"
    mover, motion, still, looked_at = "lid", "hinge", checks.AT_REST_RAD_S, 0.15
    size: Vector = (0.22, 0.22, 0.15)  # depth, width, height without the lid

    def furniture(self, rng: np.random.Generator) -> Body:
        x, y = np.array([0.55, 0.0]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-math.radians(5), math.radians(5))
        depth, width, height = self.size
        hollow = (depth - 2 * WALL, width - 2 * WALL, height - WALL)
        lid = Body(
            name=f"{self.thing}/lid",
            label=f"{self.thing} lid",
            geoms=(Geom("box", (depth, width, 0.014), Pose((-depth / 2, 0.0, 0.007)), STEEL),),
            pose=Pose((depth, 0.0, height + 0.002)),
            joint=Hinge(
                self.joint,
                (0.0, 1.0, 0.0),
                range=(0.0, 1.45),
                friction=0.02,
                damping=0.35,
                stiffness=0.35,
                rest=2.6,
            ),
            mass=0.2,
        )
        middle = Pose((depth / 2, 0.0, (height + WALL) / 2))
        inside = Cavity(
            f"{self.thing}/inside",
            f"{self.thing} inside",
            middle,
            hollow,
            (0.0, 0.0, 1.0),
            self.joint,
            closed_within=0.3,
        )
        return Body(
            name=self.thing,
            label=self.thing,
            fixture=True,
            geoms=shell(self.size, WALL, "top", colour=WHITE),
            pose=Pose.from_yaw((x, y, 0.0), yaw),
            cavities=(inside,),
            bodies=(lid, button(self.thing, (-0.004, 0.0, 0.07))),
        )

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return button_latch(self.joint, 1.45, f"{self.thing}/press", PRESSED, SECONDS)

    def opened(self, world: WorldState) -> tuple[bool, str, dict[str, float]]:
        angle = world.joint_position(self.joint)
        how = "is shut" if angle < 0.03 else f"stands at {math.degrees(angle):.0f} degrees"
        return angle >= LID_OPEN_RAD, how, {"lid_rad": angle}

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        outcome = super().check(world, monitors)
        if outcome.success and not checks.released(world, f"{self.thing}/button"):
            return Outcome(False, "the robot still touches the button", outcome.measures)
        return outcome

    @property
    def plain_attempt(self) -> str:
        return quirk_code("geometry", "hold_button", calls=f'hold_button("{self.thing}", 0.3)\nwait(1.0)\n')

    @property
    def reference_solution(self) -> str:
        return quirk_code("geometry", "hold_button", calls=f'hold_button("{self.thing}", 2.2)\nwait(1.5)\nlook()\n')


class OpenTheSafe(OpenADoor):
    """A button beside the door; held, the door springs open by itself."""

    name = "open-the-safe"
    needed_at: tuple[str, ...] = (
        "PRESS(safe button)",
        "PUSH(safe button)",
        "OPEN(safe)",
        "HOLD(safe button)",
        "PRESS_BUTTON(safe)",
        "UNLOCK(safe)",
    )
    instruction = "open the safe"
    goal = ("the safe door is wide open",)
    split = "held-out"
    trick = "hold the button"
    lesson = "Keep the safe's button pressed for two seconds, then the door opens by itself."
    thing = "safe"
    size = (0.30, 0.34, 0.30)
    place = (0.70, 0.06)
    hinge = DoorHinge("left", math.radians(110))
    handle = Handle(length=0.12, distance=0.045, inset=0.03, height=0.18)
    colours = (DARK, DARK)

    def changed(self, fixture: Body) -> Body:
        fixture = with_joint(fixture, stiffness=0.55, rest=2.5, friction=0.1)
        width = self.size[1]
        # so far from the handle that a hand before the button does not touch it
        keypad = Geom("box", (0.08, 0.14, 0.16), Pose((0.04, -width / 2 - 0.075, 0.08)), STEEL)
        press = button(self.thing, (-0.004, -width / 2 - 0.105, 0.11))
        panel = Body(f"{self.thing}/panel", (keypad,), bodies=(press,))
        return attrs.evolve(fixture, bodies=(*fixture.bodies, panel))

    def mechanisms(self) -> tuple[Mechanism, ...]:
        return button_latch(self.joint, self.hinge.opens_to, f"{self.thing}/press", PRESSED, SECONDS)

    @property
    def plain_attempt(self) -> str:
        calls = f'hold_button("{self.thing}", 0.3)\nopen_door("{self.thing}", math.radians(88))\n'
        return quirk_code("geometry", "hold_button", using=("open_door",), calls=calls)

    @property
    def reference_solution(self) -> str:
        return quirk_code("geometry", "hold_button", calls=f'hold_button("{self.thing}", 2.2)\nwait(3.0)\nlook()\n')
