"""Conformance suite for simulators that build only scenes of their own (``Simulator.any_scene`` is False).

Their physics, tables and grippers are a third party's and are not judged here; the promises that the rest of MEMO
relies on are. ``RULES[name](make)``, where ``make`` returns a new, unopened simulator; ``sample`` gives the scene and
robot.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable

import attrs
import numpy as np

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.errors import BackendUnavailable, InvalidArgument, MemoError
from memo_core.interfaces.simulator import Simulator
from memo_core.robot.description import RobotDescription
from memo_core.scene.description import Free, SceneDescription
from memo_core.testing.rules import Rules

Make = Callable[[], Simulator]
RULES: Rules[Callable[[Make], None]] = Rules()
rule = RULES.rule
_NEAR_HOME = 0.2  # rad: a suite's initial states may scatter the arm around its home


@attrs.frozen
class _Sample:
    """An open simulator with its own sample built."""

    simulator: Simulator
    scene: SceneDescription
    robot: RobotDescription


def _built(make: Make) -> _Sample:
    simulator = make()
    simulator.open()
    scene, robot = simulator.sample()
    simulator.build(scene, robot)
    return _Sample(simulator, scene, robot)


def _bend(sample: _Sample) -> None:
    """Command every joint 0.03 (rad or m) towards the middle of its range or beyond, and close the gripper."""
    joints, now = sample.robot.joints, sample.simulator.joint_positions()
    middle = np.array([(joint.lower + joint.upper) / 2 for joint in joints])
    sample.simulator.command_joints(now + np.where(middle >= now, 0.03, -0.03))
    sample.simulator.command_gripper(0.0, sample.robot.gripper.max_force)


def _state(sample: _Sample) -> tuple[object, ...]:
    """Everything that can be read of the state, for exact comparison."""
    simulator, scene = sample.simulator, sample.scene
    joints = [getattr(body.joint, "name", None) for body, _ in scene.walk()]
    return (
        simulator.time,
        tuple(simulator.joint_positions()),
        tuple(simulator.joint_velocities()),
        tuple(simulator.joint_torques()),
        simulator.gripper_width(),
        tuple(simulator.body_pose(body.name) for body, _ in scene.walk()),
        tuple(simulator.joint_position(joint) for joint in joints if joint),
    )


def _history(sample: _Sample, ticks: int = 40) -> list[tuple[object, ...]]:
    states = [_state(sample)]
    for _ in range(ticks):
        sample.simulator.tick()
        states.append(_state(sample))
    return states


@rule
def starts_at_home(make: Make) -> None:
    """After build: time 0, arm near home, gripper open, bodies where the description puts them; also built again."""
    sample = _built(make)
    with sample.simulator as simulator:
        for _ in range(2):
            simulator.build(sample.scene, sample.robot)
            assert simulator.time == 0.0, f"time is {simulator.time}"
            away = np.abs(simulator.joint_positions() - np.array(sample.robot.home)).max()
            assert away < _NEAR_HOME, f"a joint is {away:.3f} rad from home"
            opening = simulator.gripper_width() / sample.robot.gripper.stroke
            assert opening > 0.9, f"the gripper is open by {100 * opening:.0f} %"
            for body in sample.scene.bodies:
                metres, radians = simulator.body_pose(body.name).distance(body.pose)
                assert metres < 1e-6 and radians < 1e-6, f"{body.name!r} is {metres} m, {radians} rad off"
            simulator.tick()


@rule
def other_scenes_are_refused(make: Make) -> None:
    """A scene that is not its own is refused with ``InvalidArgument``."""
    sample = _built(make)
    with sample.simulator as simulator:
        try:
            simulator.build(SceneDescription(()), sample.robot)
        except InvalidArgument:
            return
        raise AssertionError("an empty scene was built")


@rule
def ticks_are_control_periods(make: Make) -> None:
    """A tick takes control_period (at most 10 ms), then calls each listener once; removed ones no more."""
    sample = _built(make)
    with sample.simulator as simulator:
        seen: list[float] = []
        listener = lambda: seen.append(simulator.time)  # removed again, so it needs a name
        simulator.add_tick_listener(listener)
        for _ in range(3):
            simulator.tick()
        simulator.remove_tick_listener(listener)
        simulator.tick()
        assert simulator.control_period <= 0.010001, f"control period {simulator.control_period} s"
        expected = [simulator.control_period * n for n in (1, 2, 3)]
        assert len(seen) == 3 and np.allclose(seen, expected), f"a listener was called at {seen}, expected {expected}"


@rule
def returned_arrays_are_copies(make: Make) -> None:
    """Writing into a returned array changes nothing, and an array does not change when time goes on."""
    sample = _built(make)
    with sample.simulator as simulator:
        _bend(sample)
        reading = (simulator.joint_positions, simulator.joint_velocities)
        for read in (*reading, simulator.joint_torques, simulator.joint_accelerations):
            values = read()
            assert values.shape == (len(sample.robot.joints),), f"{read.__name__} has shape {values.shape}"
            before = values.copy()
            for _ in range(5):
                simulator.tick()
            assert np.array_equal(values, before), f"what {read.__name__} returned changed afterwards"
            values[:] = 9.0
            assert not np.array_equal(read(), values), f"writing into what {read.__name__} returned changed the robot"


@rule
def refuses_non_finite_targets(make: Make) -> None:
    """Targets that are not finite are refused with InvalidArgument and change nothing."""
    sample = _built(make)
    with sample.simulator as simulator:
        before = simulator.joint_positions()
        targets = before.copy()
        targets[0] = math.nan
        try:
            simulator.command_joints(targets)
        except InvalidArgument:
            for _ in range(10):
                simulator.tick()
            assert np.abs(simulator.joint_positions() - before).max() < 0.01, "the arm moved all the same"
        else:
            raise AssertionError("nan was accepted")


@rule
def tool_pose_is_that_of_the_kinematics(make: Make) -> None:
    """tool_pose agrees with the robot's URDF at the joint positions read at the same time, also in motion."""
    sample = _built(make)
    with sample.simulator as simulator:
        kinematics = Kinematics(sample.robot)
        _bend(sample)
        for _ in range(20):
            simulator.tick()
            metres, radians = simulator.tool_pose().distance(kinematics.pose(simulator.joint_positions()))
            assert metres < 1e-4 and radians < 1e-3, f"the tool is {1000 * metres:.2f} mm, {radians:.4f} rad off"


