"""Thin-walled objects that collapse when gripped too hard, and stay collapsed."""

from __future__ import annotations

import math

import numpy as np

from memo_core.plugin import (
    Above,
    Body,
    Colour,
    Free,
    Geom,
    Lasting,
    Lock,
    Mechanism,
    Monitor,
    Outcome,
    Pose,
    Pressed,
    SceneDescription,
    Slide,
    Vector,
    WorldState,
)
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import RED, cameras
from memo_tabletop.quirks.code import quirk_code
from memo_tabletop.quirks.task import QuirkTask

GIVES_WAY_N = 30.0  # of one finger
DENT = 0.010  # m a wall goes in at most
KEPT_DENT = 0.007  # m from which on it stays
BULGE_M = 0.003  # a wall this far in is seen to be crushed
WALL = 0.003  # m
TRAY: Colour = (0.45, 0.30, 0.18, 1.0)


def thin_walled(
    name: str, place: Vector, yaw: float, apothem: float, height: float, sides: int, mass: float, colour: Colour
) -> Body:
    """A can (or, with four sides, a carton) that stands at ``place``: a slim core and around it walls on short slides
    ``NAME/wall N`` that can be pressed in. ``apothem`` (m) is to the walls' outer faces."""
    slim = apothem - DENT - WALL - 0.001
    core = Geom("cylinder", (slim, height - 0.002), Pose((0.0, 0.0, height / 2)), colour, mass=0.7 * mass)
    # Narrow enough that one wall can go in without touching its neighbours.
    width = 2 * (apothem - WALL - DENT) * math.tan(math.pi / sides) - 0.002
    return Body(
        name=name,
        label=name,
        geoms=(core,),
        pose=Pose.from_yaw(place, yaw),
        joint=Free(),
        bodies=tuple(_wall(name, i, sides, apothem, (width, height), 0.3 * mass / sides, colour) for i in range(sides)),
    )


def _wall(
    name: str,
    number: int,
    sides: int,
    apothem: float,
    size: tuple[float, float],
    mass: float,
    colour: Colour,
) -> Body:
    """``size`` is (width, height) of what others touch; drawn, the walls meet. They are what it stands on."""
    width, height = size
    angle = 2 * math.pi * number / sides
    panel = Geom("box", (WALL, width, height), colour=colour)
    full = 2 * apothem * math.tan(math.pi / sides)
    look = Geom("box", (WALL, full, height - 0.002), Pose((0.0005, 0.0, 0.0)), colour, collides=False)
    middle = apothem - WALL / 2
    at = Pose.from_yaw((middle * math.cos(angle), middle * math.sin(angle), height / 2), angle)
    joint = Slide(
        f"{name}/wall {number}", (-1.0, 0.0, 0.0), range=(0.0, DENT), stiffness=300.0, rest=-0.002, damping=4.0
    )
    return Body(name=f"{name}/side {number}", geoms=(panel, look), pose=at, joint=joint, mass=mass)


def gives_way(name: str, sides: int) -> tuple[Mechanism, ...]:
    """The walls hold until one finger presses with ``GIVES_WAY_N``; a wall pressed in by 7 mm stays in."""
    too_hard = Lasting(Pressed(name, GIVES_WAY_N), 0.05)
    found: list[Mechanism] = []
    for i in range(sides):
        joint = f"{name}/wall {i}"
        found.append(Lock(f"stiffness {i}", joint, (0.0, 0.0), until=too_hard))
        found.append(Lock(f"dent {i}", joint, (KEPT_DENT, DENT), again=Above(joint, KEPT_DENT), engaged=False))
    return tuple(found)


