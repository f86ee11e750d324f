"""Stack the cubes: all in one tower that stands for two seconds."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from memo_core.interfaces.simulator import WorldState
from memo_core.interfaces.task import Monitor, Outcome, Task
from memo_core.scene.description import SceneDescription
from memo_tabletop import judging
from memo_tabletop.monitors import Mishaps, explained
from memo_tabletop.reference import solution
from memo_tabletop.things import BLUE, GREEN, RED, block, cameras

SIDE = 0.045  # m
CUBES = (("red cube", RED), ("green cube", GREEN), ("blue cube", BLUE))
STANDS_S = 2.0
LOOK_EVERY_S = 0.02


class TowerStands(Monitor):
    """Since when all cubes have stood on one another, untouched by the robot."""

    name = "tower"

    def __init__(self) -> None:
        self.since: float | None = None
        self._next = 0.0

    def reset(self, world: WorldState) -> None:
        self.since, self._next = None, 0.0

    def update(self, world: WorldState) -> None:
        # Contacts are dear to ask for, and nothing falls and is built up again within this period.
        if world.time < self._next:
            return
        self._next = world.time + LOOK_EVERY_S
        if not _piled(world) or not _chained(world):
            self.since = None
        elif self.since is None:
            self.since = world.time

    def memory(self) -> dict[str, Any]:
        return {"since": self.since, "next": self._next}

    def recall(self, memory: dict[str, Any]) -> None:
        self.since, self._next = memory["since"], memory["next"]


def _piled(world: WorldState) -> bool:
    """Quick look: is one cube as high as the top of a tower would be?"""
    top = (len(CUBES) - 0.6) * SIDE
    return any(world.body_pose(name).position[2] > top for name, _ in CUBES)


def _chained(world: WorldState) -> bool:
    """Whether each cube from the second up rests on the one below and the robot touches none."""
    order = sorted((name for name, _ in CUBES), key=lambda name: world.body_pose(name).position[2])
    for lower, upper in pairwise(order):
        touching = {name for c in world.contacts(upper) for name in (c.first, c.second)}
        if any(name.startswith("robot/") for name in touching) or lower not in touching:
            return False
        if world.body_pose(upper).position[2] - world.body_pose(lower).position[2] < 0.8 * SIDE:
            return False
    return judging.released(world, order[0])


class StackTheCubes(Task):
    """Success: one tower of all cubes has stood for two seconds and still stands."""

    name = "stack-the-cubes"
    instruction = "stack the cubes"
    kind = "LH"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        places: list[np.ndarray] = []
        while len(places) < len(CUBES):
            place = rng.uniform([0.40, -0.25], [0.58, 0.25])
            if all(np.linalg.norm(place - other) > 0.13 for other in places):
                places.append(place)
        cubes = tuple(
            block(name, name, (x, y, 0.001), rng.uniform(-0.5, 0.5), (SIDE,) * 3, 0.08, colour)
            for (name, colour), (x, y) in zip(CUBES, places, strict=True)
        )
        return SceneDescription(cubes, cameras((0.5, 0.0, 0.1)))

    def monitors(self) -> tuple[Monitor, ...]:
        names = [name for name, _ in CUBES]
        return TowerStands(), Mishaps(names)

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        return explained(self._verdict(world, monitors), monitors, world)

    def _verdict(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        tower = monitors["tower"]
        assert isinstance(tower, TowerStands)
        stood = 0.0 if tower.since is None else world.time - tower.since
        measures = {"stood_s": stood}
        if tower.since is None:
            return Outcome(False, "the cubes are not in one tower, let go", measures)
        if stood < STANDS_S:
            return Outcome(False, f"the tower has stood for only {stood:.1f} s", measures)
        return Outcome(True, f"the tower has stood for {stood:.1f} s", measures)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = judging.read_subtask(subtask)
        cubes = tuple(name for name, _ in CUBES)
        if action in judging.PICKING:
            return judging.picked(world, cubes, names)
        if action in judging.PLACING and len(names) == 2 and set(names) <= set(cubes):
            upper, lower = names
            rests = any(lower in (c.first, c.second) for c in world.contacts(upper))
            above = world.body_pose(upper).position[2] - world.body_pose(lower).position[2] > 0.8 * SIDE
            done = rests and above and judging.released(world, upper) and judging.at_rest(world, upper)
            return Outcome(done, f"the {upper} {'rests' if done else 'does not rest'} on the {lower}")
        return None

    @property
    def reference_solution(self) -> str:
        calls = 'stack("green cube", "red cube")\nstack("blue cube", "green cube")\ngo_home()\nwait(2.5)\n'
        return solution("stack_the_cubes", calls=calls)
