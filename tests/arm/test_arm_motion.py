"""Motions: continuous along arcs, around obstacles, tilted no more than needed; and refused with the right reason
before anything moves."""

from __future__ import annotations

import itertools
import math
import time

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from memo_franka.description import panda

from memo_core.arm.cartesian_path import CartesianPath
from memo_core.arm.collision import RobotShape, obstacles_of
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.redundancy_resolution import Blocked, BranchSearch, tilt_choices
from memo_core.arm.rrt_connect import plan_free
from memo_core.errors import MotionError
from memo_core.scene.graph import Node
from memo_core.scene.pose import Pose, quaternion_from_axis_angle, quaternion_from_rotation
from memo_core.skills.contract import side_orientation, top_orientation, turn_orientation, turn_point
from tests.support.arms import FixedPerception, box, control_of, limits_used, six_joint_arm

KINEMATICS = Kinematics(panda())
SHAPE = RobotShape(panda(), KINEMATICS)
TOP = top_orientation.call(None, ())
FORWARD = side_orientation.call(None, ([1.0, 0.0, 0.0], "horizontal"))
LEVEL = side_orientation.call(None, ([1.0, 0.0, 0.0], "vertical"))


def arc(grip, pivot, axis, angle, hand, count=20):
    """Waypoints of a door's handle, the hand turning with it."""
    angles = [angle * i / count for i in range(1, count + 1)]
    return [
        (turn_point.call(None, (grip, pivot, axis, a)), turn_orientation.call(None, (hand, axis, a))) for a in angles
    ]


def distance_to(path, point) -> float:
    """m from a point to a polyline."""
    best = math.inf
    for a, b in itertools.pairwise(path):
        a, b = np.asarray(a), np.asarray(b)
        part = np.clip((point - a) @ (b - a) / max((b - a) @ (b - a), 1e-12), 0, 1)
        best = min(best, float(np.linalg.norm(point - a - part * (b - a))))
    return best


# -- arcs ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("side", [1, -1])
def test_a_door_is_followed_in_one_posture_from_approach_to_retreat(side):
    control, link, _ = control_of(panda())
    grip, pivot = [0.62, -0.17 * side, 0.30], [0.66, 0.17 * side, 0.30]
    path = arc(grip, pivot, [0.0, 0.0, 1.0], -1.5 * side, FORWARD)
    away = [(turn_point.call(None, ([0.52, -0.17 * side, 0.30], pivot, [0.0, 0.0, 1.0], -1.5 * side)), path[-1][1])]
    control.move_to([0.52, -0.17 * side, 0.30], FORWARD, [(grip, FORWARD), *path, *away], 0.7, 1.0)
    control.follow_path([(grip, FORWARD)], [*path, *away], 0.7, 0.5)
    start = len(link.sent)
    control.follow_path(path, away, 0.7, 0.5)
    followed = link.sent[start:]
    positions = [control._kinematics.pose(one).position for one in followed[::5]]
    line = [grip, *(p for p, _ in path)]
    assert max(distance_to(line, np.array(p)) for p in positions) < 0.004
    control.follow_path(away, None, 0.7, 0.5)
    used = limits_used(panda(), link.sent, link.control_period)
    assert max(used) <= 1.001, used


