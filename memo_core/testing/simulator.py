"""Conformance suite for simulators.

``check_simulator(make)`` runs every rule and raises ``AssertionError`` naming the promise that is broken; ``make``
returns a new, unopened simulator. ``RULES`` maps a rule's name to its check, for parametrised tests. The suite brings a
robot of its own, so that a simulator is checked without any robot plugin.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import attrs
import numpy as np

from memo_core.errors import BackendUnavailable, InvalidArgument, MemoError
from memo_core.interfaces.simulator import Simulator
from memo_core.scene.description import Body, Camera, Free, Geom, Material, SceneDescription
from memo_core.scene.pose import Pose
from memo_core.testing.rules import Rules
from memo_core.testing.simulator_scenes import (
    CUBE,
    DROP,
    REACH,
    check_robot,
    check_scene,
    mechanism_scene,
    tool_position,
)

Make = Callable[[], Simulator]
RULES: Rules[Callable[[Make], None]] = Rules()
rule = RULES.rule


def check_simulator(make: Make) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken."""
    for name, check in RULES.items():
        try:
            check(make)
        except AssertionError as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error


def _built(make: Make, **changes: object) -> Simulator:
    simulator = make()
    simulator.open()
    simulator.build(check_scene(**changes), check_robot())
    return simulator


def _run(simulator: Simulator, seconds: float) -> None:
    for _ in range(round(seconds / simulator.control_period)):
        simulator.tick()


def _state(simulator: Simulator) -> tuple[object, ...]:
    """Everything a client can read of the state, for exact comparison."""
    poses = tuple(simulator.body_pose(name) for name in ("cube", "ball", "door", "drawer"))
    return (
        simulator.time,
        tuple(simulator.joint_positions()),
        tuple(simulator.joint_velocities()),
        simulator.gripper_width(),
        poses,
        simulator.joint_position("hinge"),
    )


@rule
def starts_at_home(make: Make) -> None:
    """After build: time 0, arm at home, gripper open, scene joints at their initial positions; also built again."""
    with make() as simulator:
        for _ in range(2):
            simulator.build(check_scene(), check_robot())
            assert simulator.time == 0.0, f"time is {simulator.time}"
            assert np.allclose(simulator.joint_positions(), (0, 0, 0), atol=1e-6), (
                f"arm at {simulator.joint_positions()}"
            )
            assert abs(simulator.gripper_width() - 0.08) < 0.001, f"gripper at {simulator.gripper_width()} m"
            assert abs(simulator.joint_position("rail") - 0.02) < 1e-6, f"rail at {simulator.joint_position('rail')} m"
            _run(simulator, 0.05)


@rule
def ticks_are_control_periods(make: Make) -> None:
    """A tick takes control_period (at most 10 ms), then calls each listener once; removed ones no more."""
    with make() as simulator:
        simulator.build(check_scene(), check_robot())
        seen: list[float] = []
        other: list[float] = []

        def listen() -> None:
            seen.append(simulator.time)

        def listen_too() -> None:
            other.append(simulator.time)

        simulator.add_tick_listener(listen)
        simulator.add_tick_listener(listen_too)
        assert simulator.control_period <= 0.010001, f"control period {simulator.control_period} s"
        _run(simulator, 3 * simulator.control_period)
        simulator.remove_tick_listener(listen)
        simulator.tick()
        expected = [simulator.control_period * n for n in (1, 2, 3)]
        assert len(seen) == 3 and np.allclose(seen, expected), f"a listener was called at {seen}, expected {expected}"
        assert len(other) == 4, f"the other listener was called {len(other)} times in 4 ticks"


@rule
def returned_arrays_are_copies(make: Make) -> None:
    """Writing into a returned array changes nothing, and an array does not change when time goes on."""
    with make() as simulator:
        simulator.build(check_scene(), check_robot())
        simulator.command_joints(np.array([0.5, 0.0, 0.0]))
        reading = (simulator.joint_positions, simulator.joint_velocities)
        for read in (*reading, simulator.joint_torques, simulator.joint_accelerations):
            values = read()
            assert values.shape == (3,), f"{read.__name__} has shape {values.shape}"
            before = values.copy()
            _run(simulator, 0.1)
            assert np.array_equal(values, before), f"what {read.__name__} returned changed afterwards"
            values[:] = 9.0
            assert not np.array_equal(read(), values), f"writing into what {read.__name__} returned changed the robot"


