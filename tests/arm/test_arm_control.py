"""The robot as skills see it: stopping, gripping, remembering what is held, and going on from a checkpoint."""

from __future__ import annotations

import math
import threading
import time

import attrs
import numpy as np
import pytest
from memo_franka.description import panda
from memo_perception.ground_truth import GroundTruth
from memo_sim_mujoco.simulator import MujocoSimulator

from memo_core.arm.control import ArmControl
from memo_core.arm.simulated_link import SimulatorLink
from memo_core.errors import InvalidArgument, MotionError, Stopped
from memo_core.interfaces.perception import PerceptionContext
from memo_core.scene.description import Body, Free, Geom, SceneDescription
from memo_core.scene.graph import Node
from memo_core.scene.pose import Pose
from memo_core.skills.contract import BUILTIN_SKILLS, side_orientation, top_orientation
from tests.support.arms import box, control_of, limits_used
from tests.support.timing import shortest

TOP = top_orientation.call(None, ())
CUBE = box("cube", (0.45, 0.1, 0.025), (0.05, 0.05, 0.05), "object")


# -- stopping --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("when", [3, 40, 90])
def test_a_stop_ends_the_motion_within_one_tick_by_a_limited_deceleration(when):
    control, link, _ = control_of(panda())
    link.stop_at = when
    with pytest.raises(Stopped):
        control.move_to([0.3, 0.5, 0.4], TOP, None, 0.0, 1.0)
    braking = len(link.sent) - when
    assert 0 < braking * link.control_period <= 0.25, "only the deceleration follows the stop"
    velocity, acceleration, jerk = limits_used(panda(), link.sent, link.control_period)
    assert velocity <= 1.01 and acceleration <= 1.05 and jerk <= 1.05
    assert np.abs(link.joint_velocities()).max() < 0.02, "at rest"


def test_after_a_stop_everything_that_moves_is_refused_until_the_release():
    control, link, _ = control_of(panda())
    link.stop()
    acts = [
        lambda: control.move_to([0.4, 0.2, 0.4], TOP, None, 0.0, 1.0),
        lambda: control.follow_path([([0.4, 0.0, 0.4], None)], None, 0.7, 0.5),
        control.go_home,
        lambda: control.open_gripper(None),
        lambda: control.close_gripper(None),
        lambda: control.wait(0.1),
        control.look,
    ]
    for act in [*acts, *acts]:
        with pytest.raises(Stopped):
            act()
    assert link.sent == []
    link.release()
    control.move_to([0.4, 0.2, 0.4], TOP, None, 0.0, 1.0)


@pytest.mark.parametrize("doing", ["open", "close", "wait"])
def test_a_stop_is_heard_while_the_fingers_move_and_while_waiting(doing):
    control, link, _ = control_of(panda())
    link.stop_at = 5
    acts = {
        "open": lambda: control.open_gripper(0.02),
        "close": lambda: control.close_gripper(None),
        "wait": lambda: control.wait(9),
    }
    with pytest.raises(Stopped):
        acts[doing]()
    assert len(link.sent) == 5


def test_a_stop_keeps_the_grip_and_the_next_motion_starts_where_the_arm_is():
    control, link, _ = control_of(panda(), CUBE)
    control.move_to([0.45, 0.1, 0.025], TOP, None, 0.7, 1.0)
    link.thing = 0.05
    control.close_gripper(None)
    link.stop_at = len(link.sent) + 30
    with pytest.raises(Stopped):
        control.follow_path([([0.45, 0.1, 0.4], None)], None, 0.7, 0.5)
    assert control.holding()
    link.release()
    first = len(link.sent)
    control.go_home()
    assert control.holding()
    used = limits_used(panda(), link.sent[first:], link.control_period, start=link.sent[first - 1])
    assert max(used) <= 1.001


# -- the hand --------------------------------------------------------------------------------------------------------


