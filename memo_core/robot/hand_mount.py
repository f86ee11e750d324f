"""Which way an arm ends, and how a hand on it is turned.

A hand's own z axis leads out of it, so its mount must turn that axis to where the arm leads. A flange's z axis usually
does; the x axis does in older URDFs (``ee_link``). Nothing in a URDF states it: it follows from the last joint's axis
and from the sides of it that the links before and after lie on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import attrs
import numpy as np

from memo_core.robot.urdf.reading import Urdf, UrdfJoint, Vector, link_poses
from memo_core.scene.pose import Array, Pose

_APART = 0.005  # m from which on two frames count as apart
_ALONG = 0.5  # cosine from which on a link counts as leading along the last joint's axis
_ASIDE = 0.02  # m of a hand's offset along the last joint's axis from which on the arm leads along it


@attrs.frozen
class Sideways:
    """A hand whose approach axis is at a right angle to where the arm leads."""

    joint: str  # the last arm joint
    degrees: float  # between the hand's z axis and that joint's axis
    mount: str  # the fixed joint that carries the hand; empty where there is none
    flange: str  # the link it is fixed to
    rpy: Vector  # rad, what that joint's <origin> should have instead


def mount_rpy(urdf: Urdf, joints: Sequence[str], flange: str) -> tuple[Vector, str]:
    """Roll, pitch, yaw (rad) that turn a hand on the link ``flange`` so that its z leads out of the arm, and the axis
    of the flange that does, such as "+x". No turn where the URDF does not tell."""
    poses = link_poses(urdf, {})
    outwards = _outwards(urdf, joints, np.array(poses[flange].position))
    if outwards is None:
        return (0.0, 0.0, 0.0), "+z"
    local = poses[flange].rotation.T @ outwards
    axis = int(np.argmax(np.abs(local)))
    sign = 1 if local[axis] > 0 else -1
    turns: dict[tuple[int, int], Vector] = {
        (0, 1): (0.0, math.pi / 2, 0.0),
        (0, -1): (0.0, -math.pi / 2, 0.0),
        (1, 1): (-math.pi / 2, 0.0, 0.0),
        (1, -1): (math.pi / 2, 0.0, 0.0),
        (2, 1): (0.0, 0.0, 0.0),
        (2, -1): (math.pi, 0.0, 0.0),
    }
    return turns[axis, sign], f"{'+' if sign > 0 else '-'}{'xyz'[axis]}"


def sideways(urdf: Urdf, joints: Sequence[str], tool_link: str, offset: Pose) -> Sideways | None:
    """What is wrong with a hand that is mounted sideways on a roll joint; None for one that is not. ``offset``: of the
    tool frame in ``tool_link``."""
    poses = link_poses(urdf, {})
    last = urdf.joint(joints[-1])
    wrist, tool = poses[last.child], poses[tool_link] * offset
    axis, z = wrist.rotation @ np.array(last.axis), tool.rotation[:, 2]
    if abs(float(axis @ z)) > math.cos(math.radians(45)):
        return None
    arm = np.subtract(tool.position, wrist.position)
    aside = arm - (arm @ z) * z  # without the hand's own length
    before = np.subtract(wrist.position, poses[urdf.joint(joints[-2]).child].position)
    if abs(float(aside @ axis)) > _ASIDE:
        target = axis * np.sign(aside @ axis)
    elif np.linalg.norm(before) > _APART and abs(float(before @ axis)) > 0.9 * np.linalg.norm(before):
        target = axis * np.sign(before @ axis)
    else:
        return None  # a last joint that bends the hand
    mount = _mount(urdf, tool_link, last.child)
    rpy, flange = (0.0, 0.0, 0.0), last.child
    if mount is not None:
        flange = mount.parent
        wanted = _turning(z, target) @ poses[mount.child].rotation
        rpy = _rpy(poses[flange].rotation.T @ wanted)
    degrees = math.degrees(math.acos(min(1.0, abs(float(axis @ z)))))
    return Sideways(last.name, degrees, mount.name if mount else "", flange, rpy)


def _outwards(urdf: Urdf, joints: Sequence[str], end: Array) -> Array | None:
    """The unit direction in the base frame, joints at 0, in which the arm leads out at its end (m); None where its
    frames do not tell."""
    poses = link_poses(urdf, {})
    last = urdf.joint(joints[-1])
    wrist = poses[last.child]
    axis: Array = wrist.rotation @ np.array(last.axis)
    after: Array = end - np.array(wrist.position)
    if (far := float(np.linalg.norm(after))) > _APART:
        along = float(after @ axis) / far
        return math.copysign(1.0, along) * axis if abs(along) > _ALONG else after / far
    before = np.subtract(wrist.position, poses[urdf.joint(joints[-2]).child].position)
    if (far := float(np.linalg.norm(before))) > _APART and abs(float(before @ axis)) > _ALONG * far:
        return math.copysign(1.0, float(before @ axis)) * axis
    return None


def _mount(urdf: Urdf, tool_link: str, last: str) -> UrdfJoint | None:
    """The fixed joint below the arm's last link that carries the hand's body: the nearest link to the tool with shapes
    or mass."""
    above = {joint.child: joint for joint in urdf.joints}
    link = tool_link
    while link != last and link in above:
        solid = urdf.links[link]
        if solid.mass > 0 or solid.collisions or solid.visuals or above[link].parent == last:
            return above[link] if above[link].kind == "fixed" else None
        link = above[link].parent
    return None


def _turning(start: Array, end: Array) -> Array:
    """The smallest rotation that takes one unit direction to another, not opposite one."""
    normal = np.cross(start, end)
    cross = np.array([[0, -normal[2], normal[1]], [normal[2], 0, -normal[0]], [-normal[1], normal[0], 0]])
    turned: Array = np.eye(3) + cross + cross @ cross / (1.0 + float(start @ end))
    return turned


def _rpy(rotation: Array) -> Vector:
    """URDF's roll, pitch and yaw (rad) of a rotation matrix."""
    pitch = math.asin(max(-1.0, min(1.0, -float(rotation[2, 0]))))
    if abs(rotation[2, 0]) > 1 - 1e-9:
        return math.atan2(-float(rotation[1, 2]), float(rotation[1, 1])), pitch, 0.0
    roll = math.atan2(float(rotation[2, 1]), float(rotation[2, 2]))
    return roll, pitch, math.atan2(float(rotation[1, 0]), float(rotation[0, 0]))
