"""URDFs of the shapes that makers write: the arm's joints, the driven finger and bystanders are told apart."""

from __future__ import annotations

import re

import attrs
import numpy as np
import pytest

from memo_core.arm.collision import RobotShape
from memo_core.arm.description_from_urdf import describe_urdf
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.wrench import ToolDynamics
from memo_core.errors import InvalidArgument
from memo_core.robot.arm_and_fingers import arm_and_fingers
from memo_core.robot.finger_linkage import FingerLinkage
from memo_core.robot.parallel_hand import ParallelHand
from memo_core.robot.urdf.reading import read_urdf
from memo_core.robot.urdf.text import Solid, box_inertia, joint_text, link_text
from memo_core.testing.robot import RULES
from tests.support.arms import six_joint_arm

BARE = six_joint_arm().urdf
HAND = ParallelHand().text("tool")
GRIPPER = BARE.replace("</robot>", HAND + "</robot>")
LIMIT = '<limit lower="{}" upper="{}" velocity="2" effort="10"/>'


def with_parts(urdf: str, *parts: str, first: bool = False) -> str:
    """The URDF text with links and joints before or after its own."""
    added = "".join(parts)
    return re.sub(r"(<robot[^>]*>)", rf"\1{added}", urdf) if first else urdf.replace("</robot>", added + "</robot>")


def turning(name: str, parent: str, child: str, kind: str = "revolute", inside: str = LIMIT.format(0, 2)) -> str:
    """A link that turns on another."""
    shape = Solid("box", (0.02, 0.02, 0.02), (0.0, 0.0, 0.0))
    link = link_text(child, box_inertia(0.05, (0.02, 0.02, 0.02), (0.0, 0.0, 0.0)), (shape,), (shape,))
    return link + joint_text(name, kind, parent, child, (0.0, 0.0, 0.02), axis="0 0 1", limit=inside)


def following() -> str:
    """``GRIPPER`` whose second finger mimics the first."""
    head, name, tail = GRIPPER.partition('<joint name="hand_finger_joint2"')
    return head + name + tail.replace("</joint>", '<mimic joint="hand_finger_joint1"/></joint>', 1)


def test_a_joint_may_bear_the_name_of_a_link():
    urdf = GRIPPER.replace('name="hand_mount"', 'name="hand_palm"').replace('name="joint6"', 'name="link6"')
    urdf = urdf.replace('name="hand_finger_joint1"', 'name="hand_finger1"')
    robot = describe_urdf(urdf).robot
    assert robot.tool_link == "hand_palm"
    kinematics, usual = Kinematics(robot), Kinematics(describe_urdf(GRIPPER).robot)
    home = np.array(robot.home)
    assert kinematics.pose(home).distance(usual.pose(home)) == pytest.approx((0, 0), abs=1e-9)
    assert RobotShape(robot, kinematics).roles == RobotShape(usual.description, usual).roles
    rotation, position = ToolDynamics(kinematics).placement(home)
    assert np.allclose(rotation, usual.pose(home).rotation) and np.allclose(position, usual.pose(home).position)


def test_a_joints_name_is_no_tool_link():
    robot = describe_urdf(GRIPPER).robot
    with pytest.raises(InvalidArgument, match="the URDF has no link 'hand_mount'"):
        Kinematics(attrs.evolve(robot, tool_link="hand_mount"))


MOTORS = {
    "a motor's hinge before the fingers": (following(), turning("gripper_revolute_joint", "hand_palm", "aux"), True),
    "a propeller that turns without end": (
        following(),
        turning("gripper", "hand_palm", "prop", "continuous", ""),
        True,
    ),
    "a hinge beside slides that mimic nothing": (GRIPPER, turning("gripper_motor", "hand_palm", "motor"), True),
    "a camera that tilts": (following(), turning("camera_tilt", "hand_palm", "camera"), False),
}


