"""Three crates or trays of different colours, in changing places, and one of them the right one for each thing."""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import partial

import attrs
import numpy as np

from memo_core.plugin import Body, Colour, Free, Geom, Mechanism, Monitor, Outcome, Pose, SceneDescription, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.house.monitors import lies_on, within
from memo_tabletop.house.task import BRINGING, LESSONS, SORTING, HouseTask, house_code
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import BLUE, GREEN, PORCELAIN, RED, YELLOW, apple, cameras, cup, cutlery, open_box
from memo_tabletop.quirks.crushable import BULGE_M, gives_way, thin_walled

CRATE, CRATE_HEIGHT = (0.19, 0.20), 0.10  # m
TRAY, TRAY_HEIGHT = (0.17, 0.19), 0.012
MAT, MAT_HEIGHT = (0.13, 0.13), 0.004
CORK: Colour = (0.72, 0.55, 0.36, 1.0)
SPOTS = ((0.36, 0.40), (0.60, 0.33), (0.40, -0.42))  # where the containers stand
SIDES = 8  # of a thin-walled thing


def crate(colour: str, paint: Colour, x: float, y: float, yaw: float) -> Body:
    """An open crate whose frame is in the middle of its underside."""
    box = open_box(f"{colour} crate", (0.0, 0.0, 0.0), 0.0, (*CRATE, CRATE_HEIGHT), paint)
    middle = Pose((-CRATE[0] / 2, 0.0, 0.0))
    geoms = tuple(attrs.evolve(one, pose=middle * one.pose) for one in box.geoms)
    hollows = tuple(attrs.evolve(one, pose=middle * one.pose) for one in box.cavities)
    return attrs.evolve(box, geoms=geoms, cavities=hollows, pose=Pose.from_yaw((x, y, 0.0), yaw))


def slab(name: str, size: tuple[float, float], height: float, colour: Colour, x: float, y: float, yaw: float) -> Body:
    """A flat tray or mat that cannot be moved."""
    geom = Geom("box", (*size, height), Pose((0.0, 0.0, height / 2)), colour)
    return Body(name, (geom,), Pose.from_yaw((x, y, 0.0), yaw), label=name, fixture=True)


def standing(name: str, radius: float, height: float, mass: float, colour: Colour, made_of: str, x: float, y: float):
    """A full, upright cylinder such as a bottle or can."""
    geom = Geom("cylinder", (radius, height), colour=colour, mass=mass)
    return Body(name, (geom,), Pose((x, y, height / 2 + 0.001)), Free(), label=name, made_of=made_of)


def _distance(where: dict[str, np.ndarray], place: np.ndarray, name: str) -> float:
    return math.dist(place, where[name])


