"""Dispensers that release grains only after they have been shaken three times.

Inside hangs a small weight on a damped spring; it lags behind when the dispenser is jerked up or stops on its way down.
After three such lags in four seconds the valve below opens.
"""

from __future__ import annotations

import math

import attrs
import numpy as np

from memo_core.plugin import (
    Below,
    Body,
    Cavity,
    Colour,
    Free,
    Geom,
    Lock,
    Mechanism,
    Monitor,
    Outcome,
    Pose,
    SceneDescription,
    Slide,
    Times,
    Vector,
    WorldState,
    cup,
)
from memo_tabletop import success_checks as checks
from memo_tabletop.furniture import WOOD
from memo_tabletop.grains import SALT, grains
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import cameras
from memo_tabletop.quirks.code import quirk_code
from memo_tabletop.quirks.task import QuirkTask

COUNT = 5
ENOUGH = 3
GRAIN_M = 0.003  # radius
SHAKES = 3
WITHIN_S = 4.0
LAG_M = 0.0012  # of the weight; at its natural frequency that is 1.2 m/s2
FREQUENCY = 2 * math.pi * 5.0  # rad/s
VALVE_TRAVEL = 0.04  # m


def dispenser(
    name: str, place: Vector, yaw: float, apothem: float, height: float, mass: float, sides: int, colour: Colour
) -> Body:
    """An upright tube, closed by a lid above and a sliding valve (``NAME/valve``) below; in it the weight
    (``NAME/weight``)."""
    wall = 0.003
    _, *walls = cup(apothem, height, wall, sides, colour)
    # The tube's walls begin above its floor, which there is none of: they carry on down to the table.
    walls = [attrs.evolve(g, size=(*g.size[:2], height), pose=_at_height(g.pose, height / 2)) for g in walls]
    lid = Geom("cylinder", (apothem, 0.006), Pose((0.0, 0.0, height - 0.003)), colour)
    valve = Body(
        name=f"{name}/slider",
        geoms=(Geom("cylinder", (apothem - 0.001, 0.003), Pose((0.0, 0.0, 0.0085)), (0.6, 0.6, 0.62, 1.0)),),
        joint=Slide(
            f"{name}/valve", (1.0, 0.0, 0.0), range=(0.0, VALVE_TRAVEL), stiffness=60.0, rest=0.06, damping=2.0
        ),
        mass=0.01,
    )
    weight = 0.02  # kg
    inside = Body(
        name=f"{name}/bob",
        geoms=(Geom("sphere", (0.004,), collides=False),),
        pose=Pose((0.0, 0.0, height / 2)),
        joint=Slide(
            f"{name}/weight",
            (0.0, 0.0, 1.0),
            range=(-0.012, 0.012),
            stiffness=weight * FREQUENCY**2,
            rest=9.81 / FREQUENCY**2,  # at 0 when it stands still
            damping=2 * weight * FREQUENCY,
            armature=0.0,
        ),
        mass=weight,
    )
    return Body(
        name,
        (*walls, lid),
        Pose.from_yaw(place, yaw),
        Free(),
        mass=mass,
        label=name,
        cavities=(_hidden(name, apothem, height),),
        bodies=(valve, inside),
    )


def _hidden(name: str, apothem: float, height: float) -> Cavity:
    """Its inside is never visible, whether its valve is open or shut."""
    size = (2 * apothem, 2 * apothem, height - 0.014)
    middle = Pose((0.0, 0.0, height / 2 + 0.001))
    below = (0.0, 0.0, -1.0)
    return Cavity(f"{name}/inside", f"{name} inside", middle, size, below, f"{name}/valve", closed_within=1.0)


def _at_height(pose: Pose, z: float) -> Pose:
    return attrs.evolve(pose, position=(*pose.position[:2], z))


def opens_when_shaken(name: str) -> tuple[Mechanism, ...]:
    """The valve is shut until the weight has lagged three times in four seconds."""
    lags = Below(f"{name}/weight", -LAG_M, slack=1.25 * LAG_M)
    return (Lock("valve", f"{name}/valve", (0.0, 0.0), until=Times(lags, SHAKES, WITHIN_S)),)


