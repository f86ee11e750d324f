"""The built-in skills: one contract for simulation and hardware.

Plugins add skills through the same hook.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.scene.pose import Pose, multiply_quaternions, quaternion_from_axis_angle, quaternion_from_rotation
from memo_core.skills.control import Control, Waypoints
from memo_core.skills.skill import Skill, skill, type_legend
from memo_core.skills.values import (
    Angle,
    Direction,
    Distance,
    Force,
    Name,
    Orientation,
    Path,
    Position,
    Push,
    Seconds,
    Short,
    Slack,
    Speed,
    ToolSpeed,
    Width,
)

_TURNING_STEP = 0.15  # rad between two poses of a turn
_ARC_STEP = math.radians(4)  # between two poses of an arc path, as recorded programs choose it
_ARC_POSES = 12  # at least; follow_path asks for 10 on a curve
_TURNING_SPEED = 0.1  # m/s, which for a turn in place means 0.6 rad/s

# -- what is there ---------------------------------------------------------------------------------------------------


@skill("query")
def get_objects(control: Control) -> list:
    """Names of all objects and visible parts in the scene, as of the last look."""
    return [node.label for node in control.scene().nodes]


@skill("query")
def get_position(control: Control, name: Name) -> Position:
    """Centre [x, y, z] (m, base frame) of an object's or part's box, as of the last look."""
    return list(control.scene().node(name).pose.position)


@skill("query")
def get_size(control: Control, name: Name) -> list:
    """Full extents [sx, sy, sz] (m) of the box along its own axes (see get_axes)."""
    return list(control.scene().node(name).size)


@skill("query")
def get_axes(control: Control, name: Name) -> list:
    """The box's own axes: three unit vectors [[x axis], [y axis], [z axis]] in the base frame."""
    return control.scene().node(name).pose.rotation.T.tolist()


@skill("query")
def get_level_axes(control: Control, name: Name) -> list:
    """[[direction, extent (m)], [direction, extent (m)]] of the box's two axes nearest to horizontal, as level unit
    vectors (base frame), the shorter extent first."""
    node = control.scene().node(name)
    rotation = node.pose.rotation
    nearest = sorted(range(3), key=lambda axis: abs(rotation[2, axis]))[:2]
    shortest = sorted(nearest, key=lambda axis: node.size[axis])
    return [[_unit("get_level_axes(name)", [*rotation[:2, axis].tolist(), 0.0]), node.size[axis]] for axis in shortest]


@skill("query")
def get_face_normal(control: Control, name: Name, point: Position) -> Direction:
    """Unit vector (base frame) out of the face of the box that point lies furthest before or, inside the box, nearest
    to."""
    pose, size = control.scene().node(name).pose, control.scene().node(name).size
    offset = pose.rotation.T @ (np.asarray(point) - np.asarray(pose.position))
    axis = int(np.argmax(np.abs(offset) - np.asarray(size) / 2))
    if abs(offset[axis]) < 1e-6:
        raise InvalidArgument(
            "get_face_normal(point)", f"it is midway between two faces of {name!r}", "a point nearer to one of them"
        )
    return [float(v) for v in pose.rotation[:, axis] * np.sign(offset[axis])]


@skill("query")
def get_bounds(control: Control, name: Name) -> list:
    """[[x, y, z] lowest, [x, y, z] highest] corner (m, base frame) of the upright box that encloses the object."""
    return [bound.tolist() for bound in control.scene().node(name).bounds()]


@skill("query")
def get_parts(control: Control, name: Name) -> list:
    """Names of the visible parts of an object (door, handle, inside)."""
    scene = control.scene()
    owner = scene.node(name).id
    return [node.label for node in scene.nodes if node.part_of == owner]


@skill("query")
def get_opening(control: Control, name: Name) -> Direction:
    """For the inside of a container: unit vector (base frame) pointing out through its open side."""
    node = control.scene().node(name)
    if node.opening is None:
        raise InvalidArgument(
            "get_opening(name)", f"{node.label!r} is not the inside of a container", "a name ending in 'inside'"
        )
    return list(node.opening)


@skill("query")
def get_relations(control: Control) -> list:
    """Sentences that hold in the scene, as of the last look, such as 'the oven door is closed'."""
    return list(control.scene().sentences())


@skill("query")
def get_table_height(control: Control) -> float:
    """Height z (m, base frame) of the table's top."""
    return control.scene().table_height


@skill("perception")
def look(control: Control) -> list:
    """Look at the scene again, so that positions and relations are those of now; returns the relations' sentences."""
    return list(control.look().sentences())