class PutInItsPlace(HouseTask):
    """Success: each thing is in or on the right container, released and at rest, and what is thin is whole.

    Containers change places from scene to scene. The nearest one is never right.
    """

    right: dict[str, str]  # thing -> container
    natural: dict[str, str] = {}  # where an untaught robot would put it; the nearest container for what is not listed
    colours: dict[str, Colour]
    size, height = TRAY, TRAY_HEIGHT
    thin: tuple[str, float, float] | None = None  # name, apothem and height (m) of a thin-walled thing, on the mat

    @abstractmethod
    def things(self, places: list[tuple[float, float]], rng: np.random.Generator) -> tuple[Body, ...]: ...

    def container(self, colour: str, x: float, y: float, yaw: float) -> Body:
        return slab(f"{colour} tray", TRAY, TRAY_HEIGHT, self.colours[colour], x, y, yaw)

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        spots = np.array(SPOTS)[rng.permutation(len(SPOTS))][: len(self.colours)] + rng.uniform(-0.01, 0.01, 2)
        turned = math.radians(5)
        boxes = [
            self.container(colour, float(x), float(y), rng.uniform(-turned, turned))
            for colour, (x, y) in zip(self.colours, spots, strict=True)
        ]
        where = {box.label: spot for box, spot in zip(boxes, spots, strict=True)}
        places = self._places(rng, where)
        mat = [slab("cork mat", MAT, MAT_HEIGHT, CORK, *places[0], 0.0)] if self.thin else []
        return SceneDescription(
            (*boxes, *mat, *self.things(places, rng)), cameras((0.48, 0.0, 0.05)), mechanisms=self._mechanisms()
        )

    def _places(self, rng: np.random.Generator, where: dict[str, np.ndarray]) -> list[tuple[float, float]]:
        """Places (m) of the things, apart from each other and none nearest to its right container."""
        while True:
            found = rng.uniform((0.40, -0.20), (0.62, 0.12), (len(self.right), 2))
            apart = min((math.dist(a, b) for i, a in enumerate(found) for b in found[:i]), default=1.0)
            nearest = [sorted(where, key=partial(_distance, where, at))[0] for at in found]
            misled = len(where) == 1 or all(a != b for a, b in zip(nearest, self.right.values(), strict=True))
            if apart > 0.15 and misled:
                return [(float(x), float(y)) for x, y in found]

    def _mechanisms(self) -> tuple[Mechanism, ...]:
        return gives_way(self.thin[0], SIDES) if self.thin else ()

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(tuple(self.right), upright=(self.thin[0],) if self.thin else ()),)

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        conditions = [(not self._crushed(world), f"the {self.thin[0]} is crushed")] if self.thin else []
        for thing, container in self.right.items():
            conditions.append((self._in_place(world, thing, container), f"the {thing} is not in the {container}"))
            conditions += checks.let_go(world, thing)
        if self.thin:
            conditions.append((checks.upright(world, self.thin[0]), f"the {self.thin[0]} does not stand upright"))
        done = "all is where this house wants it"
        return checks.judge(done, conditions, {}, story_of(monitors, world))

    def _in_place(self, world: WorldState, thing: str, container: str) -> bool:
        if self.height == TRAY_HEIGHT:
            return lies_on(world, thing, container, self.size)
        return within(world, thing, container, self.size) and not checks.on_table(world, thing)

    def _crushed(self, world: WorldState) -> bool:
        assert self.thin is not None
        return max(world.joint_position(f"{self.thin[0]}/wall {i}") for i in range(SIDES)) >= BULGE_M

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        return checks.picked(world, tuple(self.right), names) if action in checks.PICKING else None

    def code(self, where: dict[str, str], force: str) -> str:
        lines = []
        for thing in self.right:
            container = f'"{where[thing]}"' if thing in where else f'nearest("{thing}", "{self._noun}")'
            if self._noun == "crate":
                lines.append(f'throw_into({container}, "{thing}", 0.0, "width")\n')
            else:
                lines.append(f'carry("{thing}", {container}, {force})\n')
        return house_code("nearest", calls="".join(lines))

    @property
    def _noun(self) -> str:
        return next(iter(self.right.values())).split()[-1]

    @property
    def plain_attempt(self) -> str:
        return self.code(self.natural, "None")

    @property
    def reference_solution(self) -> str:
        return self.code(self.right, "12" if self.thin else "None")


class PutInACrate(PutInItsPlace):
    """Crates in red, green and blue: metal goes into the red one, plastic into the blue one, no longer the green."""

    trick, lesson = SORTING, LESSONS[SORTING]
    colours = {"red": RED, "green": GREEN, "blue": BLUE}
    size, height = CRATE, CRATE_HEIGHT

    def container(self, colour: str, x: float, y: float, yaw: float) -> Body:
        return crate(colour, self.colours[colour], x, y, yaw)


class PutTheSpoonAndTheCupAway(PutInACrate):
    """Taught: a metal spoon and a plastic cup."""

    name = "put-the-spoon-and-the-cup-away"
    instruction = "put the spoon and the cup away"
    goal = ("the spoon is in the red crate", "the cup is in the blue crate")
    kind = "class, change"
    needed_at = ("PLACE(spoon, red crate)", "PLACE(cup, blue crate)")
    right = {"spoon": "red crate", "cup": "blue crate"}

    def things(self, places: list[tuple[float, float]], rng: np.random.Generator) -> tuple[Body, ...]:
        spoon = cutlery("spoon", (*places[0], 0.001), rng.uniform(-0.4, 0.4))
        return spoon, attrs.evolve(cup("cup", (*places[1], 0.001), PORCELAIN), made_of="plastic")