@rule
def arm_follows_targets(make: Make) -> None:
    """Targets take effect with the next tick, are held until changed, and are reached and kept against gravity."""
    with make() as simulator:
        simulator.build(check_scene(), check_robot())
        for target in ([0.4, -0.3, 0.2], [-0.2, -0.5, 0.5]):
            before = simulator.joint_positions()
            simulator.command_joints(np.array(target))
            assert np.array_equal(simulator.joint_positions(), before), "the arm moved before a tick"
            _run(simulator, 2.0)
            error = np.abs(simulator.joint_positions() - target).max()
            assert error < 0.01, f"{error:.3f} rad from the target after 2 s"
        assert np.abs(simulator.joint_velocities()).max() < 0.01, "the arm does not come to rest"


@rule
def refuses_non_finite_targets(make: Make) -> None:
    """Targets that are not finite are refused with InvalidArgument and change nothing."""
    with make() as simulator:
        simulator.build(check_scene(), check_robot())
        try:
            simulator.command_joints(np.array([0.0, math.nan, 0.0]))
        except InvalidArgument:
            _run(simulator, 0.1)
            assert np.abs(simulator.joint_positions()).max() < 0.01, "the arm moved all the same"
        else:
            raise AssertionError("nan was accepted")


@rule
def tool_pose_is_that_of_the_kinematics(make: Make) -> None:
    """tool_pose agrees with the URDF's kinematics at the joint positions read at the same time, also in motion."""
    with make() as simulator:
        simulator.build(check_scene(), check_robot())
        simulator.command_joints(np.array([0.6, -0.4, 0.3]))
        for _ in range(40):
            simulator.tick()
            error = np.linalg.norm(simulator.tool_pose().position - tool_position(simulator.joint_positions()))
            assert error < 1e-4, f"the tool is {error * 1000:.2f} mm from where the joints put it"
        approach = simulator.tool_pose().rotation[:, 2]
        assert approach[2] < -0.9, f"the approach axis points to {approach}"


@rule
def bodies_rest_on_the_table(make: Make) -> None:
    """What stands on the table stays there; contacts name both bodies and carry its weight."""
    with make() as simulator:
        simulator.build(check_scene(), check_robot())
        _run(simulator, 0.5)
        position = np.array(simulator.body_pose("cube").position)
        assert np.allclose(position, (REACH, 0, CUBE / 2), atol=0.001), f"the cube went to {position}"
        contacts = simulator.contacts("cube")
        names = {frozenset((contact.first, contact.second)) for contact in contacts}
        assert names == {frozenset(("cube", "table"))}, f"its contacts are {sorted(map(sorted, names))}"
        force = sum(contact.force for contact in contacts)
        assert abs(force - 0.2 * 9.81) < 0.2, f"they carry {force:.2f} N of {0.2 * 9.81:.2f} N"
        assert all(abs(contact.position[2]) < 0.002 for contact in contacts), "they are not on the table's top"


@rule
def bodies_fall_by_gravity(make: Make) -> None:
    """A free body falls by half g t squared, g as the scene says; body_velocity tells g t."""
    for gravity in (9.81, 1.62):
        simulator = _built(make, gravity=gravity)
        with simulator:
            _run(simulator, 0.2)
            fallen = 0.5 - simulator.body_pose("ball").position[2]
            assert abs(fallen - gravity * 0.02) < 0.05 * gravity * 0.02, f"{fallen:.4f} m in 0.2 s at g = {gravity}"
            linear, angular = simulator.body_velocity("ball")
            assert np.allclose(linear, (0, 0, -0.2 * gravity), atol=0.03), f"velocity {linear} at g = {gravity}"
            assert np.abs(angular).max() < 0.01, f"angular velocity {angular}"


