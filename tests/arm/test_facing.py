"""An arm that works to another side than +x, where the tasks put things, is told and turned."""

from __future__ import annotations

import math

import pytest
from memo_franka.description import panda

from memo_core.arm.description_from_urdf import describe_urdf
from memo_core.arm.facing import facing
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.plugins.registry import Registry
from memo_core.robot.mounting import mounted
from memo_core.testing.plugins import check_robot
from tests.support.arms import facing_arm, six_joint_arm


@pytest.mark.parametrize(
    ("yaw", "side", "turn"),
    [(0.0, "+x", 0.0), (math.pi, "-x", math.pi), (math.pi / 2, "+y", -math.pi / 2), (-math.pi / 2, "-y", math.pi / 2)],
)
def test_the_side_an_arm_faces_is_found_and_turning_its_base_by_that_mends_it(yaw, side, turn):
    described = describe_urdf(facing_arm(yaw), "facing")
    found = facing(Kinematics(described.robot), described.robot.reach)
    assert (found.side, found.turn, described.turned) == (side, turn, turn)
    told = {guess.what: guess for guess in described.guessed}
    assert ("base_rpy" in told) == bool(turn)
    right = mounted(described.robot, [0.0, 0.0, 0.0], [0.0, 0.0, described.turned]) if turn else described.robot
    kinematics = Kinematics(right)
    assert facing(kinematics, right.reach).side == "+x"
    assert kinematics.pose(kinematics.home).position[0] > 0.2  # home is ahead once it is turned


def test_arms_that_turn_all_round_face_ahead():
    for robot in (panda(), six_joint_arm()):
        assert facing(Kinematics(robot), robot.reach).side == "+x", robot.name


@pytest.mark.sim
def test_the_check_says_which_way_an_arm_faces_and_what_to_write():
    robot = describe_urdf(facing_arm(math.pi), "facing").robot
    found = list(check_robot(Registry(), "robot/facing", lambda: robot))
    [why] = [one.why for one in found if one.outcome in ("broken", "limited")]
    assert why.startswith("the arm faces -x: ") and "base_rpy: [0, 0, 3.1416]" in why
