"""A shaker, what is to be seasoned, and between them bread that the shaker must not pass over."""

from __future__ import annotations

import numpy as np

from memo_core.plugin import Body, Colour, Free, Geom, Monitor, Outcome, Pose, SceneDescription, WorldState, cup
from memo_tabletop import success_checks as checks
from memo_tabletop.house.monitors import Shaken
from memo_tabletop.house.task import LESSONS, SEASONING, HouseTask, house_code
from memo_tabletop.monitors import Mishaps, Moved, story_of
from memo_tabletop.objects import CRUST, METAL, cameras

SHAKES = 10
MISCOUNTED = 1  # the first and the last stroke can join the approach and the retreat
BREAD = (0.16, 0.10, 0.06)  # m
STAYS_M = 0.03


class Season(HouseTask):
    """Success: ten shakes over the target, the shaker never over the bread, and then upright on the table, released."""

    trick, lesson = SEASONING, LESSONS[SEASONING]
    shaker: str
    target: str
    height: float  # of the shaker, m
    radius: float  # of the target, m
    glass: Colour

    def target_body(self, x: float, y: float) -> Body:
        raise NotImplementedError

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        (x, y), (u, v) = np.array([[0.46, -0.26], [0.46, 0.26]]) + rng.uniform(-0.03, 0.03, (2, 2))
        a, b = np.array([0.49, 0.0]) + rng.uniform(-0.015, 0.015, 2)
        half = self.height / 2
        tube = (
            Geom("cylinder", (0.021, self.height), colour=self.glass, mass=0.09),
            Geom("cylinder", (0.021, 0.01), Pose((0.0, 0.0, half - 0.004)), METAL, mass=0.01, collides=False),
        )
        loaf = Geom("box", BREAD, Pose((0.0, 0.0, BREAD[2] / 2)), CRUST, mass=0.5)
        return SceneDescription(
            (
                Body(self.shaker, tube, Pose((x, y, half + 0.001)), Free(), label=self.shaker),
                Body("bread", (loaf,), Pose.from_yaw((a, b, 0.001), rng.uniform(-0.1, 0.1)), Free(), label="bread"),
                self.target_body(u, v),
            ),
            cameras((0.48, 0.0, 0.08)),
        )

    def monitors(self) -> tuple[Monitor, ...]:
        shaken = Shaken(self.shaker, self.height, self.target, self.radius, "bread", BREAD[:2])
        return Mishaps((self.shaker, "bread"), upright=(self.shaker,)), Moved(("bread",)), shaken

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        shaken, moved = monitors["shaken"], monitors["moved"]
        assert isinstance(shaken, Shaken) and isinstance(moved, Moved)
        stands = checks.upright(world, self.shaker) and checks.on_table(world, self.shaker)
        conditions = (
            (not shaken.passed_over, f"the {self.shaker} was over the bread"),
            (moved.farthest("bread") < STAYS_M, "the bread was moved"),
            (abs(shaken.shakes - SHAKES) <= MISCOUNTED, f"{shaken.shakes} shakes over the {self.target}"),
            (stands, f"the {self.shaker} does not stand upright on the table"),
            *checks.let_go(world, self.shaker),
        )
        measures = {"shakes": float(shaken.shakes), "over_bread": float(shaken.passed_over)}
        done = f"the {self.target} got {shaken.shakes} shakes, around the bread"
        return checks.judge(done, conditions, measures, story_of(monitors, world))

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        return checks.picked(world, (self.shaker,), names) if action in checks.PICKING else None

    def code(self, shakes: int, around: bool) -> str:
        calls = f'shake("{self.shaker}", "{self.target}", {shakes}, {around})\n'
        return house_code("shake", calls=calls)

    @property
    def plain_attempt(self) -> str:
        return self.code(3, False)

    @property
    def reference_solution(self) -> str:
        return self.code(SHAKES, True)


class SaltTheSoup(Season):
    """Taught: salt over a bowl."""

    name = "salt-the-soup"
    instruction = "salt the soup"
    goal = ("the salt shaker stands upright", "the salt shaker is on the table", "the bread has stayed where it was")
    kind = "manner, amount, place"
    needed_at = ("SHAKE(salt shaker, soup)",)
    shaker, target = "salt shaker", "soup"
    height, radius = 0.09, 0.065
    glass = (0.75, 0.85, 0.88, 1.0)

    def target_body(self, x: float, y: float) -> Body:
        bowl = cup(self.radius, 0.05, 0.005, 12, (0.92, 0.92, 0.90, 1.0))
        filling = Geom("cylinder", (self.radius, 0.012), Pose((0.0, 0.0, 0.010)), (0.85, 0.55, 0.2, 1.0))
        return Body(self.target, (*bowl, filling), Pose((x, y, 0.0005)), label=self.target, fixture=True)


class SugarThePancake(Season):
    """Another shaker over a pancake."""

    name = "sugar-the-pancake"
    instruction = "sugar the pancake"
    goal = ("the sugar shaker stands upright", "the sugar shaker is on the table", "the bread has stayed where it was")
    kind, split = "manner, amount, place", "held-out"
    needed_at = (
        "SHAKE(sugar shaker, pancake)",
        "SPRINKLE(sugar shaker, pancake)",
        "SUGAR(pancake)",
        "SEASON(pancake)",
        "POUR(sugar shaker, pancake)",
    )
    shaker, target = "sugar shaker", "pancake"
    height, radius = 0.11, 0.08
    glass = (0.93, 0.85, 0.70, 1.0)

    def target_body(self, x: float, y: float) -> Body:
        cake = Geom("cylinder", (self.radius, 0.02), Pose((0.0, 0.0, 0.010)), (0.85, 0.65, 0.35, 1.0))
        return Body(self.target, (cake,), Pose((x, y, 0.0)), label=self.target, fixture=True)
