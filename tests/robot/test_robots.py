"""The arms of memo-robots: their published kinematics, and continuous joints that change nothing."""

from __future__ import annotations

import math

import attrs
import numpy as np
import pytest

pytest.importorskip("memo_robots", reason="make setup installs it")

from memo_robots.configured import Gen3Settings, UR5eSettings, configured
from memo_robots.gen3 import gen3
from memo_robots.ur5e import ur5e
from memo_sim_mujoco.simulator import MujocoSimulator
from memo_sim_pybullet.simulator import PybulletSimulator

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.simulated_link import SimulatorLink
from memo_core.errors import InvalidArgument
from memo_core.robot.urdf.reading import read_urdf
from memo_core.scene.description import SceneDescription
from memo_core.testing.robot import RULES

ROBOTS = {"ur5e": ur5e, "gen3": gen3}
# Universal Robots, "DH parameters for calculations of kinematics and dynamics", UR5e: a (m), d (m), alpha (rad).
UR5E_DH = (
    (0.0, 0.1625, math.pi / 2),
    (-0.425, 0.0, 0.0),
    (-0.3922, 0.0, 0.0),
    (0.0, 0.1333, math.pi / 2),
    (0.0, 0.0997, -math.pi / 2),
    (0.0, 0.0996, 0.0),
)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("rule", RULES)
def test_the_arm_keeps_the_rule(rule, robot):
    RULES[rule](ROBOTS[robot])


def test_the_ur5e_has_the_published_kinematics():
    robot = ur5e()
    kinematics = Kinematics(attrs.evolve(robot, tool_link="wrist_3_link"))
    half_a_turn = np.diag([-1.0, -1.0, 1.0, 1.0])  # our base looks towards what lies in front of the arm
    rng = np.random.default_rng(0)
    for joints in rng.uniform(-3.0, 3.0, (20, 6)):
        total = half_a_turn
        for (a, d, alpha), angle in zip(UR5E_DH, joints, strict=True):
            c, s, ca, sa = math.cos(angle), math.sin(angle), math.cos(alpha), math.sin(alpha)
            total = total @ [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
        assert np.allclose(kinematics.pose(joints).matrix, total, atol=1e-9)


def test_the_gen3_reaches_as_far_as_published_and_four_of_its_joints_have_no_end():
    robot = gen3()
    urdf = read_urdf(robot.urdf)
    endless = [name for name in robot.joint_names if math.isinf(urdf.joint(name).upper)]
    assert endless == ["joint_1", "joint_3", "joint_5", "joint_7"]
    flange = Kinematics(attrs.evolve(robot, tool_link="flange"))
    stretched = flange.pose(np.zeros(7)).position
    assert stretched[2] - 0.15643 - 0.12838 == pytest.approx(0.902, abs=0.003)  # Kinova: 902 mm from the shoulder


@pytest.mark.sim
@pytest.mark.parametrize("simulator", [MujocoSimulator, PybulletSimulator])
def test_continuous_joints_move_alike_in_the_simulators(simulator):
    """Bit for bit: the same targets, beyond one turn too, lead to the same positions and felt forces."""
    runs = []
    for continuous in ((), ("wrist_1", "wrist_3"), ("shoulder_pan", "wrist_2")):
        with simulator() as world:
            robot = ur5e(continuous)
            world.build(SceneDescription(bodies=()), robot)
            link = SimulatorLink(world, robot)
            start, seen = link.joint_targets(), []
            for tick in range(150):
                turn = min(tick, 120) / 120 * np.array([0.5, 0.2, -0.3, 1.0, -1.0, -3.0])
                link.send(start + turn)
                seen.append([*link.joint_positions(), *link.contact_wrench()])
            runs.append(np.array(seen))
    assert np.array_equal(runs[0], runs[1])
    assert np.array_equal(runs[0], runs[2])
    assert np.abs(runs[0][-1, :6] - (start + turn)).max() < 0.02, "the arm follows, past half a turn too"


@pytest.mark.sim
@pytest.mark.parametrize("build", [Kinematics, "mujoco", "pybullet"])
def test_a_joint_described_without_an_end_is_refused_with_what_to_write(build):
    robot = ur5e(("wrist_3",))
    endless = attrs.evolve(robot.joints[5], lower=-math.inf, upper=math.inf)
    robot = attrs.evolve(robot, joints=(*robot.joints[:5], endless))
    with pytest.raises(InvalidArgument, match=r"wrist_3_joint.*-inf to inf.*-6\.2832 to 6\.2832"):
        if build is Kinematics:
            Kinematics(robot)
        else:
            with MujocoSimulator() if build == "mujoco" else PybulletSimulator() as world:
                world.build(SceneDescription(bodies=()), robot)


def test_settings_change_the_description_and_name_the_key_that_is_wrong():
    assert configured(UR5eSettings(max_force=40.0)).gripper.max_force == 40.0
    assert configured(Gen3Settings()).name == "gen3"
    with pytest.raises(InvalidArgument, match=r"robot\.home.*6, one a joint"):
        configured(UR5eSettings(home=[0.0]))
    with pytest.raises(InvalidArgument, match=r"robot\.home.*joint_2"):
        configured(Gen3Settings(home=[0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