@rule
def the_larger_friction_holds(make: Make) -> None:
    """Where two surfaces meet, the larger friction of the two holds; each shape of a body has its own."""
    tilt = Pose((0.0, -0.6, 0.3), (math.cos(0.225), 0.0, math.sin(0.225), 0.0))  # tan is 0.48
    halves = tuple(
        Geom("box", (0.6, 0.15, 0.02), Pose((0.0, y, 0.0)), material=Material(friction=friction))
        for y, friction in ((-0.08, 0.8), (0.08, 0.2))
    )
    cases = {("rough", 0.08, 0.8): True, ("smooth", -0.08, 0.2): True, ("slippery", 0.08, 0.2): False}
    blocks, starts = [], {}
    for name, y, friction in cases:
        starts[name] = tilt * Pose((0.1 if name == "slippery" else -0.1, y, 0.0301))
        geom = Geom("box", (0.04, 0.04, 0.04), material=Material(friction=friction))
        blocks.append(Body(name, (geom,), starts[name], Free(), mass=0.2))
    with make() as simulator:
        simulator.build(SceneDescription((Body("ramp", halves, tilt), *blocks)), check_robot())
        _run(simulator, 0.6)
        for (name, _, friction), holds in cases.items():
            moved = math.dist(simulator.body_pose(name).position, starts[name].position)
            on = 0.2 if name != "smooth" else 0.8
            expected = "it to stay" if holds else "it to slide"
            assert (moved < 0.01) == holds, f"friction {friction} on {on}: moved {moved:.3f} m, expected {expected}"


@rule
def pads_grip_as_both_surfaces_allow(make: Make) -> None:
    """Between pad and object the friction is ``GripperDescription.friction_on``: a slippery object slides out of rough
    pads, and any object out of slippery ones."""
    needed = 0.2 * 9.81 / 2 / 10.0  # two pads that press with 10 N each lift 0.2 kg
    for pad, surface in ((1.0, 0.8), (0.05, 0.8), (1.0, 0.0001), (0.4, 0.4), (0.2, 0.2), (2.0, 0.08)):
        robot = check_robot()
        gripper = attrs.evolve(robot.gripper, pad_friction=pad)
        with make() as simulator:
            simulator.build(_with_cube_of(surface), attrs.evolve(robot, gripper=gripper))
            _lift(simulator, 10.0)
            height = simulator.body_pose("cube").position[2]
        holds = gripper.friction_on(surface) > needed
        expected = "it to be lifted" if holds else "it to stay on the table"
        assert (height > 0.04) == holds, (
            f"an object of friction {surface} between pads of {pad}: at {height:.3f} m, expected {expected}"
        )


def _with_cube_of(friction: float) -> SceneDescription:
    scene = check_scene()
    cube, *others = scene.bodies
    geoms = tuple(attrs.evolve(geom, material=Material(friction=friction)) for geom in cube.geoms)
    return attrs.evolve(scene, bodies=(attrs.evolve(cube, geoms=geoms), *others))


@rule
def springs_and_catches_hold(make: Make) -> None:
    """Springs pull joints to their rest position; a catch holds against less than its effort and gives way to more."""
    for effort, opens in ((3.0, False), (0.3, True)):
        simulator = _built(make, catch=effort)
        with simulator:
            _run(simulator, 4.0)
            angle = simulator.joint_position("hinge")
            expected = "opened" if opens else "held"
            assert (angle > 0.8) == opens, (
                f"catch of {effort} Nm against 1 Nm: at {angle:.3f} rad, expected it {expected}"
            )
            # The drawer's own weight stretches its spring: 0.5 kg on 200 N/m.
            height = simulator.joint_position("rail")
            assert abs(height - (0.05 - 0.5 * 9.81 / 200)) < 0.003, f"rail came to {height:.4f} m"
            at = simulator.body_pose("knob").position
            expected_at = np.array([0.7 + 0.2 * math.cos(angle), -0.5 + 0.2 * math.sin(angle), 0.3])
            assert np.allclose(at, expected_at, atol=0.001), f"the knob is at {at}, its hinge puts it at {expected_at}"


