"""What counts as solid: boxes, hollow boxes, the table, what is held; and the arm itself."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from memo_franka.description import panda

from memo_core.arm.collision import Held, RobotShape, obstacles_of
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.skills.contract import side_orientation
from tests.support.arms import box

PANDA = panda()
KINEMATICS = Kinematics(PANDA)
SHAPE = RobotShape(PANDA, KINEMATICS)
HOME = KINEMATICS.home
DOWN = (0.0, 1.0, 0.0, 0.0)


def graph(*nodes: Node) -> SceneGraph:
    return SceneGraph(nodes, (), Observation(Pose(), 0.08, False))


def inside_of(obstacles, point) -> bool:
    return any(np.all(np.abs(one.pose.inverse().apply(point)) <= np.asarray(one.size) / 2 + 1e-9) for one in obstacles)


def at(position, orientation=DOWN) -> np.ndarray:
    found = KINEMATICS.inverse(Pose(tuple(position), orientation), HOME[:, None])
    return found[:, int(np.argmin(np.abs(found - HOME[:, None]).max(axis=0)))]


@settings(max_examples=60, deadline=None)
@given(
    yaw=st.floats(-3, 3),
    share=st.tuples(*[st.floats(-0.98, 0.98)] * 3),
    side=st.sampled_from([(-1, 0, 0), (1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1)]),
)
def test_an_open_fixture_is_its_walls(yaw, share, side):
    whole = Node("cupboard", "cupboard", Pose.from_yaw((0.6, 0.1, 0.3), yaw), (0.3, 0.4, 0.5), kind="fixture")
    opening = tuple(whole.pose.rotation @ np.array(side, dtype=float))
    space = Node("in", "in", whole.pose, (0.26, 0.36, 0.46), "cupboard", "space", opening)
    walls = [one for one in obstacles_of(graph(whole, space)) if one.node == "cupboard"]
    assert len(walls) == 5
    local = np.array(share) * np.array(whole.size) / 2
    hollow = bool(np.all(np.abs(local) < np.array(space.size) / 2))
    axis = int(np.argmax(np.abs(side)))
    through = local.copy()
    through[axis] = 0.0
    if local[axis] * side[axis] > 0 and np.all(np.abs(through) < np.array(space.size) / 2):
        hollow = True
    near = np.abs(np.abs(local) - np.array(space.size) / 2).min() < 1e-6
    assert near or inside_of(walls, whole.pose.apply(local)) is not hollow


def test_a_closed_fixture_is_solid_and_a_moved_one_is_where_it_was_moved():
    node = box("crate", (0.5, 0.0, 0.1), (0.2, 0.2, 0.2))
    assert inside_of([o for o in obstacles_of(graph(node)) if o.node == "crate"], (0.5, 0.0, 0.1))
    moved = obstacles_of(graph(node), {"crate": Pose((0.5, 0.5, 0.1))})
    assert not inside_of(moved, (0.5, 0.0, 0.1)) and inside_of(moved, (0.5, 0.5, 0.1))
    assert not inside_of(obstacles_of(graph(node), absent=["crate"]), (0.5, 0.0, 0.1))


def test_what_is_moved_takes_its_inside_along():
    tray = Node("tray", "tray", Pose.from_yaw((0.5, 0.0, 0.1), 0.4), (0.3, 0.3, 0.2), kind="part")
    space = Node("in", "in", tray.pose, (0.26, 0.26, 0.16), "tray", "space", (0.0, 0.0, 1.0))
    moved = Pose.from_yaw((0.2, 0.1, 0.1), -0.3)
    walls = [one for one in obstacles_of(graph(tray, space), {"tray": moved}) if one.node == "tray"]
    assert not inside_of(walls, moved.position), "it can still be reached into"
    assert inside_of(walls, moved.apply((0.0, 0.0, -0.09))) and inside_of(walls, moved.apply((0.145, 0.0, 0.0)))


def test_the_home_posture_touches_nothing():
    checker = SHAPE.checker(obstacles_of(graph()), 0.08)
    assert checker.hit(HOME, "free") is None and checker.hit(HOME, "contact") is None


def test_a_hit_is_named():
    checker = SHAPE.checker(obstacles_of(graph(box("oven", (0.3, 0.0, 0.4), (0.1, 0.3, 0.3)))), 0.08)
    hit = checker.hit(HOME, "free")
    assert hit is not None and hit.other == "oven" and hit.node == "oven" and not hit.own
    folded = HOME.copy()
    folded[1], folded[3], folded[5] = -1.7, -3.05, 0.0
    own = SHAPE.checker([], 0.08).hit(folded, "free")
    assert own is not None and own.own and "panda_link" in str(own)


def test_fingers_may_touch_when_contact_is_meant_and_the_hand_may_not():
    low = at((0.5, 0.0, 0.03))
    cube = box("cube", (0.5, 0.0, 0.02), (0.04, 0.06, 0.04), "object")
    checker = SHAPE.checker(obstacles_of(graph(cube)), 0.0)
    assert checker.collides(low, "free") and not checker.collides(low, "contact")
    tall = box("tower", (0.5, 0.0, 0.1), (0.05, 0.05, 0.2), "object")
    assert SHAPE.checker(obstacles_of(graph(tall)), 0.0).collides(low, "contact")


def test_what_is_held_counts_and_may_be_set_down():
    held = Held("board", "board", Pose((0.0, 0.0, 0.03)), (0.06, 0.04, 0.1))
    checker = SHAPE.checker(obstacles_of(graph()), 0.04, held)
    assert not checker.collides(at((0.5, 0.0, 0.08)), "contact"), "5 mm over the table and a little into it"
    hit = checker.hit(at((0.5, 0.0, 0.03)), "contact")
    assert hit is not None and "board" in hit.robot and hit.other == "table"


def test_a_start_in_contact_can_be_left_but_not_entered_deeper():
    start = at((0.5, 0.0, 0.3))
    wall = box("wall", (0.5, 0.095, 0.35), (0.3, 0.02, 0.3))
    checker = SHAPE.checker(obstacles_of(graph(wall)), 0.08)
    assert checker.collides(start, "free") and checker.collides(start, "contact")
    checker.leave(start)
    assert not checker.collides(start, "free") and not checker.collides(start, "contact")
    assert not checker.collides(at((0.5, -0.05, 0.3)), "free")
    assert checker.collides(at((0.5, 0.03, 0.3)), "free")


def test_what_the_hand_carries_moves_with_it():
    door = box("door", (0.62, 0.0, 0.3), (0.02, 0.3, 0.3), "part")
    checker = SHAPE.checker(obstacles_of(graph(door)), 0.02, carried=["door"])
    posture = at((0.5, 0.0, 0.3), side_orientation.call(None, ([1.0, 0.0, 0.0], "horizontal", 0.5)))
    assert not checker.collides(posture, "contact")
    motion = np.eye(4)
    motion[0, 3] = -0.3
    checker.carry(motion)
    assert checker.collides(posture, "contact"), "the forearm is where the door was carried to"


@pytest.mark.parametrize("pair", [("panda_link5", "panda_link7"), ("panda_leftfinger", "panda_rightfinger")])
def test_neighbours_and_fingers_are_no_self_collision(pair):
    names = {frozenset((SHAPE.links[a], SHAPE.links[b])) for a, b in SHAPE.self_pairs}
    assert frozenset(pair) not in names or pair[0] == "panda_link5"
    assert frozenset(("panda_hand", "panda_link2")) in names
