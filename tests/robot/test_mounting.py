"""A robot on a pedestal, on a wall or hanging: one frame for everything, and a mount that the arm keeps clear of."""

from __future__ import annotations

import math

import attrs
import numpy as np
import pytest

pytest.importorskip("memo_robots", reason="make setup installs it")

from memo_robots.configured import UR5eSettings, configured
from memo_robots.ur5e import ur5e
from memo_sim_mujoco.simulator import MujocoSimulator
from memo_sim_pybullet.simulator import PybulletSimulator

from memo_core.arm.collision import RobotShape
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.errors import InvalidArgument
from memo_core.robot.mounting import base_pose, mounted
from memo_core.scene.description import SceneDescription
from memo_core.scene.pose import Pose

MOUNTS = {
    "pedestal": UR5eSettings(base_position=[-0.1, 0.0, 0.25], mount_length=0.25),
    "wall": UR5eSettings(base_position=[-0.3, 0.0, 0.5], base_rpy=[0.0, math.pi / 2, 0.0], mount_length=0.2),
    "hanging": UR5eSettings(base_position=[0.2, 0.0, 1.0], base_rpy=[math.pi, 0.0, 0.0], mount_length=0.3),
}


@pytest.mark.sim
@pytest.mark.parametrize("simulator", [MujocoSimulator, PybulletSimulator])
@pytest.mark.parametrize("mount", MOUNTS)
def test_simulators_and_kinematics_put_the_hand_where_the_mount_says(mount, simulator):
    robot, plain = configured(MOUNTS[mount]), Kinematics(ur5e())
    home = np.array(robot.home)
    expected = base_pose(robot) * plain.pose(home)
    assert Kinematics(robot).pose(home).distance(expected) == pytest.approx((0.0, 0.0), abs=1e-6)
    with simulator() as world:
        world.build(SceneDescription(bodies=()), robot)
        assert world.tool_pose().distance(expected) == pytest.approx((0.0, 0.0), abs=1e-4)
        assert world.body_pose("robot/base_link").position == pytest.approx(base_pose(robot).position, abs=1e-6)


def test_the_arm_keeps_clear_of_its_mount():
    robot = configured(MOUNTS["pedestal"])
    kinematics = Kinematics(robot)
    checker = RobotShape(robot, kinematics).checker([], 0.0)
    assert not checker.collides(kinematics.home, "free")
    beside = kinematics.samples(3000)
    _, position = kinematics.forward(beside)
    inside = beside[:, (np.hypot(position[0] + 0.1, position[1]) < 0.05) & (position[2] > 0.05) & (position[2] < 0.2)]
    assert inside.shape[1] > 0
    for joints in inside.T:
        assert checker.collides(joints, "free")
    free = Kinematics(mounted(ur5e(), [-0.1, 0.0, 0.25], [0.0, 0.0, 0.0]))
    without = RobotShape(free.description, free).checker([], 0.0)
    assert any(not without.collides(joints, "free") for joints in inside.T)


@pytest.mark.sim
def test_gravity_stays_the_worlds():
    """A hanging arm holds its home: its weight is compensated the right way round."""
    with MujocoSimulator() as world:
        robot = configured(MOUNTS["hanging"])
        world.build(SceneDescription(bodies=()), robot)
        for _ in range(100):
            world.tick()
        assert np.abs(world.joint_positions() - robot.home).max() < 1e-3


def test_no_mount_changes_nothing_and_a_second_one_is_refused():
    robot = ur5e()
    assert configured(UR5eSettings()).urdf == robot.urdf
    assert base_pose(robot) == Pose()
    once = mounted(robot, [0, 0, 0.1], [0, 0, 0])
    with pytest.raises(InvalidArgument, match="mounted already"):
        mounted(once, [0, 0, 0.1], [0, 0, 0])
    with pytest.raises(InvalidArgument, match="base_position"):
        attrs.evolve(UR5eSettings(), base_position=[1.0])
