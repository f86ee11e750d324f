"""Make toast: a slice of bread into the toaster's slot, and the lever down until it latches."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from memo_core.plugin import Monitor, Outcome, SceneDescription, Task, WorldState
from memo_tabletop import success_checks as checks
from memo_tabletop.appliances import DOWN, LATCHED_WITHIN, SLICE, TOASTER_SIZE, bread_rack, toaster
from memo_tabletop.monitors import Mishaps, story_of
from memo_tabletop.objects import CRUST, block, cameras
from memo_tabletop.reference import solution

SUNK_M = 0.010  # of the slice's top below the toaster's; the lever takes it to 14 mm below
LOWERING = ("PRESS", "PUSH", "PUSH_DOWN", "LOWER", "TURN_ON", "PRESS_DOWN")


class MakeToast(Task):
    """Success: the slice is down in the slot, the lever latched, and the robot touches neither."""

    name = "make-toast"
    instruction = "make toast"
    goal = ("the bread is in the toaster", "the toaster lever is down", "the hand has let go of the toaster lever")
    kind = "SR"

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        x, y = np.array([0.52, 0.14]) + rng.uniform(-0.02, 0.02, 2)
        machine, latch = toaster("toaster", (x, y, 0.0), rng.uniform(-math.radians(5), math.radians(5)))
        u, v = np.array([0.48, -0.20]) + rng.uniform(-0.02, 0.02, 2)
        yaw = rng.uniform(-0.35, 0.35)
        rack = bread_rack("bread rack", (u, v, 0.0), yaw)
        bread = block("bread", "bread", (u, v, 0.0065), yaw, SLICE, 0.04, CRUST)
        return SceneDescription((machine, rack, bread), cameras((x, y - 0.1, 0.12)), (latch,))

    def monitors(self) -> tuple[Monitor, ...]:
        return (Mishaps(("bread",)),)

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        down = world.joint_position("toaster/lever")
        sunk = self._sunk(world)
        measures = {"lever_m": down, "sunk_m": sunk}
        mishaps = story_of(monitors, world)
        conditions = (
            (self._in_slot(world), "the bread is not in the toaster's slot"),
            (self._latched(world), f"the lever is not latched, {max(0.0, down) * 1000:.0f} mm down"),
            (sunk > SUNK_M, f"the bread's top is {-sunk * 1000:.0f} mm above the toaster"),
            *checks.let_go(world, "bread"),
            (checks.released(world, "toaster/carriage"), "the robot still touches the lever"),
        )
        return checks.judge("the bread is down in the toaster, the lever latched", conditions, measures, mishaps)

    def check_subtask(self, subtask: str, world: WorldState) -> Outcome | None:
        action, names = checks.read_subtask(subtask)
        if action in checks.PICKING:
            return checks.picked(world, ("bread",), names)
        if action in checks.PLACING and names and names[0] in ("bread", "slice", "slice of bread"):
            done = self._in_slot(world) and checks.released(world, "bread")
            return Outcome(done, f"the bread {'is' if done else 'is not'} in the slot", {"sunk_m": self._sunk(world)})
        if action in LOWERING:
            down = world.joint_position("toaster/lever")
            return Outcome(self._latched(world), f"the lever is {down * 1000:.0f} mm down", {"lever_m": down})
        return None

    def _latched(self, world: WorldState) -> bool:
        return abs(world.joint_position("toaster/lever") - DOWN) < LATCHED_WITHIN / 2

    def _sunk(self, world: WorldState) -> float:
        """How far the highest corner of the slice is below the toaster's top (m)."""
        slice_ = block("bread", "bread", (0.0, 0.0, 0.0), 0.0, SLICE, 0.04, CRUST)
        _, high = checks.spread(slice_, world.body_pose("toaster").inverse() * world.body_pose("bread"))
        return float(TOASTER_SIZE[2] - high[2])

    def _in_slot(self, world: WorldState) -> bool:
        """Whether its lower half is within the slot's walls."""
        machine, _ = toaster("toaster", (0.0, 0.0, 0.0), 0.0)
        slot = machine.cavities[0]
        frame = (world.body_pose("toaster") * slot.pose).inverse() * world.body_pose("bread")
        low = checks.spread(block("bread", "bread", (0.0, 0.0, 0.0), 0.0, SLICE, 0.04, CRUST), frame)[0]
        centre = np.abs(np.asarray(frame.position))
        return bool(np.all(centre <= np.asarray(slot.size) / 2) and low[2] < 0.0)

    @property
    def reference_solution(self) -> str:
        return solution("make_toast", calls="insert_bread()\npress_lever()\n")