@rule
def mechanisms_lock_and_release(make: Make) -> None:
    """A lock holds its joint until its condition on joints and time is met, not before and not after; springs change
    when theirs is met; a lock engages again where its joint then is."""
    with make() as simulator:
        simulator.build(mechanism_scene(), check_robot())
        risen = released = None
        furthest = 0.0
        for _ in range(400):
            before = simulator.joint_position("hinge")
            simulator.tick()
            if risen is None and simulator.joint_position("rail") > 0.0235:
                risen = simulator.time
            if released is None and simulator.joint_position("hinge") > 0.01:
                released = simulator.time
            if released is None:
                assert abs(before) < 0.003, f"locked, the hinge moved to {before:.4f} rad"
            furthest = max(furthest, simulator.joint_position("hinge"))
        assert risen is not None, "the drawer never rose"
        assert released is not None, "the lock never let go"
        waited = released - risen
        assert 0.5 <= waited < 0.8, f"the lock let go {waited:.2f} s after the drawer had risen, not after 0.5 s"
        assert furthest > 0.6, f"the door came to {furthest:.2f} rad only"
        angle = simulator.joint_position("hinge")
        assert 0.27 < angle < 0.33, f"drawn back, the door stands at {angle:.3f} rad, not where it is locked again"
        assert simulator.mechanisms.engaged == {"bolt": False, "stop": True, "clamp": False}, (
            f"locks: {simulator.mechanisms.engaged}"
        )


@rule
def mechanisms_feel_what_the_robot_presses(make: Make) -> None:
    """Conditions on force see the robot's presses, each once, however long it lasts."""
    with make() as simulator:
        simulator.build(mechanism_scene(), check_robot())
        for presses in (1, 2):
            simulator.command_gripper(0.0, 40.0)
            _run(simulator, 1.0)
            simulator.command_gripper(0.08, 40.0)
            _run(simulator, 0.8)
            pulled = simulator.joint_position("rail") < 0.01
            assert pulled == (presses == 2), (
                f"after {presses} presses the rail is at {simulator.joint_position('rail')}"
            )


@rule
def mechanisms_are_in_checkpoints(make: Make) -> None:
    """Restoring resets locks, springs, counts and clocks, and everything continues bit-exactly."""
    with make() as simulator:
        simulator.build(mechanism_scene(), check_robot())
        simulator.command_gripper(0.0, 40.0)
        _run(simulator, 0.5)
        waiting = simulator.checkpoint()
        after_waiting = _history(simulator)
        simulator.command_gripper(0.08, 40.0)
        _run(simulator, 1.0)
        counted = simulator.checkpoint()
        simulator.command_gripper(0.0, 40.0)
        after_counting = _history(simulator, 150)
        _run(simulator, 1.0)
        for state, expected in ((waiting, after_waiting), (counted, after_counting)):
            simulator.restore(state)
            if state is counted:
                simulator.command_gripper(0.0, 40.0)
            got = _history(simulator, len(expected) - 1)
            wrong = [tick for tick, (a, b) in enumerate(zip(got, expected, strict=True)) if a != b]
            assert not wrong, f"the continuation differs from tick {wrong[0]} on"


@rule
def joints_keep_their_range(make: Make) -> None:
    """A scene joint does not leave its range by more than a hundredth of it."""
    simulator = _built(make, catch=0.01)
    with simulator:
        largest = 0.0
        for _ in range(500):
            simulator.tick()
            largest = max(largest, simulator.joint_position("hinge"))
        assert 0.9 < largest < 1.01, f"pushed open, the hinge came to {largest:.3f} rad of 1"


@rule
def unknown_names_are_key_errors(make: Make) -> None:
    """body_pose, joint_position and their kind raise KeyError for names that do not exist."""
    simulator = _built(make)
    with simulator:
        for read in (simulator.body_pose, simulator.body_velocity, simulator.joint_position, simulator.contacts):
            try:
                read("nothing")
            except KeyError:
                continue
            raise AssertionError(f"{read.__name__}('nothing') raised nothing")


