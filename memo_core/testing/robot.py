"""Conformance suite for robot descriptions.

``check_robot_description(make)`` runs every rule and raises ``AssertionError`` naming the promise that is broken;
``make`` returns the description. ``RULES`` maps a rule's name to its check, ``wrong_robots`` makes one wrong
description a rule from a right one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from typing import Any

import attrs
import numpy as np

from memo_core.errors import InvalidArgument, close_match
from memo_core.robot.description import RobotDescription
from memo_core.robot.finger_linkage import FingerLinkage
from memo_core.robot.urdf.reading import Urdf, link_poses, read_urdf
from memo_core.robot.urdf.units import check_units
from memo_core.scene.pose import Pose, quaternion_from_axis_angle
from memo_core.testing.rules import Rules

Make = Callable[[], RobotDescription]
RULES: Rules[Callable[[Make], None]] = Rules()
rule = RULES.rule
# Rules whose failure says nothing new once another one is broken.
FOLLOWS: dict[str, tuple[str, ...]] = {
    "limits_are_possible": ("the_arm_is_one_chain",),
    "home_is_within_the_limits": ("limits_are_possible",),
    "the_gripper_opens_by_its_stroke": ("every_moving_joint_is_described",),
    "the_tool_frame_sits_between_the_fingers": ("every_moving_joint_is_described", "the_gripper_opens_by_its_stroke"),
    "it_may_press_with_some_force": ("the_arm_is_one_chain", "limits_are_possible", "home_is_within_the_limits"),
    "the_reach_is_that_of_the_links": ("the_arm_is_one_chain",),
}


def check_robot_description(make: Make) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken."""
    for name, check in RULES.items():
        try:
            check(make)
        except AssertionError as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error


def _read(robot: RobotDescription) -> Urdf:
    try:
        return read_urdf(robot.urdf, robot.mesh_folder)
    except InvalidArgument as error:
        raise AssertionError(str(error)) from error


def _linkage(robot: RobotDescription, urdf: Urdf) -> FingerLinkage:
    try:
        return FingerLinkage(urdf, robot.gripper)
    except InvalidArgument as error:
        raise AssertionError(str(error)) from error


def _carried(urdf: Urdf, joints: Sequence[str]) -> list[str]:
    """Links that these joints move."""
    links: list[str] = []
    for joint in urdf.joints:  # parents come before their children
        if joint.name in joints or joint.parent in links:
            links.append(joint.child)
    return links


def _tool(robot: RobotDescription, urdf: Urdf) -> Pose:
    """The tool frame in the base frame at home, fingers closed."""
    home = dict(zip(robot.joint_names, robot.home, strict=True))
    return link_poses(urdf, home)[robot.tool_link] * robot.tool_offset


@rule
def names_are_those_of_the_urdf(make: Make) -> None:
    """The URDF is a tree, and all joints and links that the description names are in it."""
    robot = make()
    urdf = _read(robot)
    joints = {joint.name: joint for joint in urdf.joints}
    for name in (*robot.joint_names, *robot.gripper.finger_joints):
        assert name in joints, f"no joint {name!r}{close_match(name, joints)}"
        assert joints[name].kind != "fixed", f"{name!r} is fixed"
    links = (*robot.gripper.pads, robot.tool_link, *(link for pair in robot.allowed_contacts for link in pair))
    for name in links:
        assert name in urdf.links, f"no link {name!r}{close_match(name, urdf.links)}"


@rule
def the_urdf_is_in_rad_m_and_kg(make: Make) -> None:
    """Joints state limits, and no number of the URDF looks as if in degrees, millimetres or grams."""
    robot = make()
    try:
        check_units(robot.urdf, _read(robot), robot.gripper.finger_joints)
    except InvalidArgument as error:
        raise AssertionError(str(error)) from error


@rule
def every_moving_joint_is_described(make: Make) -> None:
    """No joint of the URDF moves without being an arm or finger joint of the description."""
    robot = make()
    driven = {*robot.joint_names, *robot.gripper.finger_joints}
    loose = [joint for joint in _read(robot).joints if joint.kind != "fixed" and joint.name not in driven]
    following = [f"{joint.name} (mimics {joint.mimic.joint})" for joint in loose if joint.mimic is not None]
    assert not following, f"joints that mimic a finger belong in gripper.finger_joints too: {', '.join(following)}"
    assert not loose, f"nothing drives {', '.join(joint.name for joint in loose)}"