# -- the hand --------------------------------------------------------------------------------------------------------


@skill("query")
def get_gripper_position(control: Control) -> Position:
    """Where the point between the fingertips is now: [x, y, z] (m, base frame)."""
    return list(control.tool_pose().position)


@skill("query")
def get_gripper_orientation(control: Control) -> Orientation:
    """How the hand is turned now: quaternion [w, x, y, z]; its z axis is the approach, its y axis the closing
    direction."""
    return list(control.tool_pose().orientation)


@skill("query")
def get_gripper_width(control: Control) -> float:
    """Distance (m) between the fingers now."""
    return control.gripper_width()


@skill("query")
def is_holding(control: Control) -> bool:
    """Whether something is held between the fingers, be it loose or a part of furniture."""
    return control.holding()


@skill("gripper")
def open_gripper(control: Control, width: Width | None = None) -> float:
    """Open the fingers to a width (m), or fully; returns the width reached (m)."""
    return control.open_gripper(width)


@skill("gripper")
def close_gripper(control: Control, force: Force | None = None) -> float:
    """Close the fingers until they hold something or meet, pressing with a force (N; default the gripper's strongest);
    returns the width reached (m): near 0 means that nothing is between them."""
    return control.close_gripper(force)


# -- orientations: these only compute --------------------------------------------------------------------------------


@skill("geometry")
def top_orientation(control: Control, yaw: Angle = 0.0) -> Orientation:
    """Orientation of a hand that points straight down. At yaw 0 the fingers close along y; yaw (rad) turns that
    direction about z."""
    closing = [-math.sin(yaw), math.cos(yaw), 0.0]
    return _orientation([0.0, 0.0, -1.0], closing)


@skill("geometry")
def side_orientation(
    control: Control, direction: Direction, fingers: Literal["horizontal", "vertical"] = "horizontal", tilt: Angle = 0.0
) -> Orientation:
    """Orientation of a hand that comes from the side, pointing along the horizontal part of direction. fingers: whether
    they close 'horizontal'ly (for upright bars and objects) or 'vertical'ly (for level bars). tilt (rad) lets the hand
    point downwards by that much."""
    length = math.hypot(direction[0], direction[1])
    if length < 1e-6:
        raise InvalidArgument(
            "side_orientation(direction)", "it has no horizontal part", "a direction such as [1, 0, 0]"
        )
    x, y = direction[0] / length, direction[1] / length
    approach = [x * math.cos(tilt), y * math.cos(tilt), -math.sin(tilt)]
    if fingers == "horizontal":
        closing = [-y, x, 0.0]
    else:
        closing = [x * math.sin(tilt), y * math.sin(tilt), math.cos(tilt)]
    return _orientation(approach, closing)


@skill("geometry")
def turn_orientation(control: Control, orientation: Orientation, axis: Direction, angle: Angle) -> Orientation:
    """The orientation turned by angle (rad, right-handed) about an axis of the base frame."""
    if max(abs(v) for v in axis) < 1e-9:
        raise InvalidArgument("turn_orientation(axis)", "it has no length", "a direction such as [0, 0, 1]")
    return list(multiply_quaternions(quaternion_from_axis_angle(axis, angle), orientation))


@skill("geometry")
def turn_point(control: Control, point: Position, pivot: Position, axis: Direction, angle: Angle) -> Position:
    """The point moved by angle (rad, right-handed) on a circle about the axis (base frame) through pivot."""
    if max(abs(v) for v in axis) < 1e-9:
        raise InvalidArgument("turn_point(axis)", "it has no length", "a direction such as [0, 0, 1]")
    k = np.asarray(axis) / np.linalg.norm(axis)
    r = np.asarray(point) - np.asarray(pivot)
    turned = r * math.cos(angle) + np.cross(k, r) * math.sin(angle) + k * (k @ r) * (1 - math.cos(angle))
    return [float(v) for v in np.asarray(pivot) + turned]


@skill("geometry")
def hand_axis(
    control: Control, orientation: Orientation, axis: Literal["pointing", "closing"] = "pointing"
) -> Direction:
    """Unit vector (base frame) along which a hand of this orientation points, or its fingers close."""
    return [float(v) for v in Pose((0.0, 0.0, 0.0), tuple(orientation)).rotation[:, 2 if axis == "pointing" else 1]]


