"""Motions that feel: what they estimate, what they refuse before anything moves, how they stop."""

from __future__ import annotations

import math

import numpy as np
import pytest
from memo_franka.description import panda
from memo_sim_mujoco.simulator import MujocoSimulator

from memo_core.arm.control import ArmControl
from memo_core.arm.force import STRAY, spiral
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.simulated_link import SimulatorLink
from memo_core.errors import InvalidArgument, MotionError, Stopped
from memo_core.scene.description import Body, Geom, Material, SceneDescription
from memo_core.scene.pose import Pose
from memo_core.skills.contract import BUILTIN_SKILLS, top_orientation
from tests.support.arms import FixedPerception, control_of, limits_used, six_joint_arm

DOWN = [0.0, 0.0, -1.0]
SKILLS = {one.name: one for one in BUILTIN_SKILLS}


class Bench:
    """The Panda over a table with a hole and a slope, which give something to feel."""

    def __init__(self) -> None:
        slick = Material(friction=0.2)
        wall = 0.05
        hole = [
            Geom("box", (0.2, wall, 0.03), Pose((0, side * (0.012 + wall / 2), 0.015)), material=slick)
            for side in (-1, 1)
        ]
        hole += [
            Geom("box", (wall, 0.024, 0.03), Pose((side * (0.013 + wall / 2), 0, 0.015)), material=slick)
            for side in (-1, 1)
        ]
        # Not slick: bare fingertips that hardly stick to a slope chatter, by several newtons.
        slope = Geom("box", (0.2, 0.3, 0.02), Pose((0, 0, 0.02), (math.cos(0.04), math.sin(0.04), 0, 0)))
        scene = SceneDescription(
            (Body("block", tuple(hole), Pose((0.5, 0.25, 0.0))), Body("slope", (slope,), Pose((0.5, -0.2, 0.0))))
        )
        self.simulator = MujocoSimulator()
        self.simulator.open()
        self.simulator.build(scene, panda())
        self.link = SimulatorLink(self.simulator, panda())
        self.control = ArmControl(panda(), self.link, FixedPerception())
        self.call("close_gripper")
        self.call("move_to", [0.5, 0.0, 0.06], top_orientation.call(None))
        self._start = self.link.checkpoint(), self.control.state()

    def again(self) -> Bench:
        self.link.restore(self._start[0])
        self.control.restore(self._start[1])
        self.link.release()
        return self

    def call(self, name: str, *args, **kwargs):
        return SKILLS[name].call(self.control, args, kwargs)

    def touching(self, body: str) -> float:
        """N that the robot truly presses with on a body."""
        found = self.simulator.contacts(body)
        return sum(c.force for c in found if "robot/" in c.first or "robot/" in c.second)


@pytest.fixture(scope="module")
def opened():
    bench = Bench()
    yield bench
    bench.simulator.close()


@pytest.fixture
def bench(opened):
    return opened.again()


@pytest.mark.sim
def test_what_is_felt_is_what_the_contacts_say(bench):
    bench.call("move_until_contact", DOWN, 0.1, 4.0, 0.02)
    for force in (5.0, 20.0):
        bench.call("press", DOWN, force, 1.0)
        assert abs(bench.call("get_contact_force")[2] - bench.touching("table")) < 0.3


@pytest.mark.sim
def test_moving_through_the_air_feels_like_nothing(bench):
    felt = []
    bench.simulator.add_tick_listener(lambda: felt.append(bench.link.contact_wrench()[:3]))
    bench.call("move_straight", [0.5, 0.1, 0.2])
    bench.simulator.remove_tick_listener(bench.simulator._listeners[-1])
    assert np.linalg.norm(np.array(felt) - felt[0], axis=1).max() < 0.5


@pytest.mark.sim
def test_a_held_weight_is_felt_until_the_hand_is_free_again(bench):
    # 0.2 kg of pull, as if something hung from the hand: the read-out begins anew with the next free motion
    felt = bench.link.contact_wrench
    bench.link.contact_wrench = lambda: felt() - [0, 0, 1.96, 0, 0, 0]
    try:
        assert abs(bench.call("get_contact_force")[2] + 1.96) < 0.1
        bench.call("move_to", [0.5, 0.0, 0.10])
        assert abs(bench.call("get_contact_force")[2]) < 0.1
    finally:
        bench.link.contact_wrench = felt


@pytest.mark.sim
def test_a_slope_is_followed_with_the_force_kept(bench):
    bench.call("move_to", [0.5, -0.12, 0.10])
    bench.call("move_until_contact", DOWN, 0.1, 4.0, 0.02)
    x, _, z = bench.call("get_gripper_position")
    pressed = []
    bench.simulator.add_tick_listener(lambda: pressed.append(bench.touching("slope")))
    mean = bench.call("press_along", [[x, -0.26, z]], DOWN, 6.0, 0.04)
    bench.simulator.remove_tick_listener(bench.simulator._listeners[-1])
    end = bench.call("get_gripper_position")
    assert abs(end[2] - z + 0.14 * math.tan(0.08)) < 0.002, "the hand did not go down the slope"
    assert abs(mean - 6.0) < 1.0 and abs(np.mean(pressed[60:]) - mean) < 1.0
    assert max(pressed[60:]) < 30.0  # bare fingertips chatter