@rule
def the_arm_is_one_chain(make: Make) -> None:
    """The joints stand in the order from the base to the tool, one after the other."""
    robot = make()
    urdf = _read(robot)
    above = {joint.child: joint for joint in urdf.joints}
    chain = []
    link = robot.tool_link
    while link in above:
        if above[link].kind != "fixed":
            chain.append(above[link].name)
        link = above[link].parent
    right, given = tuple(reversed(chain)), robot.joint_names
    off = [(one, other) for one, other in zip(given, right, strict=False) if one != other]
    swapped = len(given) == len(right) and len(off) == 2 and off[0] == off[1][::-1]
    which = f"{off[0][1]} and {off[0][0]} are swapped; " if swapped else ""
    assert right == given, f"{which}from the base to the tool: {', '.join(right)}"


@rule
def limits_are_possible(make: Make) -> None:
    """Limits are ordered, within the URDF's, and gains, speeds and efforts are above 0."""
    robot = make()
    urdf = _read(robot)
    for joint in robot.joints:
        if math.isinf(joint.lower) or math.isinf(joint.upper):
            wanted = "state what it is to be planned within, such as -6.2832 to 6.2832"
            raise AssertionError(f"{joint.name} is continuous, its limits are {joint.lower} to {joint.upper}: {wanted}")
        swapped = ": they are swapped" if joint.upper < joint.lower else ""
        assert joint.lower < joint.upper, f"{joint.name}'s limits are {joint.lower} to {joint.upper}{swapped}"
        stated = urdf.joint(joint.name)
        inside = stated.lower - 1e-9 <= joint.lower and joint.upper <= stated.upper + 1e-9
        assert inside, f"{joint.name} leaves the URDF's {stated.lower} to {stated.upper}"
        for key in ("velocity", "acceleration", "jerk", "effort", "kp", "kv"):
            value = getattr(joint, key)
            assert math.isfinite(value) and value > 0, f"{joint.name}: {key} is {value}"
        slow = stated.velocity <= 0 or joint.velocity <= stated.velocity + 1e-9  # 0 is taken as not stated
        assert slow, f"{joint.name} is faster than the URDF's {stated.velocity}"
        assert joint.armature >= 0, f"{joint.name}: armature is {joint.armature}"


@rule
def home_is_within_the_limits(make: Make) -> None:
    """Home has a value for each joint, inside its limits."""
    robot = make()
    turning = {joint.name for joint in _read(robot).joints if joint.kind == "revolute"}
    assert len(robot.home) == len(robot.joints), f"{len(robot.home)} values for {len(robot.joints)} joints"
    for joint, angle in zip(robot.joints, robot.home, strict=True):
        degrees = abs(angle) > 2 * math.pi and joint.name in turning
        hint = ": home looks like degrees, it is in rad" if degrees else ""
        within = f"{joint.name} at {angle}, limits {joint.lower} to {joint.upper}{hint}"
        assert joint.lower < angle < joint.upper, within


@rule
def what_moves_has_mass(make: Make) -> None:
    """Links that carry something and move have mass and an inertia that a solid body can have."""
    robot = make()
    urdf = _read(robot)
    moving = [joint.child for joint in urdf.joints if joint.kind != "fixed"]
    light = [name for name in moving if urdf.links[name].mass <= 0]
    if len(light) > 1:
        raise AssertionError(f"the moving links {', '.join(light)} weigh nothing: each <inertial> needs a mass")
    wrong = []
    for name in moving:
        link = urdf.links[name]
        assert link.mass > 0, f"the moving link {name} weighs {link.mass} kg: its <inertial> needs a mass"
        xx, yy, zz, xy, xz, yz = link.inertia
        principal = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        stated = f"{name}: its <inertia> has the principal moments {', '.join(f'{one:.3g}' for one in principal)} kg m2"
        if principal[0] <= 0:
            wrong.append(f"{stated}: all are above 0 in a solid body (ixy, ixz and iyz are too large)")
        elif principal[0] + principal[1] < principal[2] * (1 - 1e-6):
            wrong.append(f"{stated}: in a solid body no one is more than the other two together")
    assert not wrong, "; ".join(wrong)