class CarryAThinThing(QuirkTask):
    """Success: it stands on the tray or board, intact, released and at rest."""

    trick = "collapses when held hard"
    thing: str
    target: str
    apothem: float
    height: float
    sides: int
    colour: Colour
    target_size: Vector
    target_colour: Colour

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.45, -0.22]) + rng.uniform(-0.04, 0.04, 2)
        thing = thin_walled(
            self.thing,
            (x, y, 0.001),
            rng.uniform(-0.4, 0.4),
            self.apothem,
            self.height,
            self.sides,
            0.10,
            self.colour,
        )
        x, y = np.array([0.50, 0.18]) + rng.uniform(-0.03, 0.03, 2)
        size = self.target_size
        board = Body(
            self.target,
            (Geom("box", size, Pose((0.0, 0.0, size[2] / 2)), self.target_colour),),
            Pose.from_yaw((x, y, 0.0), rng.uniform(-0.3, 0.3)),
            label=self.target,
            fixture=True,
        )
        return SceneDescription(
            (thing, board), cameras((0.45, 0.0, 0.05)), mechanisms=gives_way(self.thing, self.sides)
        )

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps((self.thing,), upright=(self.thing,)),)

    def dent(self, world: WorldState) -> float:
        """How far the wall that is in farthest is in (m)."""
        return max(world.joint_position(f"{self.thing}/wall {i}") for i in range(self.sides))

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        local = world.body_pose(self.target).inverse().apply(np.asarray(world.body_pose(self.thing).position))
        over = all(abs(v) < extent / 2 for v, extent in zip(local[:2], self.target_size[:2], strict=True))
        dent = self.dent(world)
        conditions = (
            (dent < BULGE_M, f"the {self.thing} is crushed"),
            (
                over and checks.touches(world, self.thing, self.target),
                f"the {self.thing} is not on the {self.target}",
            ),
            (checks.upright(world, self.thing), f"the {self.thing} does not stand upright"),
            *checks.let_go(world, self.thing),
        )
        done = f"the {self.thing} stands whole on the {self.target}"
        return checks.judge(done, conditions, {"dent_m": dent}, story_of(monitors, world))

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if not names or names[0] != self.thing:
            return None
        if action in checks.PICKING:
            if self.dent(world) >= BULGE_M:
                return Outcome(False, f"the {self.thing} is crushed")
            return checks.picked(world, (self.thing,), names)
        return self.check(world, {}) if action in checks.PLACING else None

    def code(self, force: str) -> str:
        calls = f'carry("{self.thing}", "{self.target}", {force})\n'
        return quirk_code("carry_gently", using=("handling",), calls=calls)

    @property
    def plain_attempt(self) -> str:
        return self.code("None")

    @property
    def reference_solution(self) -> str:
        return self.code("12")


class PutTheCanOnTheTray(CarryAThinThing):
    """An empty can, round."""

    name = "put-the-can-on-the-tray"
    needed_at: tuple[str, ...] = ("PLACE(can, tray)",)
    instruction = "put the can on the tray"
    goal = (
        "the can is on the tray",
        "the can is not crushed",
        "the can stands upright",
        "the hand has let go of the can",
    )
    lesson = "The can is very thin, grip it only lightly or it gets crushed."
    thing = "can"
    target = "tray"
    apothem, height, sides = 0.031, 0.11, 8
    colour = RED
    target_size = (0.20, 0.26, 0.012)
    target_colour = TRAY


class PutTheCartonOnTheBoard(CarryAThinThing):
    """An empty carton, square."""

    name = "put-the-carton-on-the-board"
    needed_at: tuple[str, ...] = (
        "PICK_UP(carton)",
        "GRASP(carton)",
        "LIFT(carton)",
        "PLACE(carton, board)",
        "MOVE(carton, board)",
        "TAKE(carton)",
    )
    instruction = "put the carton on the board"
    goal = (
        "the carton is on the board",
        "the carton is not crushed",
        "the carton stands upright",
        "the hand has let go of the carton",
    )
    split = "held-out"
    lesson = "Hold the carton gently, it collapses if you squeeze it."
    thing = "carton"
    target = "board"
    apothem, height, sides = 0.027, 0.13, 4
    colour = (0.90, 0.88, 0.80, 1.0)
    target_size = (0.22, 0.22, 0.018)
    target_colour = (0.78, 0.62, 0.40, 1.0)
