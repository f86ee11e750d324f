"""The dynamic part of the conformance suite for robots: what a description does in a simulator, each failure with its
cause. ``memo plugins check`` runs these rules where the static ones (``memo_core.testing.robot``) hold.

A rule raises ``AssertionError`` with a diagnosis, or ``Limited`` where the description is right and the arm cannot do
everything. ``FOLLOWS``: rules whose failure says nothing new once another is broken.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np

from memo_core.arm.facing import facing
from memo_core.arm.finger_zero import fixed_to
from memo_core.robot.description import JointDescription
from memo_core.robot.hand_mount import sideways
from memo_core.robot.urdf.reading import link_poses
from memo_core.testing.robot_check.trial import RobotTrial, Tracked
from memo_core.testing.rules import Limited, Rules

RULES: Rules[Callable[[RobotTrial], None]] = Rules()
rule = RULES.rule
FOLLOWS: dict[str, tuple[str, ...]] = {
    "home_is_clear": ("the_hand_leads_out_of_the_arm",),
    "it_holds_home": ("home_is_clear",),
    "it_follows_a_motion": ("home_is_clear", "it_holds_home"),
    "home_is_no_singularity": ("the_tool_centre_is_between_the_pads",),
    "reach_is_what_the_arm_reaches": ("the_tool_centre_is_between_the_pads",),
    "the_hand_does_not_give_way": ("home_is_clear", "it_holds_home", "it_follows_a_motion"),
    "it_reaches_in_six_dimensions": (
        "the_hand_leads_out_of_the_arm",
        "the_tool_centre_is_between_the_pads",
        "it_faces_the_table",
        "home_is_no_singularity",
    ),
    "it_grasps_a_cube": (
        "the_hand_leads_out_of_the_arm",
        "home_is_clear",
        "the_tool_centre_is_between_the_pads",
        "it_holds_home",
        "it_follows_a_motion",
        "the_hand_does_not_give_way",
        "it_faces_the_table",
        "it_reaches_in_six_dimensions",
    ),
    "it_reaches_what_the_tasks_grasp": ("it_faces_the_table", "it_reaches_in_six_dimensions"),
}

MOST_LAG = 0.12  # s; a servo that lags more has not arrived when a motion is over
MOST_TRAILING = 0.12  # of a swing's amplitude, with the lag commanded ahead
MOST_RIPPLE = 0.05  # rad/s at rest
MOST_DRIFT = 0.02  # rad
MOST_GIVING = 0.008  # m under ``PRESS``
PRESS = 20.0  # N
_WEAK = 0.3  # of the usual gain, from which on a servo that does not follow counts as weak
SINGULAR = 0.005  # least singular value of the Jacobian, its translations in shares of the reach
LEAST_OF_REACH = 0.6  # of how far the tool gets
LEAST_REACH = 0.25  # share of the sampled hand poses
LEAST_TASKS = 0.8  # share of what the tasks grasp


@rule
def the_hand_leads_out_of_the_arm(trial: RobotTrial) -> None:
    """The hand's approach axis leads on where the arm ends, not sideways off its last joint."""
    robot = trial.robot
    found = sideways(trial.urdf, robot.joint_names, robot.tool_link, robot.tool_offset)
    if found is None:
        return
    rpy = " ".join(f"{value + 0.0:.4f}".rstrip("0").rstrip(".") for value in np.round(found.rpy, 4))
    right = f'in <joint name={found.mount!r}> write <origin rpy="{rpy}">'
    right += f" (mount=({rpy.replace(' ', ', ')}) of with_parallel_hand), so that it leads on from {found.flange!r}"
    if not found.mount:
        right = f"turn it in {found.flange!r}"
    raise Limited(
        f"the hand points sideways: its approach axis, the tool's z, is at {found.degrees:.0f} degrees to the axis of "
        f"the last joint {found.joint}, along which the arm leads out; {right}"
    )


@rule
def home_is_clear(trial: RobotTrial) -> None:
    """At home the robot touches neither the table nor itself."""
    tool = np.round(trial.kinematics.pose(trial.kinematics.home).position, 2) + 0.0  # no -0.00
    where = f"the tool is at x {tool[0]:.2f}, y {tool[1]:.2f}, z {tool[2]:.2f} m"
    hit = trial.home_hit
    assert hit is None, f"home is not clear: {hit} ({where}; the table's top is at z 0): choose another home"
    own = trial.shape.touching_at_home
    pairs = ", ".join(f"{one} and {other}" for one, other in own)
    assert not own, f"home is not clear: {pairs} touch each other: another home, slimmer shapes, or allowed_contacts"