def test_the_gripper_is_waited_for_and_tells_its_width():
    control, link, _ = control_of(panda())
    assert control.close_gripper(None) == pytest.approx(0.0, abs=0.002)
    assert not control.holding()
    assert control.open_gripper(0.045) == pytest.approx(0.045, abs=0.002)
    assert control.open_gripper(None) == pytest.approx(0.08, abs=0.002)
    link.thing = 0.03
    assert control.close_gripper(20.0) == pytest.approx(0.03, abs=0.002)
    assert control.holding()


def test_fingers_that_do_not_open_are_an_error_which_names_what_is_beside_them(monkeypatch):
    places = {"left wall": 0.155, "right wall": 0.045, "far wall": 0.4}
    walls = [box(name, (0.45, y, 0.025), (0.2, 0.02, 0.05)) for name, y in places.items()]
    control, link, _ = control_of(panda(), *walls)
    control.close_gripper(None)
    control.move_to([0.45, 0.1, 0.04], TOP, None, 0.7, 1.0)
    assert control.open_gripper(0.04) == pytest.approx(0.04, abs=0.002)
    monkeypatch.setattr(link, "set_gripper", lambda width, force: None)
    told = "opened to 4.0 cm instead of 8.0 cm, held back by the left wall and the right wall"
    with pytest.raises(MotionError, match=told) as error:
        control.open_gripper(None)
    assert error.value.cause == "not-arrived"
    assert control.open_gripper(0.045) == pytest.approx(0.04, abs=0.002), "the returned width suffices"
    assert control.open_gripper(0.02) == pytest.approx(0.04, abs=0.002), "something may be between them"


@pytest.mark.parametrize(
    "act", [lambda c: c.open_gripper(0.12), lambda c: c.close_gripper(150.0), lambda c: c.close_gripper(1.0)]
)
def test_what_this_gripper_cannot_do_is_refused_with_what_it_can(act):
    control, link, _ = control_of(panda())
    with pytest.raises(InvalidArgument, match="gripper"):
        act(control)
    assert link.sent == []


# -- what is held ----------------------------------------------------------------------------------------------------


def _grasp(control, link):
    control.move_to([0.45, 0.1, 0.025], TOP, None, 0.7, 1.0)
    link.thing = 0.05
    control.close_gripper(None)


def test_a_held_object_is_no_obstacle_but_may_not_touch_others():
    tall = attrs.evolve(CUBE, size=(0.05, 0.05, 0.30), pose=Pose((0.45, 0.1, 0.15)))
    shelf = box("shelf", (0.45, -0.3, 0.31), (0.3, 0.3, 0.02))
    control, link, _ = control_of(panda(), tall, shelf)
    control.move_to([0.45, 0.1, 0.28], TOP, None, 0.7, 1.0)
    link.thing = 0.05
    control.close_gripper(None)
    control.follow_path([([0.45, 0.1, 0.55], None)], None, 0.7, 0.5)
    moved = len(link.sent)
    with pytest.raises(MotionError) as error:
        control.move_to([0.45, -0.3, 0.5], TOP, None, 0.0, 1.0)
    assert error.value.cause == "collision" and "the held cube touches the shelf" in str(error.value)
    assert len(link.sent) == moved
    control.move_to([0.45, -0.3, 0.62], TOP, None, 0.0, 1.0)
    control.follow_path([([0.45, -0.3, 0.601], None)], None, 0.7, 0.5)


def test_what_was_let_go_is_an_obstacle_where_it_was_let_go():
    control, link, _ = control_of(panda(), CUBE)
    _grasp(control, link)
    control.follow_path([([0.45, 0.1, 0.15], None)], None, 0.0, 0.5)
    control.move_to([0.45, -0.2, 0.15], TOP, None, 0.0, 1.0)
    control.follow_path([([0.45, -0.2, 0.027], None)], None, 0.0, 0.5)
    link.thing = None
    control.open_gripper(None)
    control.go_home()
    control.close_gripper(None)
    with pytest.raises(MotionError, match="cube"):
        control.move_to([0.45, -0.2, 0.03], TOP, None, 0.0, 1.0)
    control.move_to([0.45, 0.1, 0.03], TOP, None, 0.0, 1.0)


