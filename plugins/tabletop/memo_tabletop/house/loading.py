"""A dish and something to eat on a tray: what is eaten first."""

from __future__ import annotations

import math
from abc import abstractmethod

import numpy as np

from memo_core.plugin import Body, Monitor, Outcome, SceneDescription, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.grains import vessel
from memo_tabletop.house.containers import slab
from memo_tabletop.house.monitors import OnTray, lies_on
from memo_tabletop.house.task import LESSONS, LOADING, HouseTask, house_code
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import BLUE, DARK_WOOD, PORCELAIN, YELLOW, banana, block, cameras, cup, scatter

TRAY = (0.26, 0.32)  # m


class LoadTheTray(HouseTask):
    """Success: the food and the dish are on the tray, released and at rest, and the food came to stay there first."""

    trick, lesson = LOADING, LESSONS[LOADING]
    food: str
    dish: str

    @abstractmethod
    def things(self, food: tuple[float, float], dish: tuple[float, float], yaw: float) -> tuple[Body, ...]: ...

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.47, 0.24]) + rng.uniform(-0.02, 0.02, 2)
        tray = slab("tray", TRAY, 0.012, DARK_WOOD, x, y, rng.uniform(-0.08, 0.08))
        food, dish = scatter(rng, 2, (0.38, -0.38), (0.58, -0.08), 0.16)
        return SceneDescription((tray, *self.things(food, dish, rng.uniform(-0.4, 0.4))), cameras((0.47, 0.0, 0.05)))

    def monitors(self) -> tuple[Monitor, ...]:
        both = self.food, self.dish
        return Mishaps(both, upright=(self.dish,)), *(OnTray(thing, "tray", TRAY) for thing in both)

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        first, then = (monitors[f"{thing} on tray"] for thing in (self.food, self.dish))
        assert isinstance(first, OnTray) and isinstance(then, OnTray)
        conditions = [
            *(
                (lies_on(world, thing, "tray", TRAY), f"the {thing} is not on the tray")
                for thing in (self.food, self.dish)
            ),
            *(condition for thing in (self.food, self.dish) for condition in checks.let_go(world, thing)),
            (first.since < then.since, f"the {self.dish} was on the tray before the {self.food}"),
        ]
        earlier = then.since - first.since
        measures = {"food_earlier_s": earlier} if math.isfinite(earlier) else {}
        done = f"the {self.food} was put on the tray first, then the {self.dish}"
        return checks.judge(done, conditions, measures, story_of(monitors, world))

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        return checks.picked(world, (self.food, self.dish), names) if action in checks.PICKING else None

    def code(self, *order: str) -> str:
        aside = {self.food: 0.08, self.dish: -0.08}
        return house_code("onto", calls="".join(f'onto("tray", "{thing}", {aside[thing]})\n' for thing in order))

    @property
    def plain_attempt(self) -> str:
        return self.code(self.dish, self.food)

    @property
    def reference_solution(self) -> str:
        return self.code(self.food, self.dish)


class PutTheCupAndTheBananaOnTheTray(LoadTheTray):
    """Taught: a cup and a banana."""

    name = "put-the-cup-and-the-banana-on-the-tray"
    instruction = "put the cup and the banana on the tray"
    goal = ("the cup and the banana are on the tray",)
    kind = "order"
    needed_at = ("PLACE(banana, tray)",)
    food, dish = "banana", "cup"

    def things(self, food: tuple[float, float], dish: tuple[float, float], yaw: float) -> tuple[Body, ...]:
        return banana("banana", (*food, 0.001), yaw), cup("cup", (*dish, 0.001), BLUE)


class PutTheBowlAndTheCheeseOnTheTray(LoadTheTray):
    """Another dish and another thing to eat."""

    name = "put-the-bowl-and-the-cheese-on-the-tray"
    instruction = "put the bowl and the cheese on the tray"
    goal = ("the bowl and the cheese are on the tray",)
    kind, split = "order", "held-out"
    needed_at = ("PLACE(cheese, tray)", "PUT(cheese, tray)", "PICK_UP(bowl)", "PICK_UP(cheese)", "PLACE(bowl, tray)")
    food, dish = "cheese", "bowl"

    def things(self, food: tuple[float, float], dish: tuple[float, float], yaw: float) -> tuple[Body, ...]:
        wedge = block("cheese", "cheese", (*food, 0.001), yaw, (0.05, 0.06, 0.04), 0.15, YELLOW)
        return wedge, vessel("bowl", (*dish, 0.001), 0.0, 0.032, 0.05, 0.004, 0.12, PORCELAIN)
