"""Motions by command: of an arm that follows its targets late."""

from __future__ import annotations

import numpy as np
import pytest
from memo_franka.description import fr3

from memo_core.arm.slow_motion import move_joints
from memo_core.errors import Stopped
from memo_core.testing.ideal_link import IdealLink


class LateLink(IdealLink):
    """Takes a fifth of the way to its target in each control period."""

    def _advance(self, targets):
        super()._advance(self._joints + 0.2 * (np.array(targets) - self._joints))
        self._targets = np.array(targets, dtype=float)


def test_a_slow_motion_ends_when_the_arm_is_there():
    link = LateLink(fr3())
    goal = link.joint_targets() + np.radians(5.0)
    move_joints(link, goal)
    assert np.abs(link.joint_positions() - goal).max() < 1e-3 and np.abs(link.joint_velocities()).max() < 0.03


def test_an_arm_that_something_holds_back_is_not_waited_for_for_ever():
    link = IdealLink(fr3())
    link.blocked = link.joint_targets() + 0.01
    move_joints(link, link.joint_targets() + 0.05)
    assert np.abs(link.joint_positions() - link.blocked).max() < 1e-9


def test_a_stop_while_it_waits_is_raised():
    link = LateLink(fr3())
    goal = link.joint_targets() + 0.05
    send, rows = link.send, []

    def counted(targets):
        rows.append(targets)
        if len(rows) > 1 and np.array_equal(rows[-1], rows[-2]):
            link.stop()
        send(targets)

    link.send = counted
    with pytest.raises(Stopped):
        move_joints(link, goal)
    assert link.stopped and np.abs(link.joint_targets() - goal).max() < 1e-2
