"""Put the trash away: what is trash goes into the bin, what is not stays on the table."""

from __future__ import annotations

import math

import numpy as np

from memo_core.plugin import Body, Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Mishaps
from memo_tabletop.objects import (
    GREEN,
    PORCELAIN,
    YELLOW,
    apple,
    block,
    cameras,
    crumpled_paper,
    cup,
    open_box,
    scatter,
)
from memo_tabletop.reference import solution

BIN = (0.20, 0.26, 0.13)  # depth, width, height
GREY = (0.35, 0.38, 0.40, 1.0)
TRASH = ("crumpled paper", "candy wrapper", "empty carton")
KEPT = ("apple", "cup")


def thing(name: str, place=(0.0, 0.0, 0.0), yaw: float = 0.0) -> Body:
    if name == "crumpled paper":
        return crumpled_paper(name, place, yaw)
    if name == "candy wrapper":
        return block(name, name, place, yaw, (0.055, 0.03, 0.016), 0.01, YELLOW)
    if name == "empty carton":
        return block(name, name, place, yaw, (0.045, 0.045, 0.06), 0.03, GREEN)
    return apple(name, place, yaw) if name == "apple" else cup(name, place, PORCELAIN, yaw)


def bin_at(x: float, y: float, yaw: float) -> Body:
    return open_box("bin", (x, y, 0.0), yaw, BIN, GREY)


class PutTheTrashAway(Task):
    """Success: all the trash lies in the bin, below its rim, let go and at rest; the apple and the cup do not."""

    name = "put-the-trash-away"
    instruction = "put the trash away"
    goal = (
        "the crumpled paper, the candy wrapper and the empty carton are in the bin",
        "the apple and the cup are on the table",
    )
    kind = "SR"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.36, 0.38]) + rng.uniform(-0.02, 0.02, 2)
        container = bin_at(x, y, rng.uniform(-math.radians(5), math.radians(5)))
        places = scatter(rng, 5, (0.40, -0.34), (0.60, 0.10), 0.125)
        things = [
            thing(name, (*place, 0.001), rng.uniform(-0.5, 0.5))
            for name, place in zip((*TRASH, *KEPT), places, strict=True)
        ]
        return SceneDescription((container, *things), cameras((0.5, 0.05, 0.05)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps((*TRASH, *KEPT), upright=("cup",)),)

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        mishaps = monitors["mishaps"]
        assert isinstance(mishaps, Mishaps)
        away = [name for name in TRASH if self._in_bin(world, name)]
        left = [name for name in TRASH if name not in away]
        thrown = [name for name in KEPT if self._in_bin(world, name)]
        return checks.judge(
            "all the trash is in the bin",
            [
                (not left, f"not in the bin, below its rim: {', '.join(left)}"),
                (not thrown, f"no trash, but in the bin: {', '.join(thrown)}"),
                *((checks.on_table(world, name), f"the {name} is not on the table any more") for name in KEPT),
                *(condition for name in TRASH for condition in checks.let_go(world, name)),
            ],
            {"away": float(len(away)), "thrown": float(len(thrown))},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action in checks.PICKING:
            return checks.picked(world, (*TRASH, *KEPT), names)
        if action in checks.PLACING and names and names[0] in TRASH:
            done = self._in_bin(world, names[0]) and checks.released(world, names[0])
            return Outcome(done, f"the {names[0]} {'lies' if done else 'does not lie'} in the bin")
        return None

    def _in_bin(self, world: WorldState, name: str) -> bool:
        return checks.inside(world, "bin", bin_at(0, 0, 0).cavities[0], thing(name))

    @property
    def reference_solution(self) -> str:
        calls = "".join(
            f'throw_into("bin", "{name}", {at})\n' for name, at in zip(TRASH, (-0.06, 0.0, 0.06), strict=True)
        )
        return solution("handling", "boxes", calls=calls)