@pytest.mark.parametrize("case", MOTORS)
def test_what_no_finger_follows_is_held_still(case):
    urdf, motor, first = MOTORS[case]
    described = describe_urdf(with_parts(urdf, motor, first=first))
    robot, usual = described.robot, describe_urdf(urdf).robot
    assert robot.gripper.finger_joints == ("hand_finger_joint1", "hand_finger_joint2")
    assert robot.gripper.stroke == pytest.approx(usual.gripper.stroke)
    [name] = re.findall(r'<joint name="(\w+)"', motor)
    assert any(guess.what == "joints held still" and name in guess.value for guess in described.guessed)
    assert read_urdf(robot.urdf).joint(name).kind == "fixed"
    for rule in RULES.values():
        rule(lambda: robot)


def test_the_driven_finger_is_the_one_that_the_other_mimics_whichever_comes_first():
    head, joint, tail = GRIPPER.partition('<joint name="hand_finger_joint1"')
    follows = head + joint + tail.replace("</joint>", '<mimic joint="hand_finger_joint2"/></joint>', 1)
    assert [one.name for one in arm_and_fingers(read_urdf(follows)).fingers] == [
        "hand_finger_joint2",
        "hand_finger_joint1",
    ]
    assert describe_urdf(follows).robot.gripper.stroke == pytest.approx(0.08)


def test_fingers_with_a_motor_each_may_have_followers_of_their_own():
    parts = []
    for side, sign in (("left", 1), ("right", -1)):
        parts.append(turning(f"{side}_finger", "tool", f"{side}_knuckle", inside=LIMIT.format(0, 0.7)))
        tip = LIMIT.format(-0.7, 0) + f'<mimic joint="{side}_finger" multiplier="-1"/>'
        parts.append(turning(f"{side}_tip_joint", f"{side}_knuckle", f"{side}_tip", inside=tip))
        parts[-2] = parts[-2].replace('xyz="0.0 0.0 0.02"', f'xyz="0.0 {0.02 * sign} 0.02"')
        parts[-2] = parts[-2].replace('axis xyz="0 0 1"', f'axis xyz="{-sign} 0 0"')
        parts[-1] = parts[-1].replace('xyz="0.0 0.0 0.02"', 'xyz="0.0 0.0 0.05"')
        parts[-1] = parts[-1].replace('axis xyz="0 0 1"', f'axis xyz="{-sign} 0 0"')
    urdf = read_urdf(with_parts(BARE, *parts))
    fingers = arm_and_fingers(urdf).fingers
    assert [one.name for one in fingers[:2]] == ["left_finger", "right_finger"] and len(fingers) == 4
    gripper = describe_urdf(with_parts(BARE, *parts)).robot.gripper
    positions = FingerLinkage(urdf, gripper).positions_at(0.3)
    assert positions == pytest.approx(
        {"left_finger": 0.3, "right_finger": 0.3, "left_tip_joint": -0.3, "right_tip_joint": -0.3}
    )


@pytest.mark.parametrize("link", ["gripper_link", "gripper_base", "arm/gripper_link", "gripper"])
def test_a_last_link_that_is_called_after_the_gripper_is_the_arms(link):
    urdf = BARE.replace('"link6"', f'"{link}"')
    assert [joint.name for joint in arm_and_fingers(read_urdf(urdf)).arm][-1] == "joint6"
    assert len(describe_urdf(urdf).robot.joints) == 6


def test_a_wrist_that_is_called_after_the_gripper_it_turns_is_the_arms():
    found = arm_and_fingers(read_urdf(GRIPPER.replace('"joint6"', '"gripper_roll"')))
    assert found.arm[-1].name == "gripper_roll" and len(found.fingers) == 2


def test_an_arm_may_end_in_a_slide():
    urdf = BARE.replace('name="joint6" type="revolute"', 'name="joint6" type="prismatic"')
    assert len(arm_and_fingers(read_urdf(urdf)).arm) == 6


JAW = with_parts(BARE, turning("gripper", "gripper_body", "moving_jaw"), link_text("gripper_body"))
JAW = with_parts(JAW, joint_text("gripper_mount", "fixed", "tool", "gripper_body"))


