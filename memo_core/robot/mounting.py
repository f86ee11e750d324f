"""Where a robot's base stands: on the table, on a pedestal, on a wall, or hanging.

All positions in scenes, skills and prompts are in one frame, that of the robot as it usually stands (z up, the table's
top at the scene's height). A mounted robot's URDF gets a new root link at that frame's origin, and its old root is
fixed to it at the base pose, so that kinematics, collision checks and simulators need to know nothing of mountings.
"""

from __future__ import annotations

import math
from typing import Any
from xml.etree import ElementTree

import attrs
import numpy as np
from attrs.validators import ge, le

from memo_core.errors import InvalidArgument
from memo_core.robot.description import RobotDescription
from memo_core.robot.urdf.reading import read_urdf
from memo_core.robot.urdf.text import Solid, joint_text, link_text
from memo_core.scene.pose import Pose

_FARTHEST = 3.0  # m from the origin of scenes to the base: farther, no arm reaches a table
_TURN = 6.3  # rad, a little more than a whole turn
MOUNT = "memo_mount"  # the new root link


def _finite(count: int) -> Any:
    def check(instance: object, attribute: attrs.Attribute[list[float]], value: list[float]) -> None:
        if len(value) != count or not np.isfinite(value).all():
            raise InvalidArgument(attribute.name, f"{value}", f"{count} finite numbers")

    return check


def _in_metres(instance: object, attribute: attrs.Attribute[list[float]], value: list[float]) -> None:
    if max(map(abs, value), default=0.0) > _FARTHEST:
        raise InvalidArgument(attribute.name, f"{value} looks like millimetres", f"metres, {_FARTHEST:g} at most")


def _in_radians(instance: object, attribute: attrs.Attribute[list[float]], value: list[float]) -> None:
    if max(map(abs, value), default=0.0) > _TURN:
        right = ", ".join(f"{math.radians(one):.5g}" for one in value)
        raise InvalidArgument(attribute.name, f"{value} looks like degrees", f"radians: [{right}]")


def turned_by(roll: float, pitch: float, yaw: float) -> Any:
    """Field ``base_rpy`` with another default, for the settings of a robot that usually stands otherwise.

    Args:
        roll: default rotation of the base about x, rad.
        pitch: default rotation about y, rad.
        yaw: default rotation about z, rad; applied last, as in URDF.

    Returns:
        An attrs field whose validator raises ``InvalidArgument`` for values that are not three angles in rad.
    """
    return attrs.field(
        factory=lambda: [roll, pitch, yaw],
        validator=[_finite(3), _in_radians],
        metadata={"help": "how it is turned: roll, pitch, yaw, rad; [0, 1.5708, 0] on a wall, [3.1416, 0, 0] hanging"},
    )


@attrs.frozen
class Mounting:
    """Settings of a robot's base; for the config class of a robot plugin to inherit from."""

    base_position: list[float] = attrs.field(
        factory=lambda: [0.0, 0.0, 0.0],
        validator=[_finite(3), _in_metres],
        metadata={"help": "where the base stands: x, y, z, m"},
    )
    base_rpy: list[float] = turned_by(0.0, 0.0, 0.0)
    mount_length: float = attrs.field(
        default=0.0,
        validator=[ge(0.0), le(3.0)],
        metadata={"help": "post behind the base (a pedestal, a bracket), which the arm keeps clear of, m; 0: none"},
    )
    mount_radius: float = attrs.field(default=0.08, validator=[ge(0.01), le(0.5)], metadata={"help": "its radius, m"})

    def applied(self, robot: RobotDescription) -> RobotDescription:
        """Mount a robot.

        Args:
            robot: robot in its usual pose, not mounted yet.

        Returns:
            The robot with its base moved and a post behind it; ``robot`` itself if position, rotation and
                ``mount_length`` are zero.

        Raises:
            InvalidArgument: if the robot is mounted already.
        """
        if not any(self.base_position) and not any(self.base_rpy) and self.mount_length == 0:
            return robot
        return mounted(robot, self.base_position, self.base_rpy, self.mount_length, self.mount_radius)


def mounted(
    robot: RobotDescription,
    position: list[float],
    rpy: list[float],
    post_length: float = 0.0,
    post_radius: float = 0.08,
) -> RobotDescription:
    """``robot`` with its root link at ``position`` (m), turned by ``rpy`` (rad; URDF's roll, pitch, yaw), and a post of
    this length (m) along the base's -z. Raises ``InvalidArgument`` for a robot that is mounted already."""
    urdf = read_urdf(robot.urdf, robot.mesh_folder)
    if MOUNT in urdf.links:
        raise InvalidArgument(f"robot {robot.name!r}", "is mounted already", "one mounting")
    root = ElementTree.fromstring(robot.urdf)
    post: tuple[Solid, ...] = ()
    if post_length > 0:
        post = (Solid("cylinder", (post_radius, post_length), (0.0, 0.0, -post_length / 2), colour="memo_mount"),)
    x, y, z = (float(v) for v in position)
    roll, pitch, yaw = (float(v) for v in rpy)
    text = (
        '<robot><material name="memo_mount"><color rgba="0.35 0.36 0.38 1"/></material>'
        + link_text(MOUNT)
        + link_text(f"{MOUNT}_post", None, post, post)
        + joint_text(f"{MOUNT}_base", "fixed", MOUNT, urdf.root, (x, y, z), (roll, pitch, yaw))
        + joint_text(f"{MOUNT}_post", "fixed", urdf.root, f"{MOUNT}_post")
        + "</robot>"
    )
    root.extend(list(ElementTree.fromstring(text)))
    return attrs.evolve(robot, urdf=ElementTree.tostring(root, encoding="unicode"))


def base_pose(robot: RobotDescription) -> Pose:
    """Where the robot's own root link stands; the identity unless it is mounted."""
    for joint in read_urdf(robot.urdf, robot.mesh_folder).joints:
        if joint.parent == MOUNT:
            return joint.origin
    return Pose()