@rule
def the_gripper_opens_by_its_stroke(make: Make) -> None:
    """The finger joints' ranges add up to the stroke, and forces, speed and friction are possible."""
    robot = make()
    gripper = robot.gripper
    if gripper.kind == "parallel":
        urdf = _read(robot)
        assert gripper.finger_joints and gripper.pads, "a parallel gripper without fingers or pads"
        carried = _carried(urdf, gripper.finger_joints)
        still = [pad for pad in gripper.pads if pad not in carried]
        assert not still, f"gripper.pads: no finger joint moves {', '.join(still)}; pads are among {', '.join(carried)}"
        linkage = _linkage(robot, urdf)
        for joint in map(urdf.joint, gripper.finger_joints if linkage.slides else ()):
            assert joint.mimic is not None or abs(joint.lower) <= 5e-4, (
                f"{joint.name}'s limits are {joint.lower:g} to {joint.upper:g} m: slides are shut at 0 and open upwards"
            )
        stated, near = gripper.stroke, 1e-6 if linkage.slides else 1e-4
        assert abs(linkage.stroke - stated) < near, (
            f"the fingers open by {linkage.stroke:.4f} m, stroke says {stated} m"
        )
    assert 0 < gripper.min_force <= gripper.max_force, f"forces {gripper.min_force} to {gripper.max_force} N"
    assert gripper.speed > 0 and gripper.pad_friction > 0, "speed and friction are above 0"


@rule
def it_may_press_with_some_force(make: Make) -> None:
    """``max_contact_force`` is above 0, and no more than the arm's joints can exert at home."""
    robot = make()
    most = robot.max_contact_force
    assert math.isfinite(most) and most > 0, f"it is {most} N"
    urdf = _read(robot)
    home = dict(zip(robot.joint_names, robot.home, strict=True))
    poses = link_poses(urdf, home)
    tool = np.array(_tool(robot, urdf).position)
    # Straight down, every joint must bear the force at its lever.
    for joint in robot.joints:
        stated = urdf.joint(joint.name)
        pose = poses[stated.child]
        if stated.kind != "revolute":
            continue
        axis = pose.rotation @ np.array(stated.axis)
        lever = abs(float(axis @ np.cross(tool - np.array(pose.position), (0.0, 0.0, 1.0))))
        assert lever * most <= joint.effort, f"{most} N are {lever * most:.0f} Nm at {joint.name}, of {joint.effort}"


@rule
def the_tool_frame_sits_between_the_fingers(make: Make) -> None:
    """Fingers slide along the tool's y axis, in opposite directions and alike, with the tool centre in their middle."""
    robot = make()
    if robot.gripper.kind != "parallel":
        return
    urdf = _read(robot)
    tool = _tool(robot, urdf)
    home = dict(zip(robot.joint_names, robot.home, strict=True))
    linkage = _linkage(robot, urdf)
    carried = [urdf.joint(name).child for name in robot.gripper.finger_joints] if linkage.slides else robot.gripper.pads
    moved = []
    for opening in (0.0, 0.01 * len(carried)):
        poses = link_poses(urdf, home | linkage.positions_at(linkage.driver(opening)))
        moved.append([tool.inverse().apply(poses[link].position) for link in carried])
    for link, before, after in zip(carried, *moved, strict=True):
        motion = after - before
        aside = np.array([motion[0], motion[2] if linkage.slides else 0.0])
        along_y = np.abs(aside).max() < 1e-6 + 1e-3 * abs(motion[1]) and abs(motion[1]) > 1e-3
        way = ", ".join(f"{1000 * value:+.1f}" for value in motion)
        wrong = "the <axis> of its joint, or the turn of the tool frame, is wrong"
        assert along_y, f"opening moves {link} by ({way}) mm in the tool frame, not along its y: {wrong}"
    motions = [after - before for before, after in zip(*moved, strict=True)]
    ways = ", ".join(f"{1000 * motion[1]:+.1f}" for motion in motions)
    balance = abs(sum(motion[1] for motion in motions))
    assert balance < 1e-5, f"the fingers do not move apart alike: by {ways} mm along the tool's y"
    middle = 1000 * np.mean(moved[0], axis=0)
    off = f"the fingers meet {middle[0]:.0f} mm along x and {middle[1]:.0f} mm along y from the tool centre"
    assert np.abs(middle[:2]).max() < 1.0, f"{off}: tool_offset is off by that"