@skill("geometry")
def angle_about(control: Control, axis: Direction, start: Direction, end: Direction) -> float:
    """Angle (rad, -pi to pi, right-handed) about axis from direction start to end; parts along axis do not count.
    angle_about([0, 0, 1], [0, 1, 0], d) is the yaw at which the fingers of top_orientation close along d."""
    k = np.asarray(_unit("angle_about(axis)", axis))
    across = []
    for argument, direction in (("start", start), ("end", end)):
        unit = np.asarray(_unit(f"angle_about({argument})", direction))
        across.append(unit - k * (k @ unit))
        if np.linalg.norm(across[-1]) < 1e-6:
            raise InvalidArgument(f"angle_about({argument})", "it is parallel to the axis", "a direction across it")
    return math.atan2(float(k @ np.cross(across[0], across[1])), float(across[0] @ across[1]))


@skill("geometry")
def arc_path(
    control: Control, position: Position, orientation: Orientation, pivot: Position, axis: Direction, angle: Angle
) -> Path:
    """Path, about every 4 degrees and without its start, of a hand carried by angle (rad, right-handed) on a circle
    about the axis (base frame) through pivot, turning with it."""
    count = max(_ARC_POSES, math.floor(abs(angle) / _ARC_STEP + 1e-9))
    turned = _turned(position, orientation, pivot, _unit("arc_path(axis)", axis), angle, count)
    return [list(pose) for pose in turned]


# -- motion ----------------------------------------------------------------------------------------------------------


@skill("motion")
def move_to(
    control: Control,
    position: Position,
    orientation: Orientation | None = None,
    then: Path | None = None,
    slack: Slack = 0.7,
    speed: Speed = 1.0,
) -> None:
    """Move the point between the fingertips to a position, the hand turned to orientation (None: as it is now), around
    everything seen at the last look. then: the path you mean to follow next, so that the arm arrives in a posture from
    which it can; raises MotionError before anything moves when it could not. slack (rad): how far the hand may be
    tilted about its closing direction, or stay behind the turning of a bar it holds, where the arm cannot reach
    otherwise; 0 for exactly this orientation. speed: fraction of full speed, here and below."""
    control.move_to(position, orientation, then, slack, speed)


@skill("motion")
def move_straight(
    control: Control, position: Position, orientation: Orientation | None = None, slack: Slack = 0.7, speed: Speed = 0.5
) -> None:
    """Move in a straight line to a position. The fingers, and what they hold, may touch things on the way: for
    approaching, lifting, pushing and pulling. slack and speed as in move_to. Raises MotionError when it did not arrive,
    saying by how much."""
    control.follow_path([(position, orientation)], None, slack, speed)


@skill("motion")
def follow_path(control: Control, path: Path, then: Path | None = None, slack: Slack = 0.7, speed: Speed = 0.5) -> None:
    """Move through all positions (or [position, orientation] pairs) of a path without stopping, in straight pieces; use
    10 or more points for a curve. What may touch things is as in move_straight. slack, then and speed as in move_to."""
    control.follow_path(path, then, slack, speed)


@skill("motion")
def align_from_top(control: Control, yaw: Angle = 0.0) -> None:
    """Turn the hand in place so that it points straight down (see top_orientation)."""
    control.move_to(list(control.tool_pose().position), top_orientation.call(control, (yaw,)), None, 0.0, 1.0)


@skill("motion")
def align_from_side(
    control: Control, direction: Direction, fingers: Literal["horizontal", "vertical"] = "horizontal", tilt: Angle = 0.0
) -> None:
    """Turn the hand in place so that it points along a horizontal direction (see side_orientation)."""
    orientation = side_orientation.call(control, (direction, fingers, tilt))
    control.move_to(list(control.tool_pose().position), orientation, None, 0.0, 1.0)


@skill("motion")
def rotate_gripper(control: Control, angle: Angle, push: Push = 0.0) -> None:
    """Turn the hand in place about its approach axis by angle (rad, right-handed about the approach direction),
    pressing along it with push (N) meanwhile."""
    pose = control.tool_pose()
    approach = [float(v) for v in pose.rotation[:, 2]]
    path = _turned(pose.position, pose.orientation, pose.position, approach, angle)
    if push > 0:
        control.press_along("rotate_gripper", path, approach, push, _TURNING_SPEED)
    else:
        control.follow_path(path, None, 0.0, 0.5)


@skill("motion")
def turn_about(control: Control, pivot: Position, axis: Direction, angle: Angle, speed: Speed = 0.5) -> None:
    """Carry the hand, and what it holds, on a circle about the axis (base frame) through pivot by angle (rad,
    right-handed), the hand turning with it: for tilting and pouring about a rim, turning a lever, opening a lid."""
    pose = control.tool_pose()
    control.follow_path(
        _turned(pose.position, pose.orientation, pivot, _unit("turn_about(axis)", axis), angle), None, 0.0, speed
    )