@rule
def gripper_holds_with_force(make: Make) -> None:
    """Closing stops at what is between the fingers, effort is the commanded force; closed on nothing it is 0."""
    for force in (20.0, 60.0):
        simulator = _built(make)
        with simulator:
            simulator.command_gripper(0.0, force)
            _run(simulator, 1.2)
            width, effort = simulator.gripper_width(), simulator.gripper_effort()
            assert abs(width - CUBE) < 0.003, f"width {width:.4f} m on a cube of {CUBE} m"
            assert abs(effort - force) < 0.2 * force, f"effort {effort:.1f} N, commanded {force} N"
            touching = {contact.first for contact in simulator.contacts("cube")}
            touching |= {contact.second for contact in simulator.contacts("cube")}
            assert {"robot/left", "robot/right"} <= touching, f"the cube's contacts are {sorted(touching)}"
            simulator.command_gripper(0.08, force)
            _run(simulator, 1.0)
            assert simulator.gripper_effort() == 0.0, "effort although the gripper is open"
            assert simulator.gripper_width() > 0.078, f"opened to {simulator.gripper_width():.4f} m only"
            simulator.command_joints(np.array([0.8, 0.0, 0.0]))
            simulator.command_gripper(0.0, force)
            _run(simulator, 2.0)
            assert simulator.gripper_effort() == 0.0, f"effort {simulator.gripper_effort():.1f} N on nothing"
            assert simulator.gripper_width() < 0.003, f"closed to {simulator.gripper_width():.4f} m only"


@rule
def gripper_keeps_its_speed(make: Make) -> None:
    """The opening changes at about the gripper's speed, whatever the force."""
    simulator = _built(make)
    with simulator:
        simulator.command_joints(np.array([0.8, 0.0, 0.0]))
        simulator.command_gripper(0.0, 80.0)
        _run(simulator, 0.4)
        width = simulator.gripper_width()
        assert 0.02 < width < 0.06, f"after 0.4 s at 0.1 m/s the opening is {width:.4f} m, of 0.08 at the start"


@rule
def a_grip_is_let_go_at_once(make: Make) -> None:
    """Told to open, a gripper that holds something begins to open at once, and goes to just the width it is told."""
    simulator = _built(make)
    with simulator:
        simulator.command_gripper(0.0, 60.0)
        _run(simulator, 1.5)
        simulator.command_gripper(CUBE + 0.02, 60.0)
        _run(simulator, 0.1)
        width = simulator.gripper_width()
        assert width > CUBE + 0.002, f"0.1 s after the command the opening is {width:.4f} m, the cube {CUBE} m"
        _run(simulator, 1.0)
        width = simulator.gripper_width()
        assert abs(width - CUBE - 0.02) < 0.002, f"told {CUBE + 0.02} m, the opening is {width:.4f} m"


@rule
def fingers_go_where_they_were_sent_once_free(make: Make) -> None:
    """Sent to an opening narrower than what is held, the fingers go there once it slips out of them."""
    robot = check_robot()
    with make() as simulator:
        simulator.build(check_scene(), attrs.evolve(robot, gripper=attrs.evolve(robot.gripper, pad_friction=0.05)))
        simulator.command_gripper(0.0, 10.0)
        _run(simulator, 1.0)
        _lift(simulator, 10.0, CUBE - 0.01)
        _run(simulator, 1.0)
        assert simulator.body_pose("cube").position[2] < 0.04, "a slippery grip lifted the cube"
        width = simulator.gripper_width()
        assert abs(width - CUBE + 0.01) < 0.002, f"sent to {CUBE - 0.01:.3f} m, the opening is {width:.4f} m"


@rule
def a_held_object_is_lifted(make: Make) -> None:
    """What the fingers press is carried along and stays in the hand."""
    simulator = _built(make)
    with simulator:
        _lift(simulator)
        _run(simulator, 3.0)
        offset = np.array(simulator.body_pose("cube").position) - simulator.tool_pose().position
        assert np.linalg.norm(offset) < 0.02, f"the cube is {np.linalg.norm(offset):.3f} m from the tool centre"
        assert simulator.body_pose("cube").position[2] > 0.1, "the cube was not lifted"


def _lift(simulator: Simulator, force: float = 60.0, width: float = 0.0) -> None:
    simulator.command_gripper(width, force)
    _run(simulator, 1.0)
    for step in range(1, 101):
        angle = 0.3 * step / 100
        simulator.command_joints(np.array([0.0, -angle, angle]))
        simulator.tick()


