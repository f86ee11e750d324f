"""A suction cup: it pulls what it touches while it is on, in both simulators."""

from __future__ import annotations

import attrs
import pytest

pytest.importorskip("memo_robots", reason="make setup installs it")

from memo_robots.configured import UR5eSettings, configured
from memo_sim_mujoco.simulator import MujocoSimulator
from memo_sim_pybullet.simulator import PybulletSimulator

from memo_core.arm.collision import RobotShape
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.errors import InvalidArgument
from memo_core.scene.description import SceneDescription
from memo_core.testing.robot import RULES
from memo_core.testing.robot_check.trial import RobotTrial

ROBOT = configured(UR5eSettings(gripper="vacuum"))
SIMULATORS = {"mujoco": MujocoSimulator, "pybullet": PybulletSimulator}


@pytest.mark.parametrize("rule", RULES)
def test_an_arm_with_a_cup_keeps_the_rules(rule):
    RULES[rule](lambda: ROBOT)


@pytest.mark.sim
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_a_cube_is_picked_up_from_above(simulator):
    grasp = RobotTrial(ROBOT, SIMULATORS[simulator]).grasp
    assert grasp.step == "", grasp.why


@pytest.mark.sim
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_a_cup_too_weak_for_the_cube_lets_it_lie(simulator):
    weak = attrs.evolve(ROBOT, gripper=attrs.evolve(ROBOT.gripper, max_force=0.5, min_force=0.1))
    assert RobotTrial(weak, SIMULATORS[simulator]).grasp.step in ("close", "lift")


@pytest.mark.sim
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_nothing_is_held_in_the_air_and_the_valve_is_part_of_a_checkpoint(simulator):
    with SIMULATORS[simulator]() as world:
        world.build(SceneDescription(bodies=()), ROBOT)
        off = world.checkpoint()
        assert world.gripper_width() == pytest.approx(ROBOT.gripper.stroke)
        world.command_gripper(0.0, 20.0)
        for _ in range(30):
            world.tick()
        assert world.gripper_width() == 0.0 and world.gripper_effort() == 0.0
        world.restore(off)
        assert world.gripper_width() == pytest.approx(ROBOT.gripper.stroke)


def test_a_cup_that_is_no_link_is_refused():
    with MujocoSimulator() as world, pytest.raises(InvalidArgument, match=r"gripper\.pads.*names no cup"):
        cupless = attrs.evolve(ROBOT, gripper=attrs.evolve(ROBOT.gripper, pads=()))
        world.build(SceneDescription(bodies=()), cupless)


def test_the_cup_may_touch_what_it_goes_down_onto():
    shape = RobotShape(ROBOT, Kinematics(ROBOT))
    assert shape.roles[shape.links.index("hand_cup")] == "finger"