@settings(max_examples=10, deadline=None)
@given(
    x=st.floats(0.5, 0.75),
    z=st.floats(0.15, 0.6),
    side=st.sampled_from([1, -1]),
    radius=st.floats(0.25, 0.4),
    slack=st.sampled_from([0.0, 0.4, 0.7]),
)
def test_a_branch_is_continuous_and_on_its_path_wherever_the_door_is(x, z, side, radius, slack):
    grip, pivot = [x, -radius / 2 * side, z], [x + 0.03, radius / 2 * side, z]
    path = CartesianPath(
        [
            Pose(tuple(p), tuple(q))
            for p, q in [(grip, FORWARD), *arc(grip, pivot, [0.0, 0.0, 1.0], -1.4 * side, FORWARD)]
        ]
    )
    checker = SHAPE.checker(obstacles_of(FixedPerception().look()), 0.05)
    search = BranchSearch(KINEMATICS, path, checker, None, 0.0, "contact", KINEMATICS.home)
    found = search.prepare(tilt_choices(slack, None)[-1]) or search.best()
    if isinstance(found, Blocked):
        assert found.cause in ("unreachable", "joint-limit", "collision", "self-collision", "no-branch")
        return
    assert np.abs(np.diff(found.joints, axis=1)).max() < 0.26
    assert np.abs(found.tilt).max() <= slack + 1e-9
    rotation, position = path.at(found.s, found.tilt)
    turned, placed = KINEMATICS.forward(found.joints)
    assert np.abs(placed - position).max() < 1e-3 and np.abs(turned - rotation).max() < 3e-3
    assert all(KINEMATICS.within_limits(one) for one in found.joints.T)
    assert not any(checker.collides(one, "contact") for one in found.joints.T[::2])


@pytest.mark.parametrize("z", [0.2, 0.45])
def test_the_posture_is_chosen_for_what_follows(z):
    grip, pivot = [0.62, -0.17, z], [0.66, 0.17, z]
    path = arc(grip, pivot, [0.0, 0.0, 1.0], -1.5, FORWARD)
    control, _, _ = control_of(panda())
    control.move_to([0.52, -0.17, z], FORWARD, [(grip, FORWARD), *path], 0.3, 1.0)
    control.follow_path([(grip, FORWARD)], path, 0.3, 0.5)
    control.follow_path(path, None, 0.3, 0.5)
    unaware, link, _ = control_of(panda())
    unaware.move_to([0.52, -0.17, z], FORWARD, None, 0.3, 1.0)
    unaware.follow_path([(grip, FORWARD)], None, 0.3, 0.5)
    moved = len(link.sent)
    with pytest.raises(MotionError, match=r"% along the path.*from another arm posture it can.*then="):
        unaware.follow_path(path, None, 0.3, 0.5)
    assert len(link.sent) == moved


def test_a_level_bar_may_turn_between_the_fingers():
    """The hand need not turn as far as a drop-down door when that would push the arm into the table."""
    handle = Node("handle", "handle", Pose((0.61, 0.12, 0.456)), (0.018, 0.2, 0.018), "oven", "part")
    oven = box("oven", (0.84, 0.12, 0.335), (0.32, 0.34, 0.27))
    control, _, _ = control_of(panda(), handle, oven)
    grip, pivot = [0.61, 0.12, 0.456], [0.68, 0.12, 0.20]
    path = arc(grip, pivot, [0.0, 1.0, 0.0], -1.35, LEVEL)
    control.move_to([0.51, 0.12, 0.456], LEVEL, [(grip, LEVEL), *path], 0.7, 1.0)
    control.follow_path([(grip, LEVEL)], path, 0.7, 0.5)
    control.follow_path(path, None, 0.7, 0.5)
    distance, _ = control.tool_pose().distance(Pose(tuple(path[-1][0])))
    assert distance < 0.005
    for nodes, slack in (((oven,), 0.7), ((handle, oven), 0.0)):
        other, _, _ = control_of(panda(), *nodes)
        with pytest.raises(MotionError):
            other.move_to([0.51, 0.12, 0.456], LEVEL, [(grip, LEVEL), *path], slack, 1.0)


# -- tilt ------------------------------------------------------------------------------------------------------------