@pytest.mark.sim
def test_turning_while_pressing_keeps_both(bench):
    bench.call("move_until_contact", DOWN, 0.1, 4.0, 0.02)
    before = bench.control.tool_pose()
    bench.call("rotate_gripper", 0.6, push=8.0)
    after = bench.control.tool_pose()
    turned = before.inverse() * after
    assert abs(2 * math.asin(turned.orientation[3]) - 0.6) < 0.02
    assert abs(bench.call("get_contact_force")[2] - 8.0) < 2.5


@pytest.mark.sim
@pytest.mark.parametrize("aside", [(0.004, 0.0), (-0.003, 0.003)])
def test_a_hole_is_found_by_searching(bench, aside):
    # The closed fingertips, 22 mm by 20 mm, over a hole of 26 mm by 24 mm.
    over = [0.5 + aside[0], 0.25 + aside[1]]
    bench.call("move_to", [*over, 0.08], top_orientation.call(None))
    bench.call("move_until_contact", DOWN, 0.1, 4.0, 0.02)
    above = bench.call("get_gripper_position")[2]
    found = bench.call("spiral_search", DOWN, 0.006, 4.0, 0.004)
    assert above - found[2] > 0.0035
    assert np.linalg.norm(np.array(found[:2]) - [0.5, 0.25]) < 0.004


@pytest.mark.sim
def test_what_carries_the_hand_about_a_pivot_keeps_its_distance(bench):
    pivot = [0.5, 0.0, 0.0]
    before = np.array(bench.call("get_gripper_position"))
    bench.call("turn_about", pivot, [0, 1, 0], 0.5)
    after = np.array(bench.call("get_gripper_position"))
    assert abs(np.linalg.norm(after - pivot) - np.linalg.norm(before - pivot)) < 0.002
    expected = [0.5 + 0.06 * math.sin(0.5), 0.0, 0.06 * math.cos(0.5)]
    assert np.allclose(after, expected, atol=0.003)


# -- refused before anything moves -----------------------------------------------------------------------------------


@pytest.mark.sim
@pytest.mark.parametrize(
    ("call", "error", "match"),
    [
        (("press", DOWN, 100.0), InvalidArgument, r"press\(force\): 100 N .* at most 60 N"),
        (("move_until_contact", DOWN, 0.1, 90.0), InvalidArgument, r"move_until_contact\(force\)"),
        (("move_until_contact", [0, 0, 0], 0.1), InvalidArgument, r"direction\): it has no length"),
        (("move_until_contact", [1, 0, 0], 0.9), MotionError, "workspace"),
        (("move_until_contact", DOWN, 0.1, 5.0, 50.0), InvalidArgument, "m/s, 0.005 to 0.2"),
        (("press_along", [[0.5, 0.0, -0.2]], DOWN, 5.0), MotionError, "below the table"),
        (("turn_about", [0.5, 0, 0], [0, 0, 0], 0.5), InvalidArgument, r"turn_about\(axis\)"),
    ],
)
def test_what_cannot_be_done_is_said_before_anything_moves(bench, call, error, match):
    before = bench.link.joint_targets()
    with pytest.raises(error, match=match):
        bench.call(call[0], *call[1:])
    assert np.array_equal(bench.link.joint_targets(), before)


@pytest.mark.sim
def test_pressing_where_the_arm_could_not_give_way_is_refused_before_anything_moves(bench):
    bench.call("move_to", [0.79, 0.0, 0.06], slack=0.0)
    before = bench.link.joint_targets()
    with pytest.raises(MotionError, match=r"3 cm further along the direction .* out of its reach"):
        bench.call("press", [1, 0, 0], 5.0)
    assert np.array_equal(bench.link.joint_targets(), before)


# -- an elastic wall, without dynamics ---------------------------------------------------------------------------------


def walled(stiffness: float = 5000.0, height: float = 0.30):
    """An arm over an elastic floor at ``height`` (m)."""
    description = six_joint_arm()
    control, link, _ = control_of(description)
    kinematics = Kinematics(description)

    def felt(joints) -> np.ndarray:
        deep = max(0.0, height - kinematics.pose(joints).position[2])
        return np.array([0, 0, stiffness * deep, 0, 0, 0])

    control.move_to([0.45, 0.1, height + 0.03], None, None, 0.0, 1.0)
    link.felt = felt
    return control, link, description


@pytest.mark.parametrize("stiffness", [800.0, 5000.0, 20000.0])
def test_any_stiffness_is_pressed_with_the_force_asked_for(stiffness):
    control, link, _ = walled(stiffness)
    control.move_until_contact(DOWN, 0.1, 4.0, 0.02)
    control.press(DOWN, 10.0, 2.0)
    felt = [link.felt(row)[2] for row in link.sent[-50:]]
    assert abs(np.mean(felt) - 10.0) < 1.0 and np.std(felt) < 0.5


