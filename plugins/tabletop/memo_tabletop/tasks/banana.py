"""Put the banana on the plate: a long object among other fruit, and a rim to clear."""

from __future__ import annotations

import numpy as np

from memo_core.plugin import Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Mishaps
from memo_tabletop.objects import PLATE_RADIUS, apple, banana, cameras, plate
from memo_tabletop.reference import solution

WELL_ON = 0.7  # of the plate's radius: from there on it hangs over the rim


class PutTheBananaOnThePlate(Task):
    """Success: the banana lies on the plate, its middle within 0.7 of the plate's radius, let go and at rest."""

    name = "put-the-banana-on-the-plate"
    instruction = "put the banana on the plate"
    goal = ("the banana is on the plate", "the hand has let go of the banana")
    kind = "SR"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = rng.uniform([0.45, 0.08], [0.58, 0.22])
        fruit = rng.uniform([0.40, -0.32], [0.55, -0.24]), rng.uniform([0.40, -0.12], [0.55, -0.08])
        one, other = fruit if rng.random() < 0.5 else fruit[::-1]
        things = (
            plate("plate", (x, y, 0.001)),
            banana("banana", (one[0], one[1], 0.001), rng.uniform(-0.7, 0.7)),
            apple("apple", (other[0], other[1], 0.001)),
        )
        return SceneDescription(things, cameras((0.5, 0.0, 0.05)))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(("banana",)),)

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        mishaps = monitors["mishaps"]
        assert isinstance(mishaps, Mishaps)
        away = checks.level_distance(world, "banana", "plate")
        return checks.judge(
            "the banana lies on the plate",
            [
                (checks.touches(world, "banana", "plate"), "the banana does not touch the plate"),
                (away <= WELL_ON * PLATE_RADIUS, f"the banana's middle is {100 * away:.0f} cm from the plate's"),
                (not checks.on_table(world, "banana"), "the banana leans on the table"),
                (checks.upright(world, "plate"), "the plate does not lie flat"),
                (checks.on_table(world, "plate"), "the plate does not lie on the table"),
                *checks.let_go(world, "banana"),
            ],
            {"from_middle_m": away},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action in checks.PICKING:
            return checks.picked(world, ("banana", "apple"), names)
        if action in checks.PLACING and names and names[0] == "banana":
            near = checks.level_distance(world, "banana", "plate") <= WELL_ON * PLATE_RADIUS
            done = near and checks.touches(world, "banana", "plate") and checks.released(world, "banana")
            return Outcome(done, f"the banana {'lies' if done else 'does not lie'} on the plate")
        return None

    @property
    def reference_solution(self) -> str:
        return solution("handling", "fruit", calls='put_on("banana", "plate")\n')
