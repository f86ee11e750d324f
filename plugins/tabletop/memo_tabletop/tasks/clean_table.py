"""Clean up the table: the dishes into the tub, the napkin into the bin."""

from __future__ import annotations

import math

import numpy as np

from memo_core.plugin import Body, Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Mishaps
from memo_tabletop.objects import BLUE, cameras, crumpled_paper, cup, cutlery, open_box, scatter
from memo_tabletop.reference import solution

TUB, BIN = (0.24, 0.34, 0.10), (0.18, 0.20, 0.13)  # depth, width, height
GREY = (0.35, 0.38, 0.40, 1.0)
TEAL = (0.25, 0.52, 0.55, 1.0)
WHERE = {"fork": "tub", "spoon": "tub", "cup": "tub", "napkin": "bin"}


def thing(name: str, place=(0.0, 0.0, 0.0), yaw: float = 0.0) -> Body:
    if name == "cup":
        return cup(name, place, BLUE, yaw)
    return crumpled_paper(name, place, yaw) if name == "napkin" else cutlery(name, place, yaw)


def container(name: str, x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Body:
    return open_box(name, (x, y, 0.0), yaw, *((TUB, TEAL) if name == "tub" else (BIN, GREY)))


class CleanUpTheTable(Task):
    """Success: fork, spoon and cup wholly in the tub, the napkin in the bin, let go and at rest."""

    name = "clean-up-the-table"
    instruction = "clean up the table"
    goal = ("the fork, the spoon and the cup are in the tub", "the napkin is in the bin")
    kind = "LH"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        yaw = math.radians(5)
        (x1, y1), (x2, y2) = np.array([[0.36, 0.44], [0.34, -0.50]]) + rng.uniform(-0.02, 0.02, (2, 2))
        boxes = container("tub", x1, y1, rng.uniform(-yaw, yaw)), container("bin", x2, y2, rng.uniform(-yaw, yaw))
        places = scatter(rng, 4, (0.41, -0.23), (0.62, 0.11), 0.15)
        things = [
            thing(name, (*place, 0.001), rng.uniform(-0.35, 0.35)) for name, place in zip(WHERE, places, strict=True)
        ]
        return SceneDescription((*boxes, *things), cameras((0.5, 0.0, 0.05)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(tuple(WHERE)),)

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        mishaps = monitors["mishaps"]
        assert isinstance(mishaps, Mishaps)
        away = {name: self._put_away(world, name) for name in WHERE}
        return checks.judge(
            "the dishes are in the tub, the napkin is in the bin",
            [
                *((away[name], f"the {name} is not wholly in the {box}") for name, box in WHERE.items()),
                *(condition for name in WHERE for condition in checks.let_go(world, name)),
            ],
            {"away": float(sum(away.values()))},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action in checks.PICKING:
            return checks.picked(world, tuple(WHERE), names)
        if action in checks.PLACING and names and names[0] in WHERE:
            done = self._put_away(world, names[0]) and checks.released(world, names[0])
            return Outcome(done, f"the {names[0]} {'lies' if done else 'does not lie'} in the {WHERE[names[0]]}")
        return None

    def _put_away(self, world: WorldState, name: str) -> bool:
        box = container(WHERE[name])
        return checks.inside(world, box.name, box.cavities[0], thing(name))

    @property
    def reference_solution(self) -> str:
        calls = (
            'throw_into("tub", "cup", 0.09)\nthrow_into("tub", "fork", -0.11, "width")\n'
            'throw_into("tub", "spoon", -0.045, "width")\nthrow_into("bin", "napkin", 0.0)\n'
        )
        return solution("handling", "boxes", calls=calls)
