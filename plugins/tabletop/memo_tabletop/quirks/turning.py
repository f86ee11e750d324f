"""Caps and knobs that turn only while they are pressed."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from memo_core.plugin import (
    Above,
    AllOf,
    Below,
    Body,
    Colour,
    Geom,
    Hinge,
    Lock,
    Locked,
    Mechanism,
    Outcome,
    Pose,
    SceneDescription,
    Slide,
    Spring,
    WorldState,
)
from memo_tabletop import success_checks as checks
from memo_tabletop.furniture import DARK, STEEL, WHITE
from memo_tabletop.objects import cameras
from memo_tabletop.quirks.code import quirk_code
from memo_tabletop.quirks.task import QuirkTask

DEPTH = 0.006  # m a cap or knob goes down
PUSHED = -0.004  # m from where on it turns
TURNED_RAD = 1.3
CAP_OFF_M = 0.03
AMBER: Colour = (0.80, 0.45, 0.12, 1.0)


def pressed_turner(thing: str, label: str, geoms: tuple[Geom, ...], at: Pose, up: float) -> Body:
    """Goes down by ``DEPTH`` and up by ``up`` (joint ``THING/press``), and turns left (``THING/turn``)."""
    turner = Body(
        name=f"{thing}/turner",
        label=label,
        geoms=geoms,
        joint=Hinge(f"{thing}/turn", (0.0, 0.0, 1.0), range=(0.0, 1.7), friction=0.05, damping=0.05, armature=0.005),
        mass=0.03,
    )
    core = Geom("cylinder", (0.005, 0.01), collides=False)
    return Body(
        name=f"{thing}/carrier",
        geoms=(core,),
        pose=at,
        joint=Slide(f"{thing}/press", (0.0, 0.0, 1.0), range=(-DEPTH, up), damping=8.0, friction=0.2, armature=0.05),
        mass=0.02,
        bodies=(turner,),
    )


def press_to_turn(thing: str, stiffness: float) -> tuple[Mechanism, ...]:
    """Pressed down against a spring it turns; let up before it has turned far enough it springs back."""
    press, turn = f"{thing}/press", f"{thing}/turn"
    up = AllOf((Above(press, PUSHED + 0.001), Locked("thread")))
    return (
        Lock("thread", press, (-DEPTH, 0.0), until=Above(turn, TURNED_RAD)),
        Lock("child guard", turn, (0.0, 0.05), until=Below(press, PUSHED), again=up),
        Spring(press, stiffness, 0.003, when=Locked("thread")),
        Spring(turn, 0.4, -0.2, when=up),
        Lock("ratchet", turn, (TURNED_RAD - 0.1, 1.7), again=Above(turn, TURNED_RAD), engaged=False),
    )


class PressToTurn(QuirkTask):
    """What both have: a thing on the table with something on top that is turned from above."""

    thing: str
    turner: str  # what is turned is called
    trick = "press while turning"
    place: tuple[float, float]
    stiffness: float  # N/m of the spring below

    def fixture(self, place: tuple[float, float], yaw: float) -> Body:
        raise NotImplementedError

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.asarray(self.place) + rng.uniform(-0.03, 0.03, 2)
        body = self.fixture((x, y), rng.uniform(-0.3, 0.3))
        return SceneDescription((body,), cameras((x, y, 0.1)), mechanisms=press_to_turn(self.thing, self.stiffness))

    def turned(self, world: WorldState) -> float:
        return world.joint_position(f"{self.thing}/turn")

    def code(self, push: float) -> str:
        """Robot code that turns it from above while pressing with this force (N)."""
        raise NotImplementedError

    @property
    def plain_attempt(self) -> str:
        return self.code(0.0)

    @property
    def reference_solution(self) -> str:
        return self.code(20.0)


class OpenTheMedicineBottle(PressToTurn):
    """Success: the cap is off, well above the bottle's neck. The bottle stands in a clamp."""

    name = "open-the-medicine-bottle"
    needed_at: tuple[str, ...] = ("OPEN(medicine bottle)",)
    instruction = "open the medicine bottle"
    goal = ("the medicine bottle cap is off the medicine bottle",)
    lesson = "Press the cap of the medicine bottle down while you turn it."
    thing = "medicine bottle"
    turner = "cap"
    place = (0.50, -0.10)
    stiffness = 900.0
    height = 0.10

    def fixture(self, place: tuple[float, float], yaw: float) -> Body:
        clamp = Geom("box", (0.12, 0.12, 0.03), Pose((0.0, 0.0, 0.015)), DARK)
        glass = Geom("cylinder", (0.026, self.height - 0.03), Pose((0.0, 0.0, (self.height + 0.03) / 2)), AMBER)
        cap = (
            Geom("cylinder", (0.0175, 0.022), Pose((0.0, 0.0, 0.011)), WHITE),
            Geom("box", (0.008, 0.003, 0.001), Pose((0.012, 0.0, 0.0225)), DARK, collides=False),
        )
        on_top = Pose((0.0, 0.0, self.height + DEPTH + 0.001))
        return Body(
            name=self.thing,
            label=self.thing,
            fixture=True,
            geoms=(clamp, glass),
            pose=Pose.from_yaw((*place, 0.0), yaw),
            bodies=(pressed_turner(self.thing, f"{self.thing} cap", cap, on_top, up=0.15),),
            made_of="glass",
        )

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        up = world.joint_position(f"{self.thing}/press")
        turned = math.degrees(self.turned(world))
        conditions = ((up >= CAP_OFF_M, f"the cap is on the bottle, turned by {turned:.0f} degrees"),)
        return checks.judge("the cap is off the bottle", conditions, {"cap_m": up, "turned_rad": self.turned(world)})

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        return self.check(world, {}) if checks.read_subtask(subtask)[0] in ("OPEN", "REMOVE", "TAKE_OFF") else None

    def code(self, push: float) -> str:
        name = f"{self.thing} cap"
        return quirk_code("turn_top", calls=f'turn_top("{name}", math.radians(95), {push})\nrise(0.06)\n')


