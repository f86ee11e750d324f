"""Starts for inverse kinematics are near their goals, whatever the arm's first and last joint are, and reach all that
blind starts reach."""

from __future__ import annotations

import attrs
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from memo_franka.description import panda

from memo_core.arm.ik_seeds import Seeds, seeds_of
from memo_core.arm.inverse_kinematics import Kinematics, first_of_cells
from memo_core.errors import Stopped
from memo_core.scene.pose import Pose, quaternion_from_axis_angle
from tests.support.arms import six_joint_arm, six_with_a_sliding_first_joint
from tests.support.planning import bench_planning, hard_motions


def six_with_whole_turns():
    arm = six_joint_arm()
    return attrs.evolve(arm, name="turns", joints=tuple(attrs.evolve(j, lower=-6.2, upper=6.2) for j in arm.joints))


ARMS = {
    "panda": Kinematics(panda()),
    "six": Kinematics(six_joint_arm()),
    "rail": Kinematics(six_with_a_sliding_first_joint()),
    "turns": Kinematics(six_with_whole_turns()),
}


def goal_of(kinematics: Kinematics, shares: list[float]) -> Pose:
    share = np.array(shares[: kinematics.count])
    return kinematics.pose(kinematics.lower + (0.1 + 0.8 * share) * (kinematics.upper - kinematics.lower))


def starts_for(kinematics: Kinematics, pose: Pose, most: int = 60):
    rotation, position = pose.rotation[:, :, None], np.asarray(pose.position)[:, None]
    return seeds_of(kinematics).near(rotation, position, most)[0], rotation, position


@pytest.mark.parametrize("name", ARMS)
@settings(max_examples=25, deadline=None)
@given(shares=st.lists(st.floats(0, 1), min_size=7, max_size=7))
def test_starts_are_inside_the_limits_near_the_goal_and_lead_there(name, shares):
    kinematics = ARMS[name]
    pose = goal_of(kinematics, shares)
    most = 240 if name == "turns" else 60  # each of the same starts comes in every turn
    starts, rotation, position = starts_for(kinematics, pose, most)
    assert 0 < starts.shape[1] <= most
    assert all(kinematics.within_limits(one) for one in starts.T)
    _, places = kinematics.forward(starts)
    _, anywhere = kinematics.forward(kinematics.samples(500))
    far = np.linalg.norm(anywhere - position, axis=0)
    assert np.median(np.linalg.norm(places - position, axis=0)) < 0.6 * np.median(far)
    assert kinematics.solve(starts, rotation, position, 30).solved.any()


@pytest.mark.parametrize("name", ["panda", "six"])
def test_few_near_starts_reach_the_postures_of_many_blind_ones(name):
    kinematics = ARMS[name]
    covered = []
    for x, y, z in ((0.5, 0.1, 0.3), (0.4, -0.3, 0.2), (0.3, 0.3, 0.5)):
        pose = Pose((x, y, z), quaternion_from_axis_angle((0, 1, 0), 2.4))
        starts, rotation, position = starts_for(kinematics, pose, 128)
        blind = kinematics.solve(kinematics.samples(500), rotation, position, 30)
        near = kinematics.solve(starts, rotation, position, 10)
        apart = np.abs(blind.joints[:, blind.solved][:, :, None] - near.joints[:, near.solved][:, None, :])
        covered.append((apart.max(axis=0).min(axis=1) < 0.5).mean())
    assert np.mean(covered) > 0.9, covered


def test_a_joint_that_turns_more_than_once_is_started_in_every_turn():
    kinematics = ARMS["turns"]
    starts, *_ = starts_for(kinematics, kinematics.pose(np.array([0.3, -0.6, 1.6, 0.5, 1.2, 0.4])), 400)
    assert np.ptp(starts[0]) > 6.0 and np.ptp(starts[-1]) > 6.0


def test_each_goal_gets_its_own_starts_and_the_same_ones_every_time():
    kinematics = ARMS["panda"]
    poses = [Pose((0.5, 0.2, 0.3), (0.0, 1.0, 0.0, 0.0)), Pose((0.3, -0.4, 0.5), (0.0, 1.0, 0.0, 0.0))]
    rotation = np.stack([pose.rotation for pose in poses], axis=2)
    position = np.array([pose.position for pose in poses]).T
    together, which = seeds_of(kinematics).near(rotation, position, 20)
    for number, pose in enumerate(poses):
        alone, *_ = starts_for(kinematics, pose, 20)
        assert np.array_equal(together[:, which == number], alone)
    assert np.array_equal(Seeds(kinematics).near(rotation, position, 20)[0], together)


def test_arms_with_other_limits_have_another_table():
    narrow = panda()
    joints = (attrs.evolve(narrow.joints[0], lower=-1.0, upper=1.0), *narrow.joints[1:])
    other = Kinematics(attrs.evolve(narrow, joints=joints))
    assert seeds_of(ARMS["panda"]) is seeds_of(Kinematics(panda()))
    assert seeds_of(other) is not seeds_of(ARMS["panda"])
    starts, *_ = starts_for(other, Pose((0.4, 0.3, 0.3), (0.0, 1.0, 0.0, 0.0)))
    assert all(other.within_limits(one) for one in starts.T)


def test_a_stop_ends_the_filling_of_a_table_and_the_next_one_is_whole():
    narrow = panda()
    joints = (attrs.evolve(narrow.joints[0], lower=-2.0, upper=2.0), *narrow.joints[1:])
    polls = []

    def poll() -> None:
        polls.append(1)
        if len(polls) == 3:
            raise Stopped("planning a motion")

    kinematics = Kinematics(attrs.evolve(narrow, joints=joints), poll)
    with pytest.raises(Stopped):
        seeds_of(kinematics)
    starts, *_ = starts_for(kinematics, Pose((0.4, 0.2, 0.3), (0.0, 1.0, 0.0, 0.0)))
    assert starts.shape[1] > 0


@given(st.lists(st.tuples(st.integers(-40, 40), st.integers(-40, 40)), min_size=1, max_size=60))
def test_the_first_of_every_cell_is_kept(cells):
    found = first_of_cells(np.array(cells).T)
    assert [cells[i] for i in found] == list(dict.fromkeys(cells))


def test_the_planning_bench_plans_every_motion_and_finds_what_blind_starts_find():
    measured = bench_planning(panda(), motions=hard_motions()[::3])
    assert measured["planned"] == measured["motions"] == 5, measured["failed"]
    assert measured["near_reached"] >= measured["blind_reached"] == measured["poses"]
    assert measured["covered"] > 0.9
    assert measured["ratio"] > 1.5