def test_a_door_held_by_its_handle_moves_along():
    fridge = box("fridge", (0.87, 0.0, 0.25), (0.30, 0.36, 0.5))
    door = Node("door", "fridge door", Pose((0.70, 0.0, 0.25)), (0.018, 0.36, 0.5), "fridge", "part")
    handle = Node("handle", "fridge handle", Pose((0.64, -0.15, 0.3)), (0.018, 0.018, 0.2), "door", "part")
    control, link, _ = control_of(panda(), fridge, door, handle)
    hand = side_orientation.call(None, ([1.0, 0.0, 0.0], "horizontal"))
    control.open_gripper(0.05)
    control.move_to([0.54, -0.15, 0.3], hand, [([0.64, -0.15, 0.3], hand)], 0.7, 1.0)
    control.follow_path([([0.64, -0.15, 0.3], hand)], None, 0.7, 0.5)
    link.thing = 0.018
    control.close_gripper(None)
    control.follow_path([([0.54, -0.15, 0.3], None)], None, 0.7, 0.5)
    assert control._attachment.carried_poses["door"].position == pytest.approx((0.60, 0.0, 0.25), abs=0.003)
    link.thing = None
    control.open_gripper(None)
    control.go_home()


# -- checkpoints -----------------------------------------------------------------------------------------------------


def test_a_restored_control_goes_on_as_before():
    records = []
    for restored in (False, True):
        control, link, perception = control_of(panda(), CUBE, box("wall", (0.5, -0.1, 0.1), (0.3, 0.04, 0.2)))
        _grasp(control, link)
        control.follow_path([([0.45, 0.1, 0.2], None)], None, 0.0, 0.5)
        if restored:
            saved, world = control.state(), link.checkpoint()
            other = ArmControl(panda(), link, perception)
            link.thing = 0.05
            link.restore(world)
            other.restore(saved)
            assert other.scene().nodes == control.scene().nodes
            assert other._attachment == control._attachment
            control = other
        first = len(link.sent)
        control.move_to([0.45, -0.35, 0.2], TOP, None, 0.0, 1.0)
        records.append(np.array(link.sent[first:]))
    assert np.array_equal(*records)


@pytest.mark.parametrize("state", [b"", b"{}", b"\xff\xfe", b'{"attachment": 3, "scene": null}'])
def test_a_state_of_something_else_is_refused(state):
    control, _, _ = control_of(panda())
    with pytest.raises(InvalidArgument, match="control state"):
        control.restore(state)


# -- with physics ----------------------------------------------------------------------------------------------------


@pytest.fixture
def tabletop():
    body = Body("cube", (Geom("box", (0.05, 0.05, 0.05)),), Pose((0.45, 0.1, 0.026)), Free(), 0.1, "cube")
    scene = SceneDescription((body,))
    with MujocoSimulator() as simulator:
        simulator.build(scene, panda())
        link = SimulatorLink(simulator, panda())
        perception = GroundTruth()
        control = ArmControl(panda(), link, perception)
        perception.start(
            PerceptionContext(np.random.default_rng(0), panda(), link, control.tool_pose, simulator, scene)
        )
        yield simulator, link, control


@pytest.mark.sim
def test_a_stop_brakes_an_arm_with_servos_within_its_limits(tabletop):
    """Servos lag: what is commanded leads what is meant, and braking has to begin from the latter with that lead."""
    simulator, link, control = tabletop
    velocities = []

    def watch() -> None:
        velocities.append(link.joint_velocities())
        if len(velocities) == 40:
            link.stop()

    simulator.add_tick_listener(watch)
    with pytest.raises(Stopped):
        control.move_to([0.3, 0.5, 0.4], TOP, None, 0.0, 1.0)
    assert np.abs(velocities[39]).max() > 0.5, "it was moving"
    acceleration = np.abs(np.diff(velocities[39:], axis=0)).max(axis=0) / link.control_period
    assert np.all(acceleration <= 1.2 * np.array([joint.acceleration for joint in panda().joints]))
    assert np.abs(velocities[-1]).max() < 0.15, "nearly at rest when the last command is sent"