@rule
def the_tool_centre_is_between_the_pads(trial: RobotTrial) -> None:
    """The tool centre lies between the fingertips and the palm, where the pads meet what they hold."""
    robot = trial.robot
    span = trial.shape.pad_span()
    pads = " and ".join(robot.gripper.pads)
    if span is None:
        shaped = {link for pad in robot.gripper.pads for link in fixed_to(trial.urdf, pad)} & set(trial.shape.corners())
        assert shaped or robot.gripper.kind != "parallel", (
            f"the pads {pads} have no collision shapes, so that they grip nothing: give each link a <collision>"
        )
        return
    low, high = span
    if not low < 0.0 < high:
        off, what = (-high, "beyond the fingertips") if high <= 0 else (low, "behind the pads, in the palm")
        reach = f"the pads reach from {1000 * low:+.0f} to {1000 * high:+.0f} mm along the tool's z"
        move = f"move tool_offset by {1000 * (high - 0.01):+.0f} mm along it"
        if off > 1.0:
            move = "tool_offset looks like millimetres, it is in m"
        raise AssertionError(f"the tool centre is {1000 * off:.0f} mm {what}: {reach}; {move}")
    stated = robot.gripper.fingertip_reach
    assert abs(high - stated) < 0.015, (
        f"the fingertips extend {1000 * high:.0f} mm beyond the tool centre, gripper.fingertip_reach says "
        f"{1000 * stated:.0f}: set it to {high:.3f}"
    )


@rule
def home_is_no_singularity(trial: RobotTrial) -> None:
    """No two joints that follow each other turn about one line, and at home the tool can be moved every way."""
    _no_joint_is_idle(trial)
    jacobian = np.array(trial.kinematics.jacobian(trial.kinematics.home))
    jacobian[:3] /= trial.robot.reach
    if jacobian.shape[1] < 6:
        return
    _, values, ways = np.linalg.svd(jacobian)
    if values[5] < SINGULAR:
        # Joints that cancel each other: what moves nothing, by the weakest direction and a seventh joint's freedom.
        still = ways[5]
        names = [joint.name for joint, part in zip(trial.robot.joints, still, strict=True) if abs(part) > 0.2]
        raise Limited(
            f"home is singular: {', '.join(names)} can move together without moving the tool, so that in one direction "
            "it cannot be moved from there; choose a home with the elbow and the wrist bent"
        )


@rule
def the_grip_is_within_the_fingers_effort(trial: RobotTrial) -> None:
    """``gripper.max_force`` is not more than twice what the URDF says of the sliding fingers together."""
    gripper = trial.robot.gripper
    joints = [trial.urdf.joint(name) for name in gripper.finger_joints]
    if gripper.kind != "parallel" or any(joint.kind != "prismatic" for joint in joints):
        return
    stated = [joint for joint in joints if 0 < joint.effort < math.inf]
    total = sum(joint.effort for joint in stated)
    if stated and gripper.max_force > 2 * total:
        efforts = ", ".join(f"{joint.name} {joint.effort:g} N" for joint in stated)
        raise Limited(f"gripper.max_force is {gripper.max_force:g} N, the URDF's effort of the fingers is {efforts}")


@rule
def reach_is_what_the_arm_reaches(trial: RobotTrial) -> None:
    """``reach`` is not much less than how far from the first joint the tool gets."""
    kinematics = trial.kinematics
    _, position = kinematics.forward(kinematics.samples(4096))
    far = float(np.linalg.norm(position - kinematics.shoulder[:, None], axis=0).max())
    if trial.robot.reach < LEAST_OF_REACH * far:
        raise Limited(
            f"reach is {trial.robot.reach:g} m, but the tool gets {far:.2f} m from the first joint: what is farther "
            f"than reach is refused at once; set it to about {0.97 * far:.2f}"
        )


@rule
def it_holds_home(trial: RobotTrial) -> None:
    """Left alone for a second, the arm stays at home and is still."""
    _bears_its_weight(trial)
    held = trial.held
    assert not held.problem, f"the simulator gave up at home: {held.problem}; {_hardest(trial)}"
    worst = int(np.argmax(held.drift**2 + held.ripple**2))
    joint, unit = trial.robot.joints[worst], trial.units[worst].position
    if held.ripple[worst] > MOST_RIPPLE:
        raise AssertionError(f"{joint.name} shakes at home by {held.ripple[worst]:.2g} {unit}/s: {_hard(trial, worst)}")
    if abs(held.drift[worst]) > MOST_DRIFT:
        pushed = "; ".join(f"{one} touches {other}" for one, other in held.touching[:2])
        why = f"pushed away ({pushed})" if pushed else _weak(trial, worst)
        raise AssertionError(f"{joint.name} leaves home by {held.drift[worst]:+.3f} {unit}: {why}")