def test_pressing_keeps_the_joints_limits():
    control, link, description = walled()
    start = link.joint_targets()
    link.sent.clear()
    control.move_until_contact(DOWN, 0.1, 4.0, 0.05)
    x, y, z = control.tool_pose().position
    control.press_along("press_along", [([x, y + 0.05, z], None)], DOWN, 6.0, 0.05)
    velocity, acceleration, _ = limits_used(description, link.sent, link.control_period, start)
    assert velocity <= 1.0 and acceleration <= 1.5


@pytest.mark.parametrize("after", [25, 40, 150])
def test_a_stop_while_feeling_brings_the_arm_to_rest_and_refuses_what_follows(after):
    control, link, description = walled()
    start = link.joint_targets()
    link.sent.clear()
    link.stop_at = after
    with pytest.raises(Stopped):
        control.move_until_contact(DOWN, 0.1, 4.0, 0.1)
        control.press(DOWN, 6.0, 5.0)
    assert np.abs(np.diff(link.sent[-2:], axis=0)).max() < 1e-5, "the arm was not brought to rest"
    acceleration = limits_used(description, link.sent, link.control_period, start)[1]
    assert acceleration <= 1.5
    count = len(link.sent)
    with pytest.raises(Stopped):
        control.press(DOWN, 6.0, 1.0)
    assert len(link.sent) == count


def test_a_force_beyond_the_limit_ends_the_motion():
    control, link, _ = walled()
    elastic = link.felt
    control.move_until_contact(DOWN, 0.1, 4.0, 0.02)
    link.felt = lambda joints: elastic(joints) + [0, 80.0 if elastic(joints)[2] > 3 else 0.0, 0, 0, 0, 0]
    with pytest.raises(MotionError, match="more than the 60 N this arm may press with") as caught:
        control.press_along("press_along", [([0.45, 0.2, 0.30], None)], DOWN, 6.0, 0.05)
    assert caught.value.cause == "force"


def test_a_surface_that_ends_is_lost_contact():
    control, link, _ = walled()
    elastic = link.felt
    kinematics = Kinematics(six_joint_arm())
    link.felt = lambda joints: elastic(joints) * (kinematics.pose(joints).position[1] < 0.14)
    control.move_until_contact(DOWN, 0.1, 4.0, 0.02)
    x, _, z = control.tool_pose().position
    with pytest.raises(MotionError, match="contact was lost") as caught:
        control.press_along("press_along", [([x, 0.25, z], None)], DOWN, 6.0, 0.05)
    assert caught.value.cause == "no-contact"


def test_a_drop_ends_a_search_where_it_happened():
    control, link, _ = walled()
    kinematics = Kinematics(six_joint_arm())
    elastic = link.felt
    control.move_until_contact(DOWN, 0.1, 4.0, 0.02)
    centre = np.array(control.tool_pose().position)
    hole = centre[:2] + [0.003, 0.0]
    deep = np.array([0, 0, 0.008 * 5000.0, 0, 0, 0])

    def felt(joints):
        away = np.linalg.norm(np.array(kinematics.pose(joints).position[:2]) - hole)
        return np.maximum(elastic(joints) - deep, 0.0) if away < 0.0012 else elastic(joints)

    link.felt = felt
    found = control.spiral_search(DOWN, 0.006, 4.0, 0.003, 0.001)
    assert np.linalg.norm(np.array(found[:2]) - hole) < 0.002
    assert centre[2] - found[2] > 0.0025


def test_a_spiral_covers_the_circle():
    centre = Pose((0.4, 0.1, 0.2))
    points = np.array(spiral(centre, DOWN, 0.005, 0.001)) - centre.position
    assert np.allclose(points[:, 2], 0.0) and np.allclose(points[-1], 0.0)
    radii = np.linalg.norm(points, axis=1)
    assert radii.max() < 0.0051
    rng = np.random.default_rng(0)
    for angle, r in zip(rng.uniform(0, 2 * math.pi, 50), rng.uniform(0, 0.0045, 50), strict=True):
        spot = [r * math.cos(angle), r * math.sin(angle), 0.0]
        assert np.linalg.norm(points - spot, axis=1).min() < 0.0009


def test_what_the_force_loop_may_leave_the_path_by_is_said_in_the_skills():
    assert f"{100 * STRAY:.0f} cm" in SKILLS["press_along"].doc and f"{100 * STRAY:.0f} cm" in SKILLS["press"].doc


@pytest.mark.sim
def test_force_memory_is_part_of_the_checkpoint(bench):
    bench.call("move_until_contact", DOWN, 0.1, 4.0, 0.02)
    link, control = bench.link.checkpoint(), bench.control.state()
    first = bench.call("press", DOWN, 7.0, 0.5), bench.call("get_contact_force")
    bench.call("move_straight", [0.5, 0.0, 0.2])
    bench.link.restore(link)
    bench.control.restore(control)
    assert (bench.call("press", DOWN, 7.0, 0.5), bench.call("get_contact_force")) == first