def test_the_hand_is_tilted_only_where_it_must_and_only_about_its_closing_axis():
    control, _, _ = control_of(panda())
    with pytest.raises(MotionError) as refused:
        control.move_to([0.5, 0.0, 0.30], FORWARD, None, 0.0, 1.0)
    assert refused.value.cause in ("unreachable", "joint-limit")
    assert "reachable with the hand turned by" in str(refused.value)
    control.move_to([0.5, 0.0, 0.30], FORWARD, None, 0.7, 1.0)
    wanted = Pose((0.5, 0.0, 0.30), tuple(FORWARD))
    distance, angle = control.tool_pose().distance(wanted)
    assert distance < 0.002 and 0.05 < angle <= 0.701
    assert np.allclose(control.tool_pose().rotation[:, 1], wanted.rotation[:, 1], atol=0.01)

    control.move_to([0.45, 0.1, 0.25], TOP, None, 0.7, 1.0)
    assert control.tool_pose().distance(Pose((0.45, 0.1, 0.25), tuple(TOP)))[1] < 0.01, "tilted without need"


# -- around things ---------------------------------------------------------------------------------------------------


def test_a_wall_is_gone_around():
    wall = box("wall", (0.5, 0.0, 0.2), (0.5, 0.06, 0.4))
    control, link, _ = control_of(panda(), wall)
    control.move_to([0.45, 0.3, 0.15], TOP, None, 0.0, 1.0)
    first = len(link.sent)
    control.move_to([0.45, -0.3, 0.15], TOP, None, 0.0, 1.0)
    assert control.tool_pose().distance(Pose((0.45, -0.3, 0.15), tuple(TOP)))[0] < 0.002
    checker = control._planner._checker(control._world(), link.joint_positions())
    assert not any(checker.collides(one, "free") for one in link.sent[first:])
    used = limits_used(panda(), link.sent[first:], link.control_period, start=link.sent[first - 1])
    assert max(used) <= 1.001, used


def test_the_same_motion_is_planned_again_the_same():
    wall = box("wall", (0.5, 0.0, 0.2), (0.5, 0.06, 0.4))
    records = []
    for _ in range(2):
        control, link, _ = control_of(panda(), wall)
        control.move_to([0.45, 0.3, 0.15], TOP, None, 0.0, 1.0)
        control.move_to([0.45, -0.3, 0.15], TOP, None, 0.0, 1.0)
        records.append(np.array(link.sent))
    assert np.array_equal(*records)


# -- refusals --------------------------------------------------------------------------------------------------------


def _refused(control, link, cause, *texts, act):
    before = len(link.sent)
    with pytest.raises(MotionError) as error:
        act(control)
    assert error.value.cause == cause, str(error.value)
    for text in texts:
        assert text in str(error.value)
    assert len(link.sent) == before, "it moved before it refused"
    assert "\n" not in str(error.value)


def test_a_busy_machine_does_not_change_what_is_planned():
    """Waiting, for other work or for anything, is no time spent on the search."""
    start, goal = KINEMATICS.home, KINEMATICS.home + np.array([1.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])

    def free(joints) -> bool:
        return not (abs(joints[0] - 0.6) < 0.1 and joints[1] > -1.1)

    def slowly(joints) -> bool:
        time.sleep(0.0005)
        return free(joints)

    at_once = plan_free(KINEMATICS, free, start, [goal])
    assert at_once is not None
    found = plan_free(KINEMATICS, slowly, start, [goal], seconds=0.2)
    assert found is not None and np.array_equal(found, at_once)


def test_refusals_name_the_cause_before_anything_moves():
    tower = box("tower", (0.5, 0.0, 0.3), (0.3, 0.3, 0.6))
    cases = [
        ("workspace", ("1.58 m", "workspace"), lambda c: c.move_to([1.5, 0.45, 0.1], TOP, None, 0.7, 1.0)),
        ("workspace", ("10.0 cm below the table",), lambda c: c.move_to([0.4, -0.45, -0.1], TOP, None, 0.7, 1.0)),
        ("unreachable", ("out of the arm's reach",), lambda c: c.move_to([0.85, 0.0, 0.75], TOP, None, 0.0, 1.0)),
        ("collision", ("tower",), lambda c: c.move_to([0.5, 0.0, 0.4], TOP, None, 0.0, 1.0)),
        (
            "collision",
            ("tower", "% along the path that is to follow"),
            lambda c: c.move_to([0.3, 0.4, 0.3], TOP, [([0.5, 0.0, 0.3], TOP)], 0.0, 1.0),
        ),
    ]
    for cause, texts, act in cases:
        control, link, _ = control_of(panda(), tower, start=None)
        link.restore(link.checkpoint())
        _refused(control, link, cause, *texts, act=act)