@rule
def torques_carry_the_arm_and_its_load(make: Make) -> None:
    """At rest joint_torques hold up the arm itself and what it carries: from them is estimated what the hand feels."""
    simulator = _built(make)
    with simulator:
        _run(simulator, 0.5)
        for what, load in (("nothing", 0.0), ("the cube", 0.2)):
            torque = float(simulator.joint_torques()[1])
            _, shoulder, elbow = simulator.joint_positions()
            out = REACH * math.cos(shoulder)
            tool = out - DROP * math.sin(shoulder + elbow)
            carried = -9.81 * (1.0 * out + 0.2 * tool + load * tool)
            assert abs(torque - carried) < 0.15, f"carrying {what}, the shoulder pulls {torque:.2f} Nm of {carried:.2f}"
            at_rest = np.abs(simulator.joint_accelerations()).max()
            assert at_rest < 0.1, f"at rest, an acceleration of {at_rest:.2f} rad/s2"
            if load == 0.0:
                _lift(simulator)
                _run(simulator, 3.0)


@rule
def torques_go_with_accelerations(make: Make) -> None:
    """joint_accelerations are those that joint_torques make: in free motion torque is inertia times acceleration."""
    with make() as simulator:
        simulator.build(check_scene(), check_robot())
        _lift_hand(simulator)
        hand = 1.2 * REACH**2 + 0.01 * 3  # kg m2 about the column, fingers included
        inertia = hand + check_robot().joints[0].armature
        torques, products = [], []
        for number in range(30):
            simulator.command_joints(np.array([0.004 * number, *simulator.joint_positions()[1:]]))
            simulator.tick()
            torques.append(float(simulator.joint_torques()[0]))
            products.append(inertia * float(simulator.joint_accelerations()[0]))
        most = float(np.abs(torques).max())
        off = float(np.abs(np.array(torques) - products).max())
        assert off < 0.1 * most, f"torque and inertia times acceleration differ by {off:.2f} Nm of {most:.2f}"


def _lift_hand(simulator: Simulator) -> None:
    """Clear of the cube, so that nothing is touched."""
    simulator.command_gripper(0.08, 60.0)
    for step in range(1, 101):
        simulator.command_joints(np.array([0.0, -0.003 * step, 0.003 * step]))
        simulator.tick()
    _run(simulator, 1.0)


@rule
def continuing_after_restore_is_exact(make: Make) -> None:
    """After restore everything continues bit-exactly as after the checkpoint, targets and gripper included, any number
    of times, from any state."""
    simulator = _built(make)
    with simulator:
        # At the outset, and in the middle of closing, of lifting, and of a fall: targets are on their way.
        outset = simulator.checkpoint()
        after_outset = _history(simulator)
        simulator.command_gripper(0.0, 40.0)
        _run(simulator, 0.3)
        closing = simulator.checkpoint()
        assert isinstance(closing, bytes), f"a checkpoint is a {type(closing).__name__}"
        after_closing = _history(simulator)
        _lift(simulator)
        lifted = simulator.checkpoint()
        felt = (simulator.contacts(), *simulator.joint_torques(), *simulator.joint_accelerations())
        after_lifting = _history(simulator)
        simulator.command_gripper(0.08, 10.0)
        simulator.command_joints(np.zeros(3))
        _run(simulator, 0.5)
        for state, expected in (
            (closing, after_closing),
            (lifted, after_lifting),
            (outset, after_outset),
            (closing, after_closing),
        ):
            simulator.restore(state)
            if state is lifted:
                again = (simulator.contacts(), *simulator.joint_torques(), *simulator.joint_accelerations())
                assert again == felt, "contacts, torques or accelerations read right after the restore differ"
            got = _history(simulator)
            wrong = [tick for tick, (a, b) in enumerate(zip(got, expected, strict=True)) if a != b]
            assert not wrong, f"the continuation differs from tick {wrong[0]} on"


def _history(simulator: Simulator, ticks: int = 60) -> list[tuple[object, ...]]:
    states = [_state(simulator)]
    for _ in range(ticks):
        simulator.tick()
        states.append(_state(simulator))
    return states