@rule
def it_follows_a_motion(trial: RobotTrial) -> None:
    """Each joint follows a swing of 0.25 rad (a slide: m) at half of its speed and acceleration, then rests."""
    found = [_followed(trial, number, one) for number, one in enumerate(trial.tracked)]
    problems = [problem for problem in found if problem]
    assert not problems, "; ".join(_grouped(problems))


@rule
def the_hand_does_not_give_way(trial: RobotTrial) -> None:
    """Pressed down with 20 N at home, the hand gives way by less than 8 mm."""
    ways = trial.compliance
    total = PRESS * float(ways.sum())
    if total < 1e-9:  # no joint gives way downwards: the arm stands straight up
        return
    worst = int(np.argmax(ways))
    joint = trial.robot.joints[worst]
    part = f"{100 * PRESS * ways[worst] / total:.0f} % of it there"
    assert total < MOST_GIVING, (
        f"{joint.name}'s servo is weak: the hand gives way by {1000 * total:.0f} mm under {PRESS:.0f} N, {part}; "
        f"raise its kp from {joint.kp:g} to about {_usual(joint):g} {trial.units[worst].stiffness}"
    )


@rule
def it_faces_the_table(trial: RobotTrial) -> None:
    """It works ahead of its base (+x), where the tasks put things, and not mainly to another side."""
    faces = facing(trial.kinematics, trial.robot.reach)
    if faces.turn:
        raise Limited(f"{faces}; turn its base with base_rpy: [0, 0, {faces.turn:.4f}] (memo_core.robot.mounting)")


@rule
def it_reaches_in_six_dimensions(trial: RobotTrial) -> None:
    """Over the table in front of it the hand is put at many places in many directions."""
    _, _, share = trial.reach_map
    reached = float(share.mean())
    joints = len(trial.robot.joints)
    if joints < 6:
        raise Limited(
            f"it has {joints} joints: where the hand is decides which way it can point, so that of positions with an "
            f"orientation only those that suit it are reached ({100 * reached:.0f} % of {8 * share.size} hand poses)"
        )
    poses = f"{100 * reached:.1f} % of {8 * share.size} hand poses within {trial.robot.reach:.2f} m are reached"
    assert reached >= LEAST_REACH, f"only {poses}, fewer than {100 * LEAST_REACH:.0f} %: {_narrow(trial)}"


@rule
def it_grasps_a_cube(trial: RobotTrial) -> None:
    """It picks a cube up from the table, from above, and holds it for a second."""
    grasp = trial.grasp
    size = f"a cube of {1000 * grasp.size:.0f} mm"
    words = {"reach": f"{size} was not reached", "close": f"{size} was not gripped", "lift": f"{size} was not lifted"}
    assert not grasp.step, f"{words[grasp.step]}: {grasp.why}"


@rule
def it_reaches_what_the_tasks_grasp(trial: RobotTrial) -> None:
    """Most of what the default suite's tasks take hold of is reached, from above or from the front."""
    tasks = trial.task_reach
    total = sum(one.grasped for one in tasks)
    if not total:
        return
    missed = [(one.task, name) for one in tasks for name in one.unreached]
    share = 1.0 - len(missed) / total
    if share < LEAST_TASKS:
        some = ", ".join(f"the {name} of {task}" for task, name in missed[:3])
        problem = f"{len(missed)} of {total} things that the {len(tasks)} tasks grasp are out of reach ({some}, …)"
        raise Limited(
            f"{problem}: the tasks are laid out for an arm of 0.86 m, this one reaches {trial.robot.reach:.2f} m"
        )


# -- diagnoses ---------------------------------------------------------------------------------------------------------


def _no_joint_is_idle(trial: RobotTrial) -> None:
    """Raise for two turning joints, one behind the other, that turn about one line."""
    poses = link_poses(trial.urdf, dict(zip(trial.robot.joint_names, trial.robot.home, strict=True)))
    joints = [trial.urdf.joint(name) for name in trial.robot.joint_names]
    for one, other in itertools.pairwise(joints):
        if one.kind != "revolute" or other.kind != "revolute":
            continue
        first, second = (poses[joint.child].rotation @ np.array(joint.axis) for joint in (one, other))
        between = np.subtract(poses[other.child].position, poses[one.child].position)
        aside = float(np.linalg.norm(np.cross(first, between)))
        assert abs(float(first @ second)) < 1 - 1e-6 or aside > 1e-4, (
            f"{one.name} and {other.name} turn about one line, whatever the posture: the <axis> of one of them is wrong"
        )


