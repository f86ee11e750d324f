"""Move the lonely object to the others: which one that is, only their places tell."""

from __future__ import annotations

import math

import numpy as np

from memo_core.plugin import Body, Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Mishaps, Moved
from memo_tabletop.objects import APPLE_RADIUS, BLUE, CAN_RADIUS, GREEN, apple, block, cameras, can, cup
from memo_tabletop.reference import solution

RADII = {"apple": APPLE_RADIUS, "cup": 0.031, "can": CAN_RADIUS, "toy block": 0.0225}  # m, of their footprints
STANDING = ("cup", "can")
WITH_THE_OTHERS_M = 0.10
OTHERS_STAY_M = 0.05
CLUSTER_M = 0.075  # of the others from their middle


def thing(name: str, place=(0.0, 0.0, 0.0), yaw: float = 0.0) -> Body:
    if name == "apple":
        return apple(name, place, yaw)
    if name == "cup":
        return cup(name, place, BLUE, yaw)
    return can(name, place, GREEN, yaw) if name == "can" else block(name, name, place, yaw, (0.045,) * 3, 0.08, BLUE)


class MoveTheLonelyObjectToTheOthers(Task):
    """Success: less than 10 cm between the object that stood alone and the nearest of the others, which stayed
    together; everything on the table, let go, at rest, and upright where that is to be seen."""

    name = "move-the-lonely-object-to-the-others"
    instruction = "move the lonely object to the others"
    goal = (
        "the lonely object is next to the others",
        "the lonely object is on the table",
        "the others have stayed where they were",
    )
    kind = "SR"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        lonely, *others = (str(name) for name in rng.permutation(sorted(RADII)))
        side = 1.0 if rng.random() < 0.5 else -1.0
        middle = np.array([0.50, 0.17 * side]) + rng.uniform(-0.03, 0.03, 2)
        alone = np.array([0.46, -0.26 * side]) + rng.uniform(-0.04, 0.04, 2)
        first = rng.uniform(0.0, 2 * math.pi)
        angles = [first + 2 * math.pi * i / 3 for i in range(3)]
        places = {
            name: middle + CLUSTER_M * np.array([math.cos(a), math.sin(a)])
            for name, a in zip(others, angles, strict=True)
        }
        places[lonely] = alone
        things = [thing(name, (*places[name], 0.001), rng.uniform(-0.5, 0.5)) for name in sorted(RADII)]
        return SceneDescription(tuple(things), cameras((0.5, 0.0, 0.05)))

    def monitors(self) -> tuple[Monitor, ...]:
        return Moved(sorted(RADII)), Mishaps(sorted(RADII), upright=STANDING)

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        mishaps, moved = monitors["mishaps"], monitors["moved"]
        assert isinstance(mishaps, Mishaps) and isinstance(moved, Moved)
        lonely = _loneliest({name: place[:2] for name, place in moved.seen["from"].items()})
        others = [name for name in RADII if name != lonely]
        gap = min(self._gap(world, lonely, other) for other in others)
        pushed = max(others, key=moved.farthest)
        return checks.judge(
            f"the {lonely} is {100 * gap:.0f} cm from the others",
            [
                (
                    moved.farthest(pushed) < OTHERS_STAY_M,
                    f"the {pushed} was moved by {100 * moved.farthest(pushed):.0f} cm",
                ),
                (gap < WITH_THE_OTHERS_M, f"the {lonely} is {100 * gap:.0f} cm from the nearest of the others"),
                *((checks.upright(world, name), f"the {name} does not stand upright") for name in STANDING),
                (checks.on_table(world, lonely), f"the {lonely} is not on the table"),
                *checks.let_go(world, lonely),
            ],
            {"gap_m": gap, "others_moved_m": moved.farthest(pushed)},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action in checks.PICKING:
            return checks.picked(world, tuple(RADII), names)
        if action in checks.PLACING and names and names[0] in RADII:
            gap = min(self._gap(world, names[0], other) for other in RADII if other != names[0])
            done = gap < WITH_THE_OTHERS_M and checks.on_table(world, names[0]) and checks.released(world, names[0])
            return Outcome(done, f"the {names[0]} is {100 * gap:.0f} cm from the nearest other", {"gap_m": gap})
        return None

    def _gap(self, world: WorldState, one: str, other: str) -> float:
        return max(0.0, checks.level_distance(world, one, other) - RADII[one] - RADII[other])

    @property
    def reference_solution(self) -> str:
        return solution("handling", "lonely", calls="join_the_others()\n")


def _loneliest(places: dict[str, list[float]]) -> str:
    """The one with the longest way to its nearest neighbour."""
    return max(places, key=lambda name: min(math.dist(places[name], places[o]) for o in places if o != name))
