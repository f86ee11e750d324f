"""Two cans, told apart only by where they stand: pick the left one; move the right one to the left one."""

from __future__ import annotations

import numpy as np

from memo_core.plugin import Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.monitors import HeldUp, Mishaps, Moved
from memo_tabletop.objects import CAN_RADIUS, GREEN, RED, cameras, can
from memo_tabletop.reference import solution

CANS = (("red can", RED), ("green can", GREEN))
HELD_HEIGHT_M = 0.10
HELD_S = 1.0
OTHER_STAYS_M = 0.02
LEFT_STAYS_M = 0.03
TOGETHER_M = 0.08


class TwoCans(Task):
    """Left is the robot's left (+y). Which colour stands there changes with the seed."""

    kind = "SR"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        swapped = rng.random() < 0.5
        right = rng.uniform([0.40, -0.28], [0.58, -0.14])
        left = rng.uniform([0.40, 0.10], [0.58, 0.24])
        (x1, y1), (x2, y2) = (left, right) if swapped else (right, left)
        (first, red), (second, green) = CANS
        cans = (
            can(first, (x1, y1, 0.001), red, rng.uniform(-0.5, 0.5)),
            can(second, (x2, y2, 0.001), green, rng.uniform(-0.5, 0.5)),
        )
        return SceneDescription(cans, cameras((0.5, 0.0, 0.1)))

    def monitors(self) -> tuple[Monitor, ...]:
        names = [name for name, _ in CANS]
        lifted = (HeldUp(n, HELD_HEIGHT_M, f"held up: {n}") for n in names)
        return (Moved(names), Mishaps(names, upright=names), *lifted)

    def sides(self, monitors: dict[str, Monitor]) -> tuple[str, str]:
        """(left, right) as they stood at the beginning."""
        moved = monitors["moved"]
        assert isinstance(moved, Moved)
        left, right = sorted(moved.things, key=lambda name: -moved.seen["from"][name][1])
        return left, right


class PickTheLeftCan(TwoCans):
    """Success: the can that stood on the left is held 10 cm up, for a second by now, and the other stayed."""

    name = "pick-the-left-can"
    instruction = "pick the left can"
    goal = ("the hand holds the left can up", "the right can has stayed where it was")

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        moved, mishaps = monitors["moved"], monitors["mishaps"]
        left, right = self.sides(monitors)
        held = monitors[f"held up: {left}"]
        assert isinstance(moved, Moved) and isinstance(mishaps, Mishaps) and isinstance(held, HeldUp)
        seconds, lifted, pushed = held.seconds(world), held.lifted(world), moved.farthest(right)
        return checks.judge(
            f"the {left} has been held up for {seconds:.1f} s",
            [
                (pushed < OTHER_STAYS_M, f"the other can, the {right}, was moved by {100 * pushed:.0f} cm"),
                (
                    checks.held(world, left),
                    f"the {left}, which stood on the left, is not held clear of everything",
                ),
                (lifted >= HELD_HEIGHT_M, f"the {left} is only {100 * lifted:.0f} cm up"),
                (seconds >= HELD_S, f"the {left} has been held up for only {seconds:.1f} s"),
            ],
            {"held_s": seconds, "lifted_m": lifted, "other_moved_m": pushed},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        return checks.picked(world, tuple(n for n, _ in CANS), names) if action in checks.PICKING else None

    @property
    def reference_solution(self) -> str:
        return solution("handling", "cans", calls="pick_up(leftmost())\nwait(1.5)\n")


class MoveTheRightCanToTheLeftCan(TwoCans):
    """Success: the can that stood on the right stands beside the other, less than 8 cm between them, and that one
    stayed where it was."""

    name = "move-the-right-can-to-the-left-can"
    instruction = "move the right can to the left can"
    goal = (
        "the right can is next to the left can",
        "the left can has stayed where it was",
        "the left can and the right can stand upright",
        "the hand has let go of the right can",
    )

    def check(self, world: WorldState, monitors: dict[str, Monitor]) -> Outcome:
        moved, mishaps = monitors["moved"], monitors["mishaps"]
        assert isinstance(moved, Moved) and isinstance(mishaps, Mishaps)
        left, right = self.sides(monitors)
        gap = max(0.0, checks.level_distance(world, left, right) - 2 * CAN_RADIUS)
        pushed = moved.farthest(left)
        return checks.judge(
            f"the {right} stands {100 * gap:.0f} cm from the {left}",
            [
                (pushed < LEFT_STAYS_M, f"the left can, the {left}, was moved by {100 * pushed:.0f} cm"),
                *((checks.upright(world, n), f"the {n} does not stand upright") for n in (left, right)),
                (checks.on_table(world, right), f"the {right} does not stand on the table"),
                (gap < TOGETHER_M, f"there are {100 * gap:.0f} cm between the cans"),
                *checks.let_go(world, right),
                *checks.let_go(world, left),
            ],
            {"gap_m": gap, "left_moved_m": pushed},
            mishaps.story(world),
        )

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        cans = tuple(n for n, _ in CANS)
        if action in checks.PICKING:
            return checks.picked(world, cans, names)
        if action in checks.PLACING and names and names[0] in cans:
            near = checks.level_distance(world, *cans) - 2 * CAN_RADIUS < TOGETHER_M
            stands = checks.upright(world, names[0]) and checks.on_table(world, names[0])
            done = near and stands and checks.released(world, names[0])
            return Outcome(done, f"the {names[0]} {'stands' if done else 'does not stand'} beside the other")
        return None

    @property
    def reference_solution(self) -> str:
        return solution("handling", "cans", calls="put_beside(rightmost(), leftmost())\n")