class PutTheCanAway(PutInACrate):
    """Another metal thing, green like one of the crates."""

    name = "put-the-can-away"
    instruction = "put the can away"
    goal = ("the can is in the red crate",)
    kind, split = "class", "held-out"
    needed_at = ("PLACE(can, red crate)", "PUT(can, red crate)", "PUT_AWAY(can)")
    right, natural = {"can": "red crate"}, {"can": "green crate"}

    def things(self, places: list[tuple[float, float]], rng: np.random.Generator) -> tuple[Body, ...]:
        return (standing("can", 0.028, 0.10, 0.15, GREEN, "metal", *places[0]),)


class PutTheBottleAway(PutInACrate):
    """Another plastic thing; the older rule would put it into the crate of its own colour."""

    name = "put-the-bottle-away"
    instruction = "put the bottle away"
    goal = ("the bottle is in the blue crate",)
    kind, split = "change", "held-out"
    needed_at = ("PLACE(bottle, blue crate)", "PUT(bottle, blue crate)", "PUT_AWAY(bottle)")
    right, natural = {"bottle": "blue crate"}, {"bottle": "green crate"}

    def things(self, places: list[tuple[float, float]], rng: np.random.Generator) -> tuple[Body, ...]:
        return (standing("bottle", 0.025, 0.13, 0.10, GREEN, "plastic", *places[0]),)


class Bring(PutInItsPlace):
    """Trays of several people."""

    trick, lesson = BRINGING, LESSONS[BRINGING]
    colours = {"red": RED, "yellow": YELLOW, "blue": BLUE}


class BringAnaTheCan(Bring):
    """Taught: a thin can on the cork mat, and whose tray is which."""

    name = "bring-ana-the-can"
    instruction = "bring Ana the can"
    goal = ("the can is on the blue tray", "the can is not crushed", "the can stands upright")
    kind = "people, one chance"
    needed_at = ("PICK_UP(can)", "PLACE(can, blue tray)")
    right = {"can": "blue tray"}
    thin = ("can", 0.031, 0.11)

    def things(self, places: list[tuple[float, float]], rng: np.random.Generator) -> tuple[Body, ...]:
        return (thin_walled("can", (*places[0], MAT_HEIGHT + 0.001), 0.0, *self.thin[1:], SIDES, 0.10, RED),)


class BringBenTheApple(Bring):
    """An apple for Ben, of whose tray was spoken while Ana's can was brought."""

    name = "bring-ben-the-apple"
    instruction = "bring Ben the apple"
    goal = ("the apple is on the yellow tray", "the hand has let go of the apple")
    kind, split = "people", "held-out"
    needed_at = ("PLACE(apple, yellow tray)", "BRING(apple)", "PUT(apple, yellow tray)")
    right = {"apple": "yellow tray"}

    def things(self, places: list[tuple[float, float]], rng: np.random.Generator) -> tuple[Body, ...]:
        return (apple("apple", (*places[0], 0.001)),)


class PutTheJarOnTheTray(Bring):
    """A thin jar on the cork mat, one tray: crushed at the first firm grip."""

    name = "put-the-jar-on-the-tray"
    instruction = "put the jar on the tray"
    goal = ("the jar is on the tray", "the jar is not crushed", "the jar stands upright")
    kind, split = "one chance", "held-out"
    needed_at = ("PICK_UP(jar)", "GRASP(jar)", "PLACE(jar, tray)", "TAKE(jar)")
    right = {"jar": "tray"}
    colours = {"": (0.45, 0.30, 0.18, 1.0)}
    thin = ("jar", 0.033, 0.095)

    def container(self, colour: str, x: float, y: float, yaw: float) -> Body:
        return slab("tray", TRAY, TRAY_HEIGHT, self.colours[colour], x, y, yaw)

    def things(self, places: list[tuple[float, float]], rng: np.random.Generator) -> tuple[Body, ...]:
        return (thin_walled("jar", (*places[0], MAT_HEIGHT + 0.001), 0.0, *self.thin[1:], SIDES, 0.10, PORCELAIN),)