@skill("motion")
def go_home(control: Control) -> None:
    """Move the arm to its home posture, out of the way, keeping hold of what is held."""
    control.go_home()


@skill("motion")
def wait(control: Control, seconds: Seconds) -> None:
    """Stay still for some seconds."""
    control.wait(seconds)


# -- force -----------------------------------------------------------------------------------------------------------


@skill("query")
def get_contact_force(control: Control) -> list:
    """Force [fx, fy, fz] (N, base frame) that the world exerts on the hand now, without what it felt when it was last
    free (a held object's weight): pressing down on a table, fz is above 0."""
    return control.contact_force()


@skill("motion")
def move_until_contact(
    control: Control, direction: Direction, distance: Distance, force: Force = 5.0, speed: ToolSpeed = 0.02
) -> float:
    """Move straight along direction until a force (N) is felt against it, stop there; returns the metres moved. speed
    is in m/s; slow is gentle. Raises MotionError when nothing was felt within distance (m)."""
    return control.move_until_contact(_unit("move_until_contact(direction)", direction), distance, force, speed)


@skill("motion")
def press(control: Control, direction: Direction, force: Force, seconds: Seconds = 1.0) -> float:
    """Press along direction with a force (N) for some seconds, going up to 3 cm to find something; returns the mean
    force (N). Raises MotionError when nothing holds against it."""
    return control.press(_unit("press(direction)", direction), force, seconds)


@skill("motion")
def press_along(control: Control, path: Path, direction: Direction, force: Force, speed: ToolSpeed = 0.05) -> float:
    """Follow a path as follow_path does, pressing along direction with a force (N) all the way: the hand gives way
    along direction, up to 3 cm off the path, and keeps to it otherwise. For wiping, pushing something home, following a
    surface. speed is in m/s. Returns the mean force (N); raises MotionError when contact is lost."""
    return control.press_along("press_along", path, _unit("press_along(direction)", direction), force, speed)


@skill("motion")
def spiral_search(
    control: Control,
    direction: Direction,
    radius: Short,
    force: Force = 5.0,
    depth: Short = 0.003,
    pitch: Short = 0.001,
) -> Position:
    """Press along direction with a force (N) while circling outwards up to radius (m), turns pitch (m) apart, until the
    hand drops by depth (m): for finding a hole or a fit. Returns the hand's position then; raises MotionError, back in
    the middle, when it never dropped."""
    return control.spiral_search(_unit("spiral_search(direction)", direction), radius, force, depth, pitch)


def _unit(where: str, direction: list[float]) -> list[float]:
    length = math.sqrt(sum(v * v for v in direction))
    if length < 1e-9:
        raise InvalidArgument(where, "it has no length", "a direction such as [0, 0, -1]")
    return [v / length for v in direction]


def _turned(
    position: Sequence[float],
    orientation: Sequence[float],
    pivot: Sequence[float],
    axis: list[float],
    angle: float,
    count: int | None = None,
) -> Waypoints:
    """Poses on the way of a hand that is turned by ``angle`` (rad) about a unit axis: ``count``, or as many as straight
    pieces need."""
    path: Waypoints = []
    count = count or max(1, math.ceil(abs(angle) / _TURNING_STEP))
    for number in range(1, count + 1):
        part = quaternion_from_axis_angle(axis, angle * number / count)
        moved = Pose((0.0, 0.0, 0.0), part).apply(np.asarray(position) - np.asarray(pivot)) + np.asarray(pivot)
        path.append(([float(v) for v in moved], list(multiply_quaternions(part, tuple(orientation)))))
    return path


def _orientation(approach: list[float], closing: list[float]) -> list[float]:
    """Quaternion of a tool frame with z = approach and y = closing (unit, orthogonal)."""
    z, y = np.asarray(approach), np.asarray(closing)
    return list(quaternion_from_rotation(np.column_stack([np.cross(y, z), y, z])))


BUILTIN_SKILLS: tuple[Skill, ...] = tuple(value for value in list(globals().values()) if isinstance(value, Skill))


def documentation(skills: dict[str, Any]) -> str:
    """The prompt's documentation of a skill library: what the type names mean, then the skills as they are declared."""
    parts = [type_legend(skills.values()), *(one.documentation() for one in skills.values())]
    return "\n\n".join(part for part in parts if part)
