"""Goals that a policy sends: the arm keeps its limits whatever they are, and rests after a stop or a refusal."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from memo_franka.description import fr3, panda

from memo_core.arm.guarded_link import GuardedLink
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.joint_stream import JointStream
from memo_core.errors import InvalidArgument, MotionError, Stopped
from memo_core.robot.safety import SafetyLimits
from memo_core.scene.graph import Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.testing.ideal_link import IdealLink
from tests.support.arms import limits_used

EMPTY = SceneGraph((), (), Observation(Pose(), 0.08, False), -0.3)


def stream_of(robot):
    link = IdealLink(robot)
    return JointStream(robot, link, EMPTY), link


goals = st.lists(
    st.tuples(st.lists(st.floats(-0.5, 0.5), min_size=7, max_size=7), st.integers(1, 12)), min_size=1, max_size=6
)


@settings(max_examples=25)
@given(goals)
def test_no_sequence_of_goals_exceeds_a_joints_limits(sequence):
    robot = panda()
    stream, link = stream_of(robot)
    try:
        for change, ticks in sequence:
            stream.follow(np.array(robot.home) + change, ticks)
    except MotionError:
        pass
    stream.rest()
    if link.sent:
        assert max(limits_used(robot, link.sent, link.control_period)) <= 1.001


@settings(max_examples=25)
@given(goals)
def test_the_tool_never_moves_faster_than_the_robot_allows(sequence):
    robot = attrs.evolve(panda(), tool_speed=0.2)
    stream, link = stream_of(robot)
    try:
        for change, ticks in sequence:
            stream.follow(np.array(robot.home) + change, ticks)
    except MotionError:
        pass
    _, places = Kinematics(robot).forward(np.array([robot.home, *link.sent]).T)
    speeds = np.linalg.norm(np.diff(places, axis=1), axis=0) / link.control_period
    assert speeds.max(initial=0.0) <= 0.2 * 1.02


def test_the_guard_of_a_real_robot_has_nothing_to_refuse():
    robot, limits = fr3(), SafetyLimits()
    inner = IdealLink(robot)
    link = GuardedLink(inner, robot, limits)
    link.open()
    stream = JointStream(link.description, link, EMPTY)
    for change in (0.3, -0.3, 0.2):
        stream.follow(np.array(robot.home) + change, 40)
    assert len(inner.sent) == 120


def test_a_goal_is_reached_and_held():
    stream, link = stream_of(panda())
    goal = np.array(panda().home) + 0.2
    stream.follow(goal, 150)
    assert np.allclose(link.joint_targets(), goal, atol=1e-6)
    stream.hold(5)
    assert np.allclose(np.diff(link.sent[-5:], axis=0), 0.0)


def test_after_a_stop_no_command_follows_but_the_braking():
    robot = panda()
    stream, link = stream_of(robot)
    link.stop_at = 20
    with pytest.raises(Stopped):
        stream.follow(np.array(robot.home) + 0.6, 200)
    braking = len(link.sent) - 20
    assert 0 < braking < 60  # it ends, within the limits, and nothing else was sent
    assert max(limits_used(robot, link.sent, link.control_period)) <= 1.001
    with pytest.raises(Stopped):
        stream.hold(1)
    assert len(link.sent) == 20 + braking


def test_a_way_through_the_arm_itself_is_refused_and_the_arm_rests():
    robot = panda()
    stream, link = stream_of(robot)
    stream.follow(np.array(robot.home) + [0, 0.4, 0, -0.3, 0, 0, 0], 20)
    with pytest.raises(MotionError) as refused:
        stream.follow(np.array(robot.home) + [0, 1.6, 0, -0.3, 0, 0, 0], 5)
    assert refused.value.cause in ("self-collision", "collision")
    assert max(limits_used(robot, link.sent, link.control_period)) <= 1.001
    stream.follow(np.array(robot.home), 200)  # and it can go on from where it rests
    assert np.allclose(link.joint_targets(), robot.home, atol=1e-6)


def test_goals_beyond_the_joints_end_at_the_joints():
    robot = panda()
    stream, link = stream_of(robot)
    far = np.array(robot.home)
    far[0] = 9.0
    stream.follow(far, 300)
    assert link.joint_targets()[0] == pytest.approx(robot.joints[0].upper)


@pytest.mark.parametrize("goal", [[np.nan] * 7, [0.0] * 6])
def test_what_is_no_goal_moves_nothing(goal):
    stream, link = stream_of(panda())
    with pytest.raises(InvalidArgument):
        stream.follow(np.array(goal), 5)
    assert not link.sent


def test_what_rounding_leaves_of_a_motion_does_not_matter():
    """A joint that has arrived but for rounding once left Ruckig no way to let all joints arrive together."""
    stream, link = stream_of(panda())
    rng = np.random.default_rng(3)
    for _ in range(200):
        goal = stream.goal + rng.choice([0.0, 1e-15, 1e-12, 1e-9, 1e-3], 7) * rng.choice([-1.0, 1.0], 7)
        stream.follow(goal, int(rng.integers(1, 4)))
    assert max(limits_used(panda(), link.sent, link.control_period)) <= 1.001
