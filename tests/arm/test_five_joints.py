"""An arm with five joints does what five joints can, and says why it does not do more."""

from __future__ import annotations

import pytest
from memo_sim_mujoco.simulator import MujocoSimulator

from memo_core.errors import MotionError
from memo_core.testing.robot_check.motion import RULES
from memo_core.testing.robot_check.trial import RobotTrial
from memo_core.testing.rules import Limited
from tests.support.arms import control_of, five_joint_arm, six_joint_arm

DOWN = [0.0, 1.0, 0.0, 0.0]
SIDEWAYS = [0.5, -0.5, 0.5, 0.5]  # pointing to the left, which needs a sixth joint straight ahead of the base


@pytest.mark.sim
def test_it_picks_a_cube_up_from_above():
    grasp = RobotTrial(five_joint_arm(), MujocoSimulator).grasp
    assert grasp.step == "", grasp.why


def test_the_check_says_what_five_joints_cannot_do():
    with pytest.raises(Limited, match="it has 5 joints: where the hand is decides which way it can point"):
        RULES["it_reaches_in_six_dimensions"](RobotTrial(five_joint_arm(), MujocoSimulator))


def test_a_pose_it_cannot_take_is_refused_with_the_reason():
    control, _, _ = control_of(five_joint_arm())
    control.move_to([0.4, 0.0, 0.25], list(control.tool_pose().orientation), None, 0.0, 1.0)
    with pytest.raises(MotionError, match="with 5 joints its place decides which way the hand can point"):
        control.move_to([0.4, 0.0, 0.25], SIDEWAYS, None, 0.0, 1.0)


def test_six_joints_are_not_told_so():
    control, _, _ = control_of(six_joint_arm())
    with pytest.raises(MotionError) as raised:
        control.move_to([0.95, 0.0, 0.6], DOWN, None, 0.0, 1.0)
    assert "joints its place" not in str(raised.value)
