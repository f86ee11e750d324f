"""Inverse kinematics inverts forward kinematics, for any serial arm, inside its limits."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from memo_franka.description import panda

from memo_core.arm.collision import Obstacle, RobotShape
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.wrench import ToolDynamics
from memo_core.errors import InvalidArgument
from memo_core.scene.pose import Pose
from tests.support.arms import six_joint_arm

ARMS = {"panda": Kinematics(panda()), "six": Kinematics(six_joint_arm())}


def _joints(kinematics: Kinematics, shares: list[float]) -> np.ndarray:
    share = np.array(shares[: kinematics.count])
    return kinematics.lower + (0.05 + 0.9 * share) * (kinematics.upper - kinematics.lower)


@pytest.mark.parametrize("name", ARMS)
@settings(max_examples=25, deadline=None)
@given(shares=st.lists(st.floats(0, 1), min_size=7, max_size=7))
def test_every_reachable_pose_is_reached(name, shares):
    kinematics = ARMS[name]
    pose = kinematics.pose(_joints(kinematics, shares))
    found = kinematics.inverse(pose, samples=800)
    assert found.shape[1] > 0
    for joints in found.T:
        distance, angle = kinematics.pose(joints).distance(pose)
        assert distance < 5e-4 and angle < 2e-3
        assert kinematics.within_limits(joints)


@pytest.mark.parametrize("name", ARMS)
@settings(max_examples=25, deadline=None)
@given(shares=st.lists(st.floats(0, 1), min_size=7, max_size=7))
def test_batches_agree_with_pinocchio(name, shares):
    import pinocchio as pin

    kinematics = ARMS[name]
    joints = _joints(kinematics, shares)
    model = kinematics.model
    data = model.createData()
    q = pin.neutral(model)
    for number, value in zip(kinematics.joint_ids, joints, strict=True):
        q[model.joints[number].idx_q] = value
    frame = model.getFrameId(kinematics.description.tool_link)
    pin.framesForwardKinematics(model, data, q)
    truth = data.oMf[frame]
    pose = kinematics.pose(joints)
    assert np.allclose(pose.position, truth.translation) and np.allclose(pose.rotation, truth.rotation)
    columns = [model.joints[number].idx_v for number in kinematics.joint_ids]
    jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)[:, columns]
    assert np.allclose(kinematics.jacobian(joints), jacobian)


def test_a_redundant_arm_has_many_postures_for_one_pose():
    kinematics = ARMS["panda"]
    found = kinematics.inverse(Pose((0.5, 0.1, 0.4), (0.0, 1.0, 0.0, 0.0)))
    assert found.shape[1] > 10
    assert np.ptp(found[0]) > 1.0, "the elbow should swing"


def test_what_is_out_of_reach_has_no_solution():
    for kinematics in ARMS.values():
        assert kinematics.inverse(Pose((1.5, 0.0, 0.5), (0.0, 1.0, 0.0, 0.0))).shape[1] == 0


@settings(max_examples=25, deadline=None)
@given(shares=st.lists(st.floats(0, 1), min_size=6, max_size=6))
def test_continuous_joints_give_the_same_results_as_joints_with_limits(shares):
    limited = ARMS["six"]
    joints = _joints(limited, shares)
    box = Obstacle("box", "box", Pose((0.35, 0.1, 0.45)), (0.3, 0.3, 0.3))
    for spinning in ((1, 6), (2, 3)):
        free = Kinematics(six_joint_arm(spinning))
        assert np.allclose(free.pose(joints).matrix, limited.pose(joints).matrix)
        assert np.allclose(free.jacobian(joints), limited.jacobian(joints))
        one, other = (ToolDynamics(each) for each in (free, limited))
        assert np.allclose(one.jacobian(joints), other.jacobian(joints))
        assert np.allclose(one.torques(joints, joints, joints), other.torques(joints, joints, joints))
        hits = [RobotShape(each.description, each).checker([box], 0.0).hit(joints, "free") for each in (free, limited)]
        assert hits[0] == hits[1]


def test_the_same_question_has_the_same_answer():
    kinematics = ARMS["panda"]
    pose = Pose((0.45, -0.2, 0.3), (0.0, 1.0, 0.0, 0.0))
    assert np.array_equal(kinematics.inverse(pose), kinematics.inverse(pose))


def test_a_description_that_does_not_fit_its_urdf_is_refused():
    description = panda()
    renamed = attrs.evolve(description.joints[2], name="panda_joint_three")
    joints = (*description.joints[:2], renamed, *description.joints[3:])
    with pytest.raises(InvalidArgument, match="panda_joint_three"):
        Kinematics(attrs.evolve(description, joints=joints))
    with pytest.raises(InvalidArgument, match="follow"):
        Kinematics(attrs.evolve(description, joints=description.joints[::-1]))
    with pytest.raises(InvalidArgument, match="no link 'tcp'"):
        Kinematics(attrs.evolve(description, tool_link="tcp"))
    with pytest.raises(InvalidArgument, match="home"):
        Kinematics(attrs.evolve(description, home=(0.0, 0.0)))