class TurnOnTheHeater(PressToTurn):
    """Success: the knob is turned as far as it goes when on, and stays."""

    name = "turn-on-the-heater"
    needed_at: tuple[str, ...] = (
        "TURN_ON(heater)",
        "TURN(heater knob)",
        "ROTATE(heater knob)",
        "SWITCH_ON(heater)",
        "TWIST_KNOB(heater)",
    )
    instruction = "turn on the heater"
    goal = ("the heater knob is turned", "the hand has let go of the heater knob")
    split = "held-out"
    lesson = "The heater's knob only turns while you push it down."
    thing = "heater"
    turner = "knob"
    place = (0.52, 0.12)
    stiffness = 1300.0

    def fixture(self, place: tuple[float, float], yaw: float) -> Body:
        height = 0.14
        box = Geom("box", (0.16, 0.30, height), Pose((0.0, 0.06, height / 2)), WHITE)
        ribs = tuple(
            Geom("box", (0.004, 0.02, height - 0.03), Pose((-0.081, y, height / 2)), STEEL, collides=False)
            for y in (-0.03, 0.01, 0.05, 0.09, 0.13, 0.17)
        )
        knob = (
            Geom("cylinder", (0.012, 0.008), Pose((0.0, 0.0, 0.004)), DARK),
            Geom("box", (0.050, 0.016, 0.026), Pose((0.0, 0.0, 0.021)), DARK),
        )
        # half of the turn to either side of straight ahead, which a hand from above can do
        on_top = Pose.from_yaw((0.0, 0.0, height + DEPTH + 0.001), -0.8)
        return Body(
            name=self.thing,
            label=self.thing,
            fixture=True,
            geoms=(box, *ribs),
            pose=Pose.from_yaw((*place, 0.0), yaw),
            bodies=(pressed_turner(self.thing, f"{self.thing} knob", knob, on_top, up=0.001),),
        )

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        turned = self.turned(world)
        conditions = (
            (turned >= TURNED_RAD - 0.1, f"the knob is turned by only {math.degrees(turned):.0f} degrees"),
            (checks.released(world, f"{self.thing}/turner"), "the robot still touches the knob"),
        )
        return checks.judge("the heater is on", conditions, {"turned_rad": turned})

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        return self.check(world, {}) if checks.read_subtask(subtask)[0] in ("TURN_ON", "TURN", "SWITCH_ON") else None

    def code(self, push: float) -> str:
        name = f"{self.thing} knob"
        return quirk_code(
            "turn_top", calls=f'turn_top("{name}", math.radians(95), {push})\nopen_gripper()\nrise(0.12)\n'
        )
