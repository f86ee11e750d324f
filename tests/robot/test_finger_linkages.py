"""Fingers on hinges with mimic joints, as Robotiq's and xArm's: opening, force and a cube in both simulators."""

from __future__ import annotations

import math
import re

import attrs
import numpy as np
import pytest

pytest.importorskip("memo_robots", reason="make setup installs it")

from memo_robots.ur5e import _urdf
from memo_sim_mujoco.simulator import MujocoSimulator
from memo_sim_pybullet.simulator import PybulletSimulator

from memo_core.arm.description_from_urdf import describe_urdf
from memo_core.errors import InvalidArgument
from memo_core.robot.finger_linkage import FingerLinkage
from memo_core.robot.parallel_hand import ParallelHand
from memo_core.robot.urdf.reading import read_urdf
from memo_core.robot.urdf.text import Solid, box_inertia, joint_text, link_text
from memo_core.scene.description import SceneDescription
from memo_core.testing.robot import RULES
from memo_core.testing.robot_check.trial import RobotTrial
from tests.support.arms import six_joint_arm

LENGTH, APART = 0.055, 0.030  # m: knuckle to fingertip joint, and of the knuckles from the middle
SIMULATORS = {"mujoco": MujocoSimulator, "pybullet": PybulletSimulator}


def four_bar_hand(flange: str, tip_multiplier: float = -1.0) -> str:
    """A hand whose four hinges follow ``drive``: each knuckle swings out, its tip turns back and stays parallel."""
    palm = Solid("box", (0.06, 0.14, 0.06), (0, 0, 0.03))
    bar = Solid("box", (0.02, 0.012, LENGTH), (0, 0.006, LENGTH / 2))
    pad = Solid("box", (0.022, 0.012, 0.05), (0, 0.006, 0.025))
    parts = [
        link_text("palm", box_inertia(0.6, (0.06, 0.14, 0.06), (0, 0, 0.03)), (palm,), (palm,)),
        joint_text("palm_mount", "fixed", flange, "palm"),
    ]
    limit = '<limit lower="0" upper="{}" velocity="2" effort="10"/>'
    for side, turned in (("left", 0.0), ("right", math.pi)):
        # Shut, the knuckle leans inwards by half a radian; driven, it swings out.
        parts += [
            link_text(
                f"{side}_knuckle", box_inertia(0.05, (0.02, 0.012, LENGTH), (0, 0.006, LENGTH / 2)), (bar,), (bar,)
            ),
            link_text(f"{side}_tip", box_inertia(0.05, (0.022, 0.012, 0.05), (0, 0.006, 0.025)), (pad,), (pad,)),
        ]
        origin = ((0.0, APART * math.cos(turned), 0.062), (0.0, 0.0, turned))
        mimic = "" if side == "left" else '<mimic joint="drive"/>'
        name = "drive" if side == "left" else "right_knuckle_joint"
        inside = limit.format(0.7) + mimic
        parts.append(joint_text(name, "revolute", "palm", f"{side}_knuckle", *origin, "-1 0 0", inside))
        lean = ((0.0, -APART * 0.97, math.sqrt(LENGTH**2 - (APART * 0.97) ** 2)), (0.0, 0.0, 0.0))
        tip = limit.format(0.7).replace('"0"', '"-0.7"', 1) + f'<mimic joint="drive" multiplier="{tip_multiplier}"/>'
        parts.append(
            joint_text(f"{side}_tip_joint", "revolute", f"{side}_knuckle", f"{side}_tip", *lean, "-1 0 0", tip)
        )
    return "\n".join(parts)


ARM = _urdf(())
URDF = ARM.replace("</robot>", four_bar_hand("wrist_3_link") + "</robot>")


@pytest.fixture(scope="module")
def robot():
    return describe_urdf(URDF, "linked").robot


@pytest.mark.parametrize("rule", RULES)
def test_a_linkage_keeps_the_rules(robot, rule):
    RULES[rule](lambda: robot)


def test_the_opening_is_that_of_the_pads_and_its_inverse_is_exact(robot):
    linkage = FingerLinkage(read_urdf(robot.urdf), robot.gripper)
    assert robot.gripper.finger_joints[0] == "drive"
    assert dict(zip(linkage.names, linkage.multipliers, strict=True)) == {
        "drive": 1.0, "left_tip_joint": -1.0, "right_knuckle_joint": 1.0, "right_tip_joint": -1.0
    }  # fmt: skip
    start = math.asin(-0.97 * APART / LENGTH)
    for angle in (0.1, 0.35, 0.6):
        moved = 2 * LENGTH * (math.sin(start + angle) - math.sin(start))
        assert linkage.opening(angle) == pytest.approx(moved, abs=1e-4)
        assert linkage.driver(linkage.opening(angle)) == pytest.approx(angle, abs=1e-6)
        assert linkage.lever(angle) == pytest.approx(2 * LENGTH * math.cos(start + angle), rel=0.02)