class ShakeOver(QuirkTask):
    """Success: at least three of the five grains are in the target, and the dispenser stands on the table again."""

    trick = "shake three times"
    thing: str
    target: str
    heap: str
    grain_colour: Colour
    tube: tuple[float, float, int]  # m, inner apothem, height; sides
    colour: Colour

    def target_body(self, place: Vector) -> Body:
        raise NotImplementedError

    target_radius: float  # m, of its hollow
    target_height: float  # m, of its rim

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.46, -0.20]) + rng.uniform(-0.03, 0.03, 2)
        apothem, height, sides = self.tube
        tube = dispenser(self.thing, (x, y, 0.0005), rng.uniform(-0.3, 0.3), apothem, height, 0.1, sides, self.colour)
        filling = grains(self.heap, COUNT, GRAIN_M, 0.0005, SALT, self.grain_colour, (x, y, 0.0110), apothem - 0.002)
        u, v = np.array([0.50, 0.14]) + rng.uniform(-0.03, 0.03, 2)
        return SceneDescription(
            (tube, self.target_body((u, v, 0.0005)), *filling),
            cameras((0.48, 0.0, 0.08)),
            mechanisms=opens_when_shaken(self.thing),
        )

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps((self.thing,), upright=(self.thing,)),)

    def given(self, world: WorldState) -> int:
        """How many grains are in the target."""
        frame = world.body_pose(self.target).inverse()
        found = 0
        for number in range(COUNT):
            x, y, z = frame.apply(np.asarray(world.body_pose(f"{self.heap}/{number}").position))
            found += math.hypot(x, y) < self.target_radius and 0.0 < z < self.target_height
        return found

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        given = self.given(world)
        stands = checks.upright(world, self.thing) and checks.on_table(world, self.thing)
        conditions = (
            (given >= ENOUGH, f"{given} of {COUNT} grains are in the {self.target}"),
            (stands, f"the {self.thing} does not stand upright on the table"),
            *checks.let_go(world, self.thing),
        )
        done = f"{given} grains are in the {self.target}, the {self.thing} stands on the table"
        return checks.judge(done, conditions, {"grains": float(given)}, story_of(monitors, world))

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action in checks.PICKING:
            return checks.picked(world, (self.thing,), names)
        if action in ("SHAKE", "POUR", "SPRINKLE", "SEASON", "DUST", "PEPPER"):
            given = self.given(world)
            return Outcome(given >= ENOUGH, f"{given} of {COUNT} grains are in the {self.target}")
        return None

    def code(self, shakes: int) -> str:
        return quirk_code("shake_over", calls=f'shake_over("{self.thing}", "{self.target}", {shakes})\n')

    @property
    def plain_attempt(self) -> str:
        return self.code(1)

    @property
    def reference_solution(self) -> str:
        return self.code(3)


class PepperTheSoup(ShakeOver):
    """A pepper mill over a bowl."""

    name = "pepper-the-soup"
    needed_at: tuple[str, ...] = ("SHAKE(pepper mill, soup bowl)",)
    instruction = "put pepper in the soup with the pepper mill"
    goal = ("the pepper is in the soup bowl", "the pepper mill stands upright", "the pepper mill is on the table")
    lesson = "Shake the pepper mill up and down three times over the soup, before that nothing comes out."
    thing = "pepper mill"
    target = "soup bowl"
    heap = "pepper"
    grain_colour = (0.15, 0.13, 0.12, 1.0)
    tube = (0.019, 0.11, 12)
    colour = WOOD
    target_radius, target_height = 0.062, 0.05

    def target_body(self, place: Vector) -> Body:
        bowl = cup(self.target_radius, self.target_height, 0.005, 12, (0.92, 0.92, 0.90, 1.0))
        soup = Geom("cylinder", (self.target_radius, 0.012), Pose((0.0, 0.0, 0.010)), (0.85, 0.55, 0.2, 1.0))
        side, height = 1.41 * self.target_radius, self.target_height - 0.005
        middle = Pose((0.0, 0.0, 0.005 + height / 2))
        hollow = Cavity(f"{self.target}/inside", f"{self.target} inside", middle, (side, side, height), (0.0, 0.0, 1.0))
        return Body(self.target, (*bowl, soup), Pose(place), label=self.target, fixture=True, cavities=(hollow,))


class SugarTheCake(ShakeOver):
    """A six-sided sugar shaker over a cake in its tin."""

    name = "sugar-the-cake"
    needed_at: tuple[str, ...] = (
        "SPRINKLE(sugar shaker, cake)",
        "SHAKE(sugar shaker, cake)",
        "POUR(sugar, cake)",
        "SEASON(cake)",
        "DISPENSE(sugar, cake)",
        "TIP(sugar shaker, cake)",
        "SHAKE_OVER(sugar shaker, cake)",
    )
    instruction = "put sugar on the cake with the sugar shaker"
    goal = ("the sugar is on the cake", "the sugar shaker stands upright", "the sugar shaker is on the table")
    split = "held-out"
    lesson = "The sugar shaker only gives after three good shakes up and down."
    thing = "sugar shaker"
    target = "cake"
    heap = "sugar"
    grain_colour = (0.98, 0.98, 0.96, 1.0)
    tube = (0.024, 0.12, 6)
    colour = (0.75, 0.82, 0.88, 1.0)
    target_radius, target_height = 0.075, 0.045

    def target_body(self, place: Vector) -> Body:
        tin = cup(self.target_radius, self.target_height, 0.003, 16, (0.35, 0.36, 0.38, 1.0))
        cake = Geom("cylinder", (self.target_radius, 0.025), Pose((0.0, 0.0, 0.015)), (0.55, 0.33, 0.16, 1.0))
        return Body(self.target, (*tin, cake), Pose(place), label=self.target, fixture=True)
