"""A stop ends planning within milliseconds, wherever in the search it comes."""

from __future__ import annotations

import time

import numpy as np
import pytest
from memo_franka.description import panda

from memo_core.arm.motion import MotionPlanner, PlanningScene
from memo_core.errors import Stopped
from memo_core.scene.pose import Pose, quaternion_from_axis_angle


class Switch:
    """Stops at the n-th poll and keeps the longest time (s, of this thread's processor) between two."""

    def __init__(self, after: int) -> None:
        self.left = after
        self.longest = 0.0
        self.last = time.thread_time()

    def __call__(self) -> None:
        now = time.thread_time()
        self.longest = max(self.longest, now - self.last)
        self.last = now
        self.left -= 1
        if self.left == 0:
            raise Stopped("planning a motion")


def plan_an_arc(poll):
    planner = MotionPlanner(panda(), 0.01, poll)
    poll.last = time.thread_time()
    down = (0.0, 1.0, 0.0, 0.0)
    arc = [
        Pose((0.5 + 0.1 * np.cos(a), 0.1 * np.sin(a), 0.4), quaternion_from_axis_angle((0, 0, 1), a))
        * Pose(orientation=down)
        for a in np.linspace(0, 1.4, 15)
    ]
    return planner.move("move_to", planner.kinematics.home, arc[0], arc[1:], 0.7, 1.0, PlanningScene((), 0.08), 0.0)


@pytest.mark.parametrize("after", [1, 5, 20, 60])
def test_a_stop_while_planning_ends_it(after):
    with pytest.raises(Stopped):
        plan_an_arc(Switch(after))


def test_planning_asks_often_enough_for_the_promise():
    switch = Switch(10**9)
    plan_an_arc(switch)
    assert switch.longest < 0.05, "50 ms is what a stop may take in all"
    assert 10**9 - switch.left > 60
