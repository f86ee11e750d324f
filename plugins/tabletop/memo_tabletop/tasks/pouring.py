"""Pour the can: what is in it goes into the bowl."""

from __future__ import annotations

from typing import Any

import numpy as np

from memo_core.plugin import Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.grains import CEREAL, contained, grains, vessel
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import PORCELAIN, RED, YELLOW, cameras
from memo_tabletop.reference import solution

COUNT = 25
RADIUS = 0.007  # m
CAN = (0.0275, 0.10, 0.004)  # m, inner apothem, height, wall: 65 mm from corner to corner
BOWL = (0.075, 0.05, 0.005)
SHARE = 0.8
STILL_M_S = 0.02  # a ball that creeps on in the bowl is as good as at rest
POURING = ("POUR", "POUR_INTO", "EMPTY", "TIP", "TILT")


class PourTheCan(Task):
    """Success: four fifths of the can's cereal lie in the bowl, at rest, and the bowl stands on the table, let go. What
    is still in the can does not count, wherever the can is."""

    name = "pour-the-can"
    instruction = "pour the can"
    goal = ("the cereal is in the bowl", "the bowl is on the table")
    kind = "TR"
    split = "held-out"
    settle = 3.0

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.46, -0.20]) + rng.uniform(-0.02, 0.02, 2)
        can = vessel("can", (x, y, 0.0005), rng.uniform(-0.26, 0.26), *CAN, mass=0.1, colour=RED)
        cereal = grains("cereal", COUNT, RADIUS, 0.003, CEREAL, YELLOW, (x, y, 0.0005 + CAN[2]), CAN[0])
        u, v = np.array([0.52, 0.12]) + rng.uniform(-0.02, 0.02, 2)
        bowl = vessel("bowl", (u, v, 0.0005), 0.0, *BOWL, mass=0.4, colour=PORCELAIN, sides=16)
        return SceneDescription((can, bowl, *cereal), cameras((0.5, 0.0, 0.1)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(("can", "bowl"), upright=("bowl",)),)

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        names = [f"cereal/{number}" for number in range(COUNT)]
        in_can = contained(world, "can", *CAN[:2], names)
        there = [name for name in contained(world, "bowl", *BOWL[:2], names) if name not in in_can]
        still = [name for name in there if np.linalg.norm(world.body_velocity(name)[0]) < STILL_M_S]
        measures = {"in_bowl": float(len(there)), "in_can": float(len(in_can))}
        missing = f"{len(there)} of {COUNT} balls are in the bowl, {len(in_can)} still in the can"
        spilt = COUNT - len(there) - len(in_can)
        mishaps = story_of(monitors, world)
        conditions = (
            (
                checks.upright(world, "bowl") and checks.on_table(world, "bowl"),
                "the bowl does not stand on the table",
            ),
            (len(there) >= SHARE * COUNT, f"{missing}, {spilt} beside" if spilt else missing),
            (len(still) >= SHARE * COUNT, "the cereal is still moving"),
            (checks.released(world, "bowl"), "the robot still touches the bowl"),
        )
        return checks.judge(f"{len(there)} of {COUNT} balls are in the bowl", conditions, measures, mishaps)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action in checks.PICKING:
            return checks.picked(world, ("can",), names) if "can" in names else None
        return self.check(world, {}) if action in POURING else None

    @property
    def reference_solution(self) -> str:
        return solution("pour", calls='pour_out("can", "bowl")\n')