def test_a_gripper_of_one_jaw_is_refused_by_what_is_missing_and_a_plain_hand_takes_its_place():
    with pytest.raises(InvalidArgument, match=r"one jaw \(gripper\).*second one.*is missing.*--plain-hand") as raised:
        describe_urdf(JAW)
    assert "\n" not in str(raised.value)
    described = describe_urdf(JAW, plain_hand=True)
    assert "moving_jaw" not in described.robot.urdf
    assert any("in the place of the URDF's gripper" in guess.why for guess in described.guessed)
    for rule in RULES.values():
        rule(lambda: described.robot)


def test_a_plain_hand_leaves_out_the_body_of_the_gripper_and_finds_names_that_are_free():
    robot = describe_urdf(GRIPPER, plain_hand=True).robot
    urdf = read_urdf(robot.urdf)
    assert "hand_finger1" not in urdf.links and not urdf.links["hand_palm"].collisions
    assert urdf.links["link6"].collisions == read_urdf(BARE).links["link6"].collisions
    assert robot.gripper.finger_joints == ("plain_hand_finger_joint1", "plain_hand_finger_joint2")


def test_fingers_that_grip_nothing_are_refused_and_a_plain_hand_takes_their_place():
    head, joint, tail = following().partition('name="hand_finger_joint2"')
    urdf = head + joint + tail.replace('<axis xyz="0 1 0"/>', '<axis xyz="0 -1 0"/>', 1)
    with pytest.raises(InvalidArgument, match=r"grip nothing.*--plain-hand"):
        describe_urdf(urdf)
    assert describe_urdf(urdf, plain_hand=True).robot.gripper.stroke == pytest.approx(0.08)


def test_wheels_and_a_head_beside_the_arm_are_held_still():
    parts = [turning(f"wheel{i}", "base", f"wheel{i}_link", "continuous", "") for i in (1, 2)]
    parts += [turning("head_pan", "base", "neck"), turning("head_tilt", "neck", "head")]
    described = describe_urdf(with_parts(BARE, *parts, first=True))
    assert len(described.robot.joints) == 6
    [held] = [guess.value for guess in described.guessed if guess.what == "joints held still"]
    assert held == "wheel1, wheel2, head_pan, head_tilt"


def test_long_fingers_are_a_hand_and_a_second_arm_is_not():
    parts = []
    for finger in "abc":
        before = "tool"
        for number in (1, 2, 3):
            parts.append(turning(f"{finger}{number}", before, f"{finger}{number}_link"))
            before = f"{finger}{number}_link"
    found = arm_and_fingers(read_urdf(with_parts(BARE, *parts)))
    assert len(found.arm) == 6 and len(found.fingers) == 9
    shoulder = with_parts(BARE, *parts).replace('parent link="tool"', 'parent link="link1"')
    with pytest.raises(InvalidArgument, match=r'more than one arm.*type="fixed"'):
        arm_and_fingers(read_urdf(shoulder))
    others_fixed = re.sub(r'name="([abc]\d)" type="revolute"', r'name="\1" type="fixed"', shoulder)
    assert len(describe_urdf(others_fixed).robot.joints) == 6


CLUMSY = {
    "two joints of one name": (BARE.replace('"joint3"', '"joint2"'), "joint 'joint2': is there twice"),
    "two links of one name": (BARE.replace('<link name="link3"', '<link name="link2"'), "link 'link2': is there twice"),
    "a joint without a name": (BARE.replace('name="joint3" ', ""), "<joint>: has no name"),
    "a colour of three numbers": (
        with_parts(BARE, '<material name="red"><color rgba="1 0 0"/></material>'),
        "material 'red': <color rgba='1 0 0'>; expected four numbers",
    ),
    "no links": ("<robot name='r'/>", "has no links"),
    "limits without an end": (BARE.replace('lower="-3"', 'lower="-inf"', 1), "Pinocchio cannot read it"),
}


@pytest.mark.parametrize("case", CLUMSY)
def test_what_is_no_urdf_is_refused_by_what_is_wrong(case):
    urdf, said = CLUMSY[case]
    with pytest.raises(InvalidArgument) as raised:
        describe_urdf(urdf)
    assert said in str(raised.value) and "\n" not in str(raised.value)


def test_materials_that_are_defined_twice_and_a_robot_without_a_name_are_read():
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    assert len(describe_urdf(with_parts(BARE, red, red).replace(' name="six"', "")).robot.joints) == 6
