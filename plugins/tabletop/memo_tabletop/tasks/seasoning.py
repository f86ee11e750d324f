"""Season the food: salt from the shaker onto it, and the shaker back on the table."""

from __future__ import annotations

from typing import Any

import numpy as np

from memo_core.plugin import Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.grains import SALT, contained, grains, vessel
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import CRUST, block, cameras, plate
from memo_tabletop.reference import solution

COUNT = 5
ENOUGH = 3
RADIUS = 0.003  # m
SHAKER = (0.019, 0.09, 0.003)  # m, inner apothem, height, wall
FOOD = (0.10, 0.08, 0.03)  # m
STILL_M_S = 0.02
SHAKING = ("SEASON", "SHAKE", "SALT", "POUR", "SPRINKLE", "TILT", "TIP")
GLASS = (0.75, 0.85, 0.88, 1.0)
SALT_COLOUR = (0.98, 0.98, 0.96, 1.0)


class SeasonTheFood(Task):
    """Success: three grains or more lie on the food, and the shaker stands upright on the table, let go."""

    name = "season-the-food"
    instruction = "season the food"
    goal = ("the salt is on the food", "the salt shaker stands upright", "the salt shaker is on the table")
    kind = "SR"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.46, -0.20]) + rng.uniform(-0.02, 0.02, 2)
        shaker = vessel("salt shaker", (x, y, 0.0005), rng.uniform(-0.26, 0.26), *SHAKER, mass=0.08, colour=GLASS)
        salt = grains("salt", COUNT, RADIUS, 0.0005, SALT, SALT_COLOUR, (x, y, 0.0005 + SHAKER[2]), SHAKER[0])
        u, v = np.array([0.50, 0.12]) + rng.uniform(-0.02, 0.02, 2)
        dish = plate("plate", (u, v, 0.0005))
        loaf = block("food", "food", (u, v, 0.0072), rng.uniform(-0.35, 0.35), FOOD, 0.2, CRUST)
        return SceneDescription((shaker, dish, loaf, *salt), cameras((0.5, 0.0, 0.1)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(("salt shaker", "food"), upright=("salt shaker", "food")),)

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        on = self._on_food(world)
        still = [name for name in on if np.linalg.norm(world.body_velocity(name)[0]) < STILL_M_S]
        left = len(contained(world, "salt shaker", *SHAKER[:2], self._grains()))
        measures = {"on_food": float(len(on)), "in_shaker": float(left)}
        mishaps = story_of(monitors, world)
        beside = COUNT - len(on) - left
        told = f"{len(on)} of {COUNT} grains are on the food, {left} in the shaker" + (
            f", {beside} beside" if beside else ""
        )
        stands = checks.upright(world, "salt shaker") and checks.on_table(world, "salt shaker")
        conditions = (
            (len(on) >= ENOUGH, told),
            (len(still) >= ENOUGH, "the grains still roll"),
            (stands, "the salt shaker does not stand upright on the table"),
            *checks.let_go(world, "salt shaker"),
            (checks.released(world, "food"), "the robot still touches the food"),
        )
        return checks.judge(
            f"{len(on)} grains are on the food, the shaker stands on the table", conditions, measures, mishaps
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action in checks.PICKING:
            return checks.picked(world, ("salt shaker",), names)
        if action in SHAKING:
            on = len(self._on_food(world))
            return Outcome(on >= ENOUGH, f"{on} of {COUNT} grains are on the food", {"on_food": float(on)})
        if action in checks.PLACING and names and names[0] in ("salt shaker", "shaker"):
            done = checks.upright(world, "salt shaker") and checks.on_table(world, "salt shaker")
            done = done and checks.released(world, "salt shaker")
            return Outcome(done, f"the salt shaker {'stands' if done else 'does not stand'} upright on the table")
        return None

    def _grains(self) -> list[str]:
        return [f"salt/{number}" for number in range(COUNT)]

    def _on_food(self, world: WorldState) -> list[str]:
        """Grains that lie on top of the food itself: no higher than their own size, and not in the shaker."""
        frame = world.body_pose("food").inverse()
        held_back = contained(world, "salt shaker", *SHAKER[:2], self._grains())
        found = []
        for name in self._grains():
            if name in held_back:
                continue
            x, y, z = frame.apply(np.asarray(world.body_pose(name).position))
            on_top = 0.0 < z - FOOD[2] / 2 < 2 * RADIUS
            if abs(x) < FOOD[0] / 2 and abs(y) < FOOD[1] / 2 and on_top:
                found.append(name)
        return found

    @property
    def reference_solution(self) -> str:
        return solution("pour", calls='season("salt shaker", "food")\n')