def test_a_path_that_no_single_posture_follows_says_where_it_ends():
    control, link, _ = control_of(panda())
    control.move_to([0.45, 0.0, 0.4], TOP, None, 0.0, 1.0)
    turns = [
        (
            [0.45, 0.0, 0.4],
            list(
                quaternion_from_rotation(
                    Pose(orientation=tuple(TOP)).rotation
                    @ Pose(orientation=quaternion_from_axis_angle((0, 0, 1), a)).rotation
                )
            ),
        )
        for a in np.linspace(0.3, 7.0, 30)
    ]
    before = len(link.sent)
    with pytest.raises(MotionError) as error:
        control.follow_path(turns, None, 0.0, 0.5)
    assert error.value.cause in ("no-branch", "self-collision", "joint-limit")
    assert "% along the path" in str(error.value)
    assert len(link.sent) == before


def test_not_arriving_says_by_how_much():
    control, link, _ = control_of(panda())
    link.blocked = link.joint_positions() + np.array([0.1, 1, 1, 1, 1, 1, 1])
    with pytest.raises(MotionError) as error:
        control.move_to([0.3, 0.3, 0.4], TOP, None, 0.0, 1.0)
    assert error.value.cause == "not-arrived"
    assert error.value.position_error_m is not None and error.value.position_error_m > 0.1
    assert "cm" in str(error.value)
    link.blocked = None
    control.go_home()
    assert np.abs(link.joint_positions() - np.array(panda().home)).max() < 1e-6


# -- another arm -----------------------------------------------------------------------------------------------------


def test_a_six_joint_arm_works_through_the_same_code():
    description = six_joint_arm()
    crate = box("crate", (0.45, -0.3, 0.1), (0.2, 0.2, 0.2))
    control, link, _ = control_of(description, crate)
    here = control.tool_pose()
    x, y, z = here.position
    control.follow_path([([x, y + 0.1, z], None), ([x, y + 0.1, z - 0.1], None)], None, 0.0, 0.5)
    assert control.tool_pose().distance(Pose((x, y + 0.1, z - 0.1), here.orientation))[0] < 0.002
    control.move_to([x, y - 0.05, z], list(here.orientation), [([x - 0.05, y - 0.05, z], None)], 0.0, 1.0)
    control.go_home()
    used = limits_used(description, link.sent, link.control_period)
    assert max(used) <= 1.001, used
    with pytest.raises(MotionError) as error:
        control.move_to([0.45, -0.3, 0.1], list(here.orientation), None, 0.0, 1.0)
    assert error.value.cause in ("collision", "unreachable", "joint-limit")


@pytest.mark.parametrize("y", [0.14, 0.17, 0.20])
def test_a_free_motion_keeps_clear_of_a_door_that_stands_open(y):
    """Its fingers may come as near as perception errs only where there is no other way: a graze drags a door along."""
    door = box("door", (0.50, y, 0.17), (0.36, 0.016, 0.34))
    control, link, _ = control_of(panda(), door)
    begun = len(link.sent)
    control.move_to([0.33, y + 0.16, 0.20], FORWARD, None, 0.7, 1.0)
    control.move_to([0.45, -0.32, 0.15], TOP, None, 0.7, 1.0)
    checker = SHAPE.checker(obstacles_of(control.scene()), control.gripper_width())
    assert not any(checker.collides(np.asarray(row), "clear") for row in link.sent[begun:])