@rule
def links_with_cameras_have_poses(make: Make) -> None:
    """body_pose knows the robot's link that carries a camera, as ``robot/LINK``."""
    sample = _built(make)
    with sample.simulator as simulator:
        for camera in sample.scene.cameras:
            try:
                if camera.link:
                    simulator.body_pose(f"robot/{camera.link}")
            except KeyError:
                raise AssertionError(f"body_pose('robot/{camera.link}') is not known") from None


@rule
def unknown_names_are_key_errors(make: Make) -> None:
    """body_pose, joint_position and their kind raise KeyError for names that do not exist."""
    sample = _built(make)
    with sample.simulator as simulator:
        for read in (simulator.body_pose, simulator.body_velocity, simulator.joint_position, simulator.contacts):
            try:
                read("nothing")
            except KeyError:
                continue
            raise AssertionError(f"{read.__name__}('nothing') raised nothing")


@rule
def contacts_name_bodies_and_links(make: Make) -> None:
    """Contacts are between bodies of the scene, links of the robot (``robot/LINK``), ``table`` and ``floor``."""
    sample = _built(make)
    with sample.simulator as simulator:
        simulator.tick()
        known = {body.name for body, _ in sample.scene.walk()} | {"table", "floor"}
        named = {name for contact in simulator.contacts() for name in (contact.first, contact.second)}
        strange = sorted(name for name in named - known if not name.startswith("robot/"))
        assert not strange, f"contacts name {strange}"
        if any(isinstance(body.joint, Free) for body in sample.scene.bodies):
            assert named, "what can be carried touches nothing"