@pytest.mark.sim
def test_a_cube_is_picked_up_and_put_down_by_skills(tabletop):
    simulator, _, control = tabletop
    skills = {one.name: one for one in BUILTIN_SKILLS}

    def call(name, *arguments):
        return skills[name].call(control, arguments)

    x, y, z = call("get_position", "cube")
    call("move_to", [x, y, z + 0.12], call("top_orientation"))
    call("move_straight", [x, y, z])
    assert call("close_gripper") == pytest.approx(0.05, abs=0.008) and call("is_holding")
    call("move_straight", [x, y, z + 0.15])
    assert "the gripper holds the cube" in call("look")
    call("move_to", [x, y - 0.3, z + 0.15])
    call("rotate_gripper", math.pi / 4)
    call("move_straight", [x, y - 0.3, z + 0.003])
    call("open_gripper")
    call("move_straight", [x, y - 0.3, z + 0.15])
    call("go_home")
    place = simulator.body_pose("cube")
    assert place.position == pytest.approx((x, y - 0.3, 0.025), abs=0.008)


@pytest.mark.sim
def test_fingers_that_were_pushed_beyond_their_stroke_open_and_stay_open(tabletop):
    simulator, link, control = tabletop
    control.close_gripper(20.0)
    data, world = simulator.data, simulator._world
    data.qpos[world.finger_qpos] = 0.0402  # as a lever does that the hand slips off
    data.qvel[:] = 0.0
    assert link.gripper_width() > panda().gripper.stroke
    assert control.open_gripper(None) == pytest.approx(0.08, abs=0.002)
    control.wait(1.0)
    assert control.gripper_width() == pytest.approx(0.08, abs=0.002)


@pytest.mark.sim
def test_a_restored_link_knows_what_its_gripper_was_sent_to(tabletop):
    _, link, control = tabletop
    control.close_gripper(None)
    saved = link.checkpoint()
    control.open_gripper(None)
    link.restore(saved)
    assert link.commanded_width == 0.0


@pytest.mark.sim
def test_the_simulated_arm_arrives_and_keeps_its_limits(tabletop):
    simulator, link, control = tabletop
    speeds = []
    simulator.add_tick_listener(lambda: speeds.append(simulator.joint_velocities()))
    control.move_to([0.3, 0.5, 0.4], TOP, None, 0.0, 1.0)
    control.move_to([0.5, -0.3, 0.2], TOP, None, 0.0, 1.0)
    assert control.tool_pose().distance(Pose((0.5, -0.3, 0.2), tuple(TOP)))[0] < 0.001
    velocity = np.array(speeds)
    # Over 50 ms: the simulated wrist, whose torque is clipped at 12 Nm, rattles from tick to tick.
    acceleration = (velocity[5:] - velocity[:-5]) / (5 * link.control_period)
    assert np.all(np.abs(velocity).max(axis=0) <= [joint.velocity for joint in panda().joints])
    assert np.all(np.abs(acceleration).max(axis=0) <= [joint.acceleration for joint in panda().joints])


@pytest.mark.sim
def test_a_stop_from_another_thread_is_heard_at_once(tabletop):
    simulator, link, control = tabletop
    simulator.add_tick_listener(lambda: time.sleep(0.002))  # a picture taken every tick

    def seconds() -> float:
        told = []

        def press():
            told.append(time.perf_counter())
            link.stop()

        threading.Timer(0.4, press).start()
        with pytest.raises(Stopped):
            for _ in range(50):
                control.wait(1.0)
        took = time.perf_counter() - told[0]
        link.release()
        return took

    assert shortest(seconds, 0.05) < 0.05
