"""A hand leads out of the arm whatever axis its flange does it with; one that is mounted sideways is told."""

from __future__ import annotations

import math
import re

import attrs
import numpy as np
import pytest

from memo_core.arm.description_from_urdf import describe_urdf
from memo_core.errors import InvalidArgument
from memo_core.robot.hand_mount import mount_rpy, sideways
from memo_core.robot.parallel_hand import ParallelHand, with_parallel_hand
from memo_core.robot.urdf.reading import link_poses, read_urdf
from memo_core.scene.pose import Pose
from tests.support.arms import six_joint_arm

BARE = six_joint_arm().urdf  # its flange's z leads along joint 6, which is link6's y
JOINTS = tuple(f"joint{n}" for n in range(1, 7))
# The rpy of the flange in link6 -> the axis of the flange that leads out of the arm.
FLANGES = {
    "+z": (-math.pi / 2, 0.0, 0.0),
    "-z": (math.pi / 2, 0.0, 0.0),
    "+x": (0.0, 0.0, math.pi / 2),
    "-x": (0.0, 0.0, -math.pi / 2),
    "+y": (0.0, 0.0, 0.0),
    "-y": (math.pi, 0.0, 0.0),
}


def _flange(axis: str, far: float = 0.08) -> str:
    """The bare arm with its flange turned; 0 m ``far``, where joint 6 itself lies further out along its axis."""
    rpy = " ".join(f"{value:.7f}" for value in FLANGES[axis])
    arm = BARE if far else BARE.replace('xyz="0.0 0.0 0.09"', 'xyz="0 0.09 0"')
    return arm.replace('xyz="0 0.08 0" rpy="-1.5707963 0 0"', f'xyz="0 {far} 0" rpy="{rpy}"')


@pytest.mark.parametrize("far", [0.08, 0.0], ids=["flange apart", "flange at the last joint"])
@pytest.mark.parametrize("axis", FLANGES)
def test_a_described_hand_leads_along_the_last_joint(axis, far):
    described = describe_urdf(_flange(axis, far), "mine")
    robot = described.robot
    poses = link_poses(read_urdf(robot.urdf), {})
    z = (poses[robot.tool_link] * robot.tool_offset).rotation[:, 2]
    assert z @ poses["link6"].rotation[:, 1] == pytest.approx(1.0, abs=1e-6)
    assert sideways(read_urdf(robot.urdf), JOINTS, robot.tool_link, robot.tool_offset) is None
    told = [guess for guess in described.guessed if guess.what == "hand_mount"]
    assert [axis in guess.why for guess in told] == ([] if axis == "+z" else [True])


@pytest.mark.parametrize("axis", ["+x", "-x", "+y", "-y"])
def test_a_sideways_hand_is_told_with_the_rpy_that_mends_it(axis):
    text = with_parallel_hand(_flange(axis), "tool", ParallelHand())
    found = sideways(read_urdf(text), JOINTS, "hand_tool", Pose())
    assert found is not None and found.mount == "hand_mount" and found.flange == "tool"
    assert found.joint == "joint6" and found.degrees == pytest.approx(90)
    mended = with_parallel_hand(_flange(axis), "tool", ParallelHand(), mount=found.rpy)
    poses = link_poses(read_urdf(mended), {})
    assert poses["hand_tool"].rotation[:, 2] @ poses["link6"].rotation[:, 1] == pytest.approx(1.0, abs=1e-6)


def test_a_last_joint_that_bends_the_hand_is_no_fault():
    # Joint 4 turns about y, and everything behind it leads along z.
    text = BARE.replace('xyz="0.0 0.09 0.0"', 'xyz="0 0 0.05"').replace('"0 0.08 0" rpy="-1.5707963 0 0"', '"0 0 0.08"')
    for name in ("joint5", "joint6"):
        text = text.replace(f'<joint name="{name}" type="revolute">', f'<joint name="{name}" type="fixed">')
    urdf = read_urdf(with_parallel_hand(text, "tool", ParallelHand()))
    assert sideways(urdf, JOINTS[:4], "hand_tool", Pose()) is None
    assert mount_rpy(urdf, JOINTS[:4], "tool") == ((0.0, 0.0, 0.0), "+z")


def test_the_axis_of_a_flange_is_named():
    assert {axis: mount_rpy(read_urdf(_flange(axis)), JOINTS, "tool")[1] for axis in FLANGES} == {
        axis: axis for axis in FLANGES
    }


def test_the_check_says_so_first_and_what_to_write():
    from memo_core.plugins.registry import Registry
    from memo_core.testing.plugins import check_robot

    right = describe_urdf(_flange("+x"), "mine").robot
    wrong = attrs.evolve(right, urdf=with_parallel_hand(_flange("+x"), "tool", ParallelHand()))
    said = []
    for result in check_robot(Registry(), "robot/mine", lambda: wrong):
        if result.outcome in ("broken", "limited"):
            said.append(result)
            break
    assert said[0].rule == "the_hand_leads_out_of_the_arm" and said[0].outcome == "limited"
    assert re.match(r"the hand points sideways: .* 90 degrees .* joint6", said[0].why), said[0].why
    assert 'rpy="0 1.5708 0"' in said[0].why and "'hand_mount'" in said[0].why
    assert np.allclose(right.tool_offset.matrix, wrong.tool_offset.matrix)


def test_a_hand_is_not_added_to_text_that_is_no_xml():
    with pytest.raises(InvalidArgument, match="urdf: is not XML"):
        with_parallel_hand("<robot", "flange")