@rule
def the_approach_axis_leads_out_of_the_hand(make: Make) -> None:
    """The tool's z axis points from the last arm joint outwards."""
    robot = make()
    urdf = _read(robot)
    home = dict(zip(robot.joint_names, robot.home, strict=True))
    wrist = link_poses(urdf, home)[urdf.joint(robot.joint_names[-1]).child]
    last = _tool(robot, urdf).inverse().apply(wrist.position)
    ahead = f"the last joint is {1000 * last[2]:.0f} mm ahead of the tool along its z"
    assert last[2] < -0.01, (
        f"{ahead}: the tool frame is upside down; its z must lead out of the hand (turn tool_offset)"
    )


@rule
def the_reach_is_that_of_the_links(make: Make) -> None:
    """``reach`` is not more than the arm's links are long, and home lies within it."""
    robot = make()
    urdf = _read(robot)
    first = urdf.joint(robot.joint_names[0])
    lengths = [np.linalg.norm(urdf.joint(name).origin.position) for name in robot.joint_names[1:]]
    hand = link_poses(urdf, {})
    wrist = urdf.joint(robot.joint_names[-1]).child
    lengths.append(np.linalg.norm((hand[wrist].inverse() * hand[robot.tool_link] * robot.tool_offset).position))
    assert 0 < robot.reach <= sum(lengths) + 1e-9, f"reach {robot.reach} m, links {sum(lengths):.3f} m"
    out = np.linalg.norm(np.array(_tool(robot, urdf).position[:2]) - np.array(first.origin.position[:2]))
    assert out <= robot.reach, f"home is {out:.3f} m out, reach {robot.reach} m"


# Names that are not there, and numbers in other units, break what is computed from them: only these are told then.
for _name in list(RULES)[2:]:
    _first = (names_are_those_of_the_urdf.__name__, the_urdf_is_in_rad_m_and_kg.__name__)
    FOLLOWS[_name] = (*FOLLOWS.get(_name, ()), *_first)


def wrong_robots(right: RobotDescription) -> dict[str, RobotDescription]:
    """Name of the broken rule -> a description that breaks it and is right otherwise."""
    evolve: Any = attrs.evolve
    gripper, first = right.gripper, right.joints[0]
    root = read_urdf(right.urdf, right.mesh_folder).root
    spare = f'<joint name="loose" type="continuous"><parent link="{root}"/><child link="spare"/></joint>'
    spare += '<link name="spare"/>'
    weightless = right.urdf.replace("<mass value=", '<mass value="0"/><was value=')
    grams = re.sub(r'<mass value="([^"]+)"', lambda found: f'<mass value="{1e4 * float(found[1])}"', right.urdf)
    turned = Pose(orientation=quaternion_from_axis_angle((0, 0, 1), math.pi / 2))
    flipped = Pose(orientation=quaternion_from_axis_angle((0, 1, 0), math.pi))
    return {
        "names_are_those_of_the_urdf": evolve(right, tool_link="nowhere"),
        "the_urdf_is_in_rad_m_and_kg": evolve(right, urdf=grams),
        "every_moving_joint_is_described": evolve(right, urdf=right.urdf.replace("</robot>", spare + "</robot>")),
        "the_arm_is_one_chain": evolve(right, joints=right.joints[::-1], home=right.home[::-1]),
        "limits_are_possible": evolve(right, joints=(evolve(first, upper=99.0), *right.joints[1:])),
        "home_is_within_the_limits": evolve(right, home=(99.0, *right.home[1:])),
        "what_moves_has_mass": evolve(right, urdf=weightless),
        "the_gripper_opens_by_its_stroke": evolve(right, gripper=evolve(gripper, stroke=gripper.stroke * 2)),
        "it_may_press_with_some_force": evolve(right, max_contact_force=1000.0),
        "the_tool_frame_sits_between_the_fingers": evolve(right, tool_offset=right.tool_offset * turned),
        "the_approach_axis_leads_out_of_the_hand": evolve(right, tool_offset=right.tool_offset * flipped),
        "the_reach_is_that_of_the_links": evolve(right, reach=99.0),
    }