def _bears_its_weight(trial: RobotTrial) -> None:
    """Raise for a joint whose torque does not hold the arm's weight at home."""
    weights = trial.weight_torques
    for number, joint in enumerate(trial.robot.joints):
        most, units = float(weights[number]), trial.units[number]
        assert joint.effort >= most, (
            f"{joint.name}'s effort of {joint.effort:g} {units.effort} does not hold the arm's weight, which is "
            f"{most:.0f} {units.effort} at home: the URDF's effort is too low, or masses are too large"
        )


def _followed(trial: RobotTrial, number: int, tracked: Tracked) -> tuple[str, str] | None:
    """(the cause in words that joints share, what is particular to this joint), or None."""
    joint, inertia = trial.robot.joints[number], float(trial.inertias[number])
    lag = joint.kv / joint.kp
    if tracked.problem or tracked.ripple > MOST_RIPPLE:
        return _hard(trial, number), joint.name
    if lag > MOST_LAG:
        cause = f"the servo lags {1000 * lag:.0f} ms behind its target, which is kv/kp: kv = kp / 10 lags 100 ms"
        return cause, f"{joint.name} (kv {joint.kv:g}, kp {joint.kp:g})"
    if tracked.error <= MOST_TRAILING * tracked.amplitude:
        return None
    units = trial.units[number]
    behind = f"{joint.name}, {tracked.error:.2f} {units.position} behind in a swing of {tracked.amplitude:.2f}"
    able = joint.effort / inertia
    if joint.kp < _WEAK * _usual(joint):
        return _weak(trial, number), behind
    if able < joint.acceleration:
        stated = f"{joint.effort:g} {units.effort} on {inertia:.2g} {units.inertia} are {able:.1f} {units.position}/s2"
        stated += f", not {joint.acceleration:g}"
        return f"the torque does not suffice for the stated acceleration: {stated}", behind
    return "something holds it back near home", behind


def _grouped(problems: list[tuple[str, str]]) -> list[str]:
    """One line a cause, however many joints have it."""
    found: dict[str, list[str]] = {}
    for cause, joint in problems:
        found.setdefault(cause, []).append(joint)
    return [f"{', '.join(joints)}: {cause}" for cause, joints in found.items()]


def _usual(joint: JointDescription) -> float:
    return round(min(4500.0, 160 * joint.effort))


def _weak(trial: RobotTrial, number: int) -> str:
    joint, inertia, units = trial.robot.joints[number], float(trial.inertias[number]), trial.units[number]
    rate = math.sqrt(joint.kp / inertia) / (2 * math.pi)
    gain = f"kp {joint.kp:g} {units.stiffness} on {inertia:.2g} {units.inertia} ({rate:.1f} Hz)"
    return f"the servo is weak, {gain}: about {_usual(joint):g} is usual"


def _hard(trial: RobotTrial, number: int) -> str:
    joint, inertia, units = trial.robot.joints[number], float(trial.inertias[number]), trial.units[number]
    damping = joint.kv / (2 * math.sqrt(joint.kp * inertia))
    if joint.kp < _WEAK * _usual(joint):
        return _weak(trial, number)
    if damping < 0.3 and joint.kp <= 3 * _usual(joint):
        return (
            f"the servo is hardly damped, kv {joint.kv:g} for kp {joint.kp:g} ({damping:.2f} of critical): kv = kp / 10"
        )
    if joint.kp > 3 * _usual(joint):
        gain = f"kp {joint.kp:g} {units.stiffness} with {joint.effort:g} {units.effort} at most"
        return f"the servo is too hard, {gain}: about {_usual(joint):g} is usual"
    return f"the servo does not come to rest (kp {joint.kp:g}, kv {joint.kv:g}, {inertia:.2g} {units.inertia})"


def _hardest(trial: RobotTrial) -> str:
    """Of the joint whose servo is hardest for its torque."""
    hardness = [joint.kp / joint.effort for joint in trial.robot.joints]
    number = int(np.argmax(hardness))
    return f"{trial.robot.joints[number].name}: {_hard(trial, number)}"


def _narrow(trial: RobotTrial) -> str:
    """The turning joint with the narrowest limits."""
    joints = zip(trial.robot.joints, trial.units, strict=True)
    turning = [joint for joint, units in joints if units.position == "rad"] or trial.robot.joints
    joint = min(turning, key=lambda one: one.upper - one.lower)
    return f"the narrowest limits are those of {joint.name}, {joint.lower:.2f} to {joint.upper:.2f} rad"
