"""Set the table: the fork to the left of the plate, knife and spoon to its right, all pointing away."""

from __future__ import annotations

import math

import numpy as np

from memo_core.plugin import Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import Mishaps, Moved
from memo_tabletop.objects import PLATE_RADIUS, cameras, cutlery, plate, scatter
from memo_tabletop.reference import solution

PIECES = {"fork": 1.0, "knife": -1.0, "spoon": -1.0}  # which side of the plate: +1 left
NEAREST_M, FARTHEST_M = PLATE_RADIUS, PLATE_RADIUS + 0.12  # of a piece's middle from the plate's, sideways
OFFSET_M = 0.06  # of a piece's middle from the plate's, forward or back
ASKEW = math.radians(20)
PLATE_STAYS_M = 0.05


class SetTheTable(Task):
    """Success: each piece lies on the table on its side of the plate, its handle towards who eats there (on the
    robot's side), straight to within 20 degrees, as parallel to the others, let go and at rest."""

    name = "set-the-table"
    instruction = "set the table"
    goal = (
        "the fork is left of the plate",
        "the knife and the spoon are right of the plate",
        "the fork, the knife and the spoon lie straight",
        "the fork, the knife and the spoon are on the table",
        "the plate has stayed where it was",
    )
    kind = "LH"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.52, 0.14]) + rng.uniform(-0.03, 0.03, 2)
        places = scatter(rng, 3, (0.38, -0.42), (0.56, -0.12), 0.13)
        pieces = [cutlery(n, (*at, 0.001), rng.uniform(-0.6, 0.6)) for n, at in zip(PIECES, places, strict=True)]
        return SceneDescription((plate("plate", (x, y, 0.001)), *pieces), cameras((0.5, 0.0, 0.05)))

    def monitors(self) -> tuple[Monitor, ...]:
        return Mishaps(tuple(PIECES)), Moved(("plate",))

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        mishaps, moved = monitors["mishaps"], monitors["moved"]
        assert isinstance(mishaps, Mishaps) and isinstance(moved, Moved)
        turns = {name: self._turn(world, name) for name in PIECES}
        apart = max(turns.values()) - min(turns.values())
        askew = max(abs(turn) for turn in turns.values())
        pushed = moved.farthest("plate")
        return checks.judge(
            "fork, knife and spoon lie in their places",
            [
                (pushed < PLATE_STAYS_M, f"the plate was moved by {100 * pushed:.0f} cm"),
                *((self._in_place(world, name), f"the {name} is not in its place beside the plate") for name in PIECES),
                *((checks.on_table(world, name), f"the {name} does not lie on the table") for name in PIECES),
                *((checks.upright(world, name), f"the {name} does not lie flat") for name in PIECES),
                (askew <= ASKEW, f"a piece lies {math.degrees(askew):.0f} degrees askew"),
                (apart <= ASKEW, f"two pieces are {math.degrees(apart):.0f} degrees from parallel"),
                *(condition for name in PIECES for condition in checks.let_go(world, name)),
            ],
            {"askew_rad": askew, "apart_rad": apart, "placed": float(sum(self._in_place(world, n) for n in PIECES))},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action in checks.PICKING:
            return checks.picked(world, tuple(PIECES), names)
        if action in checks.PLACING and names and names[0] in PIECES:
            straight = abs(self._turn(world, names[0])) <= ASKEW
            done = straight and self._in_place(world, names[0]) and checks.released(world, names[0])
            return Outcome(done, f"the {names[0]} {'lies' if done else 'does not lie'} in its place")
        return None

    def _in_place(self, world: WorldState, name: str) -> bool:
        middle, place = world.body_pose(name).position, world.body_pose("plate").position
        aside = PIECES[name] * (middle[1] - place[1])
        return NEAREST_M <= aside <= FARTHEST_M and abs(middle[0] - place[0]) <= OFFSET_M

    def _turn(self, world: WorldState, name: str) -> float:
        """Angle (rad, -pi to pi) from straight away to where its tip points."""
        tip = world.body_pose(name).rotation[:, 0]
        return math.atan2(tip[1], tip[0])

    @property
    def reference_solution(self) -> str:
        calls = 'lay("fork", "plate", 0.045)\nlay("knife", "plate", -0.035)\nlay("spoon", "plate", -0.085)\n'
        return solution("handling", "cutlery", calls=calls)
