"""Stack the cubes: all in one tower that stands for two seconds."""

from __future__ import annotations

import numpy as np

from memo_core.plugin import Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Mishaps, Standing
from memo_tabletop.objects import BLUE, GREEN, RED, block, cameras, scatter
from memo_tabletop.reference import solution

SIDE = 0.045  # m
CUBES = (("red cube", RED), ("green cube", GREEN), ("blue cube", BLUE))
STANDS_S = 2.0
RISE = 0.8 * SIDE  # m, at least, of a cube above the one it stands on


class StackTheCubes(Task):
    """Success: one tower of all cubes has stood for two seconds and still stands."""

    name = "stack-the-cubes"
    instruction = "stack the cubes"
    goal = ("the red cube, the green cube and the blue cube stand in one tower",)
    kind = "LH"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        places = scatter(rng, len(CUBES), (0.40, -0.25), (0.58, 0.25), 0.13)
        cubes = tuple(
            block(name, name, (x, y, 0.001), rng.uniform(-0.5, 0.5), (SIDE,) * 3, 0.08, colour)
            for (name, colour), (x, y) in zip(CUBES, places, strict=True)
        )
        return SceneDescription(cubes, cameras((0.5, 0.0, 0.1)))

    def monitors(self) -> tuple[Monitor, ...]:
        names = [name for name, _ in CUBES]
        return Standing(names, RISE), Mishaps(names)

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        tower, mishaps = monitors["standing"], monitors["mishaps"]
        assert isinstance(tower, Standing) and isinstance(mishaps, Mishaps)
        stood = tower.seconds(world)
        return checks.judge(
            f"the tower has stood for {stood:.1f} s",
            [
                (tower.seen["since"] is not None, "the cubes are not in one tower, let go"),
                (stood >= STANDS_S, f"the tower has stood for only {stood:.1f} s"),
            ],
            {"stood_s": stood},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        cubes = tuple(name for name, _ in CUBES)
        if action in checks.PICKING:
            return checks.picked(world, cubes, names)
        if action in checks.PLACING and len(names) == 2 and set(names) <= set(cubes):
            upper, lower = names
            rests = checks.touches(world, upper, lower)
            above = world.body_pose(upper).position[2] - world.body_pose(lower).position[2] >= RISE
            done = rests and above and checks.released(world, upper) and checks.at_rest(world, upper)
            return Outcome(done, f"the {upper} {'rests' if done else 'does not rest'} on the {lower}")
        return None

    @property
    def reference_solution(self) -> str:
        calls = 'stack("green cube", "red cube")\nstack("blue cube", "green cube")\ngo_home()\nwait(2.5)\n'
        return solution("stack_the_cubes", calls=calls)