@rule
def foreign_checkpoints_are_refused(make: Make) -> None:
    """restore raises InvalidArgument for bytes that are no checkpoint of this scene and robot, or a damaged one
    (``memo_core.scene.sealed_state``)."""
    simulator = _built(make)
    with simulator:
        other = simulator.checkpoint()
        simulator.build(check_scene(cube=0.05), check_robot())
        own = simulator.checkpoint()
        middle = len(own) // 2
        for what, state in (
            ("of another scene", other),
            ("cut short", own[:-8]),
            ("with one changed byte", own[:middle] + bytes([own[middle] ^ 0xFF]) + own[middle + 1 :]),
            ("of no kind", b"x" * 99),
        ):
            try:
                simulator.restore(state)
            except InvalidArgument:
                continue
            raise AssertionError(f"a checkpoint {what} was accepted")


@rule
def the_same_commands_give_the_same_motion(make: Make) -> None:
    """Two simulators given the same scene and commands agree bit by bit."""
    histories = []
    for _ in range(2):
        simulator = _built(make)
        with simulator:
            simulator.command_joints(np.array([0.1, -0.2, 0.3]))
            simulator.command_gripper(0.0, 30.0)
            histories.append(_history(simulator))
    assert histories[0] == histories[1], "they differ"


@rule
def pictures_show_the_scene(make: Make) -> None:
    """Pictures have the promised shapes; depth is metres, segmentation names bodies; or BackendUnavailable says what to
    install."""
    simulator = _built(make)
    with simulator:
        try:
            picture = simulator.render("above")
        except BackendUnavailable as error:
            assert error.remedy, "BackendUnavailable without a remedy"
            return
        assert picture.shape == (120, 160, 3) and picture.dtype == np.uint8, f"{picture.dtype}, {picture.shape}"
        assert picture.std() > 5, "the picture is blank"
        assert simulator.render("above", 64, 48).shape == (48, 64, 3), "width and height are not obeyed"
        depth = simulator.render_depth("above")
        names_at, names = simulator.render_segmentation("above")
        assert depth.shape == (120, 160) and depth.dtype == np.float32, f"depth is {depth.dtype}, {depth.shape}"
        assert names_at.shape == (120, 160) and names_at.dtype == np.int32, f"segmentation is {names_at.dtype}"
        seen = {names[index] for index in np.unique(names_at) if index >= 0}
        assert {"cube", "table", "robot/hand"} <= seen, f"the segmentation shows {sorted(seen)}"
        cube = names_at == list(names).index("cube")
        points = _points(depth, cube, check_scene().cameras[0])
        off = float(np.abs(points - np.array((REACH, 0, CUBE / 2))).max())
        assert len(points) > 50 and off < CUBE / 2 + 0.006, (
            f"by depth and segmentation the cube reaches {off:.3f} m out"
        )
        assert abs(points.max(axis=0)[0] - REACH - CUBE / 2) < 0.006, "the cube's side towards the camera is elsewhere"
        sky = simulator.render_segmentation("away")[0] == -1
        assert sky.any() and np.array_equal(sky, np.isinf(simulator.render_depth("away"))), "nothing there: -1 and inf"
        simulator.command_joints(np.array([0.3, -0.3, 0.0]))
        _run(simulator, 0.5)
        assert not np.array_equal(picture, simulator.render("above")), "the arm moved, the picture did not"
        try:
            simulator.render("nowhere")
        except MemoError:
            return
        raise AssertionError("a camera that does not exist rendered")


def _points(depth: np.ndarray, where: np.ndarray, camera: Camera) -> np.ndarray:
    """Points (n, 3) in the base frame that a depth picture shows where ``where`` is true."""
    height, width = depth.shape
    focal = height / 2 / math.tan(camera.field_of_view / 2)
    rows, columns = np.nonzero(where)
    along = depth[rows, columns].astype(float)
    x = (columns + 0.5 - width / 2) / focal * along
    y = (rows + 0.5 - height / 2) / focal * along
    return camera.pose.apply(np.column_stack([x, y, along]))


@rule
def closing_twice_is_fine(make: Make) -> None:
    """close is idempotent, before open as well, and a closed simulator can be opened again."""
    simulator = make()
    try:
        simulator.close()
        for _ in range(2):
            simulator.open()
            simulator.build(check_scene(), check_robot())
            simulator.tick()
            simulator.close()
            simulator.close()
    except MemoError as error:
        raise AssertionError(str(error)) from error