@rule
def continuing_after_restore_is_exact(make: Make) -> None:
    """After restore everything continues bit-exactly as after the checkpoint, also in a scene that was built again."""
    sample = _built(make)
    with sample.simulator as simulator:
        outset = simulator.checkpoint()
        after_outset = _history(sample)
        _bend(sample)
        for _ in range(20):
            simulator.tick()
        moving = simulator.checkpoint()
        assert isinstance(moving, bytes), f"a checkpoint is a {type(moving).__name__}"
        after_moving = _history(sample)
        for state, expected in ((moving, after_moving), (outset, after_outset), (moving, after_moving)):
            simulator.restore(state)
            _agree(_history(sample), expected, "continuation")
        simulator.build(sample.scene, sample.robot)
        simulator.restore(moving)
        _agree(_history(sample), after_moving, "continuation in a scene built again")


def _agree(got: list[tuple[object, ...]], expected: list[tuple[object, ...]], what: str) -> None:
    wrong = [tick for tick, (a, b) in enumerate(zip(got, expected, strict=True)) if a != b]
    assert not wrong, f"the {what} differs from tick {wrong[0]} on"


@rule
def foreign_checkpoints_are_refused(make: Make) -> None:
    """restore raises InvalidArgument for bytes that are no checkpoint of this scene, or a damaged one
    (``memo_core.scene.sealed_state``)."""
    sample = _built(make)
    with sample.simulator as simulator:
        own = simulator.checkpoint()
        middle = len(own) // 2
        changed = own[:middle] + bytes([own[middle] ^ 0xFF]) + own[middle + 1 :]
        for what, state in (("cut short", own[:-8]), ("with one changed byte", changed), ("of no kind", b"x" * 99)):
            try:
                simulator.restore(state)
            except InvalidArgument:
                continue
            raise AssertionError(f"a checkpoint {what} was accepted")


@rule
def the_same_commands_give_the_same_motion(make: Make) -> None:
    """Two simulators open at once, given the same scene and commands, agree bit by bit."""
    histories = []
    with contextlib.ExitStack() as both:
        for _ in range(2):
            sample = _built(make)
            both.enter_context(contextlib.closing(sample.simulator))
            _bend(sample)
            histories.append(_history(sample))
    _agree(histories[0], histories[1], "second simulator's motion")


@rule
def pictures_show_the_scene(make: Make) -> None:
    """Pictures have the promised shapes, segmentation names bodies, depth and segmentation agree on the background; or
    BackendUnavailable says what to install."""
    sample = _built(make)
    camera = sample.scene.cameras[0].name
    with sample.simulator as simulator:
        try:
            picture = simulator.render(camera, 160, 120)
        except BackendUnavailable as error:
            assert error.remedy, "BackendUnavailable without a remedy"
            return
        assert picture.shape == (120, 160, 3) and picture.dtype == np.uint8, f"{picture.dtype}, {picture.shape}"
        assert picture.std() > 5, "the picture is blank"
        depth = simulator.render_depth(camera, 160, 120)
        names_at, names = simulator.render_segmentation(camera, 160, 120)
        assert depth.shape == (120, 160) and depth.dtype == np.float32, f"depth is {depth.dtype}, {depth.shape}"
        assert names_at.shape == (120, 160) and names_at.dtype == np.int32, f"segmentation is {names_at.dtype}"
        seen = {names[index] for index in np.unique(names_at) if index >= 0}
        assert seen & {body.name for body, _ in sample.scene.walk()}, f"the segmentation shows {sorted(seen)}"
        assert np.array_equal(names_at == -1, np.isinf(depth)), "the background: -1 and inf"
        _bend(sample)
        for _ in range(30):
            simulator.tick()
        assert not np.array_equal(picture, simulator.render(camera, 160, 120)), "the arm moved, the picture did not"
        try:
            simulator.render("nowhere")
        except MemoError:
            return
        raise AssertionError("a camera that does not exist rendered")


@rule
def closing_twice_is_fine(make: Make) -> None:
    """close is idempotent, before open as well, and a closed simulator can be opened again."""
    simulator = make()
    try:
        simulator.close()
        for _ in range(2):
            simulator.open()
            simulator.build(*simulator.sample())
            simulator.tick()
            simulator.close()
            simulator.close()
    except MemoError as error:
        raise AssertionError(str(error)) from error
