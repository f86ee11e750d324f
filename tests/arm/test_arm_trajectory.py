"""Trajectories keep velocity, acceleration and jerk limits, end where they should, and stop within the limits too."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from memo_franka.description import panda

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.rrt_connect import densified
from memo_core.arm.trajectory import Speed, stopping, time_path
from tests.support.arms import limits_used, six_joint_arm

ARMS = {"panda": Kinematics(panda()), "six": Kinematics(six_joint_arm())}
PERIOD = 0.01


@pytest.mark.parametrize("name", ARMS)
@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    corners=st.integers(2, 6),
    speed=st.floats(0.05, 1.0),
    stops=st.booleans(),
)
def test_no_limit_is_exceeded_whatever_the_path(name, seed, corners, speed, stops):
    kinematics = ARMS[name]
    rng = np.random.default_rng(seed)
    points = rng.uniform(kinematics.lower[:, None], kinematics.upper[:, None], (kinematics.count, corners))
    dense, inner = densified(points)
    plan = time_path(kinematics, dense, Speed(speed, speed, 2.5 * speed), PERIOD, stops=inner if stops else ())
    used = limits_used(kinematics.description, plan.targets, PERIOD, start=dense[:, 0])
    assert max(used) <= 1.0 + 1e-6, f"velocity, acceleration, jerk at {used} of their limits"
    assert np.allclose(plan.targets[-1], dense[:, -1], atol=1e-9)
    assert all(kinematics.within_limits(row, 1e-9) for row in plan.targets)


def test_the_tool_keeps_to_its_speed():
    kinematics = ARMS["panda"]
    dense, _ = densified(np.column_stack([kinematics.home, kinematics.home + 0.5]))
    plan = time_path(kinematics, dense, Speed(1.0, 0.2, 5.0), PERIOD)
    _, positions = kinematics.forward(plan.targets.T)
    speeds = np.linalg.norm(np.diff(positions, axis=1), axis=0) / PERIOD
    assert 0.15 < speeds.max() <= 0.205


def test_a_straight_joint_line_stays_straight():
    kinematics = ARMS["panda"]
    goal = kinematics.home + np.linspace(0.2, -0.6, 7)
    plan = time_path(kinematics, densified(np.column_stack([kinematics.home, goal]))[0], Speed(1.0, 1.0, 3.0), PERIOD)
    along = (goal - kinematics.home) / np.linalg.norm(goal - kinematics.home)
    offset = plan.targets - kinematics.home
    across = offset - np.outer(offset @ along, along)
    assert np.abs(across).max() < 1e-6


def test_stops_are_rests():
    kinematics = ARMS["panda"]
    points = np.column_stack([kinematics.home, kinematics.home + 0.4, kinematics.home - 0.2])
    dense, inner = densified(points)
    plan = time_path(kinematics, dense, Speed(1.0, 1.0, 3.0), PERIOD, stops=inner)
    assert np.abs(plan.targets - points[:, 1]).max(axis=1).min() < 1e-9


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_stopping_is_limited_and_short(seed):
    kinematics = ARMS["panda"]
    rng = np.random.default_rng(seed)
    last = kinematics.home
    velocity = rng.uniform(-1, 1, 7) * kinematics.velocity * 0.95
    targets = stopping(kinematics, last - velocity * PERIOD, last, PERIOD)
    path = np.array([last - velocity * PERIOD, last, *targets])
    acceleration = np.abs(np.diff(path, 2, axis=0)) / PERIOD**2
    assert np.all(acceleration <= kinematics.acceleration * 1.01)
    assert len(targets) * PERIOD < 0.4
    assert np.allclose(targets[-1], targets[-2], atol=1e-3), "at rest in the end"