@pytest.mark.sim
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_the_fingers_go_to_an_opening_and_stay_coupled(robot, simulator):
    with SIMULATORS[simulator]() as world:
        world.build(SceneDescription(bodies=()), robot)
        assert world.gripper_width() == pytest.approx(robot.gripper.stroke, abs=1e-3)
        for width in (0.02, 0.05):
            world.command_gripper(width, 30.0)
            for _ in range(150):
                world.tick()
            assert world.gripper_width() == pytest.approx(width, abs=2e-3)
            left, right = (np.array(world.body_pose(f"robot/{side}_tip").position) for side in ("left", "right"))
            middle = world.tool_pose().inverse().apply((left + right) / 2)
            assert np.abs(middle[:2]).max() < 1e-3, "the fingers stay symmetrical"
            assert world.body_pose("robot/left_tip").distance(world.tool_pose())[1] < 0.05, "pads stay parallel"


@pytest.mark.sim
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_a_cube_is_picked_up(robot, simulator):
    trial = RobotTrial(robot, SIMULATORS[simulator])
    assert trial.grasp.step == "", trial.grasp.why
    assert trial.grasp.width > 0.02


@pytest.mark.sim
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_a_checkpoint_holds_the_fingers(robot, simulator):
    with SIMULATORS[simulator]() as world:
        world.build(SceneDescription(bodies=()), robot)
        world.command_gripper(0.01, 20.0)
        for _ in range(20):
            world.tick()
        kept = world.checkpoint()
        seen = []
        for _ in range(2):
            world.restore(kept)
            for _ in range(30):
                world.tick()
            seen.append(world.gripper_width())
        assert seen[0] == seen[1]


def test_linkages_that_cannot_be_are_refused():
    urdf = read_urdf(URDF)
    gripper = describe_urdf(URDF).robot.gripper
    with pytest.raises(InvalidArgument, match="mimics 'drive', but the driven finger joint is 'left_tip_joint'"):
        FingerLinkage(urdf, attrs.evolve(gripper, finger_joints=("left_tip_joint", "right_tip_joint")))
    with pytest.raises(InvalidArgument, match="names 1 pads"):
        FingerLinkage(urdf, attrs.evolve(gripper, pads=gripper.pads[:1]))
    circle = URDF.replace('<mimic joint="drive"/>', '<mimic joint="right_knuckle_joint"/>')
    with pytest.raises(InvalidArgument, match="circle"):
        FingerLinkage(read_urdf(circle), gripper)


def test_slides_are_what_they_were():
    hand = ParallelHand()
    urdf = read_urdf(six_joint_arm().urdf.replace("</robot>", hand.text("tool") + "</robot>"))
    linkage = FingerLinkage(urdf, hand.gripper())
    assert linkage.slides and linkage.stroke == pytest.approx(hand.stroke)
    assert linkage.positions(0.05) == pytest.approx([0.025, 0.025])


@pytest.mark.sim
@pytest.mark.parametrize("simulator", SIMULATORS)
def test_slides_that_go_the_other_way_or_mimic_by_minus_one_open_as_well(simulator):
    """Finger 1 opens with falling positions, finger 2 mirrors it."""
    urdf = ARM.replace("</robot>", ParallelHand().text("wrist_3_link") + "</robot>")
    names = ("hand_finger_joint1", "hand_finger_joint2")
    for name, axis, limits, mimic in (
        (names[0], "0 -1 0", 'lower="-0.04" upper="0"', ""),
        (names[1], "0 1 0", 'lower="0" upper="0.04"', f'<mimic joint="{names[0]}" multiplier="-1"/>'),
    ):
        pattern = rf'(<joint name="{name}".*?)<axis xyz="0 1 0"/><limit lower="0" upper="0.04"(.*?)</joint>'
        urdf, count = re.subn(
            pattern, rf'\1<axis xyz="{axis}"/><limit {limits}\2{mimic}</joint>', urdf, flags=re.DOTALL
        )
        assert count == 1
    robot = describe_urdf(urdf).robot
    assert robot.gripper.stroke == pytest.approx(0.08)
    for rule in RULES.values():
        rule(lambda: robot)
    trial = RobotTrial(robot, SIMULATORS[simulator])
    assert trial.grasp.step == "", trial.grasp.why
