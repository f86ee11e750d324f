"""RobotDescription: everything the framework knows about a robot arm. Provided by the robot's plugin, used by
``memo_core.arm`` and by every simulator; hardware links take their limits from it.

Frames: the URDF's root link is the base frame (x forward, y left, z up). The *tool frame* sits between the fingertips:
+z is the approach direction (out of the hand), +y the direction in which the fingers close.
"""

from __future__ import annotations

import math
from typing import Literal

import attrs

from memo_core.errors import InvalidArgument
from memo_core.robot.urdf.reading import read_urdf
from memo_core.scene.description import Material
from memo_core.scene.pose import Pose


@attrs.frozen
class JointDescription:
    """One arm joint. Angles in rad, torques in Nm, position-servo gains in Nm/rad and Nm s/rad; for a slide, lengths in
    m, forces in N, gains in N/m and N s/m.

    The servo's torque is kp (target - q) - kv dq/dt, so that it lags kv/kp seconds behind a moving target: to follow
    q(t) without lag, command q(t) + kv/kp dq/dt.
    """

    name: str  # as in the URDF
    lower: float
    upper: float
    velocity: float  # rad/s or m/s
    acceleration: float  # rad/s2 or m/s2
    jerk: float  # rad/s3 or m/s3
    effort: float  # Nm or N
    kp: float
    kv: float
    armature: float = 0.1  # kg m2 or kg


@attrs.frozen
class GripperDescription:
    """A gripper and its abilities.

    ``finger_joints`` are URDF slide joints coupled to move alike, each over half the stroke, or hinges, the driven one
    first (``memo_core.robot.finger_linkage``); ``pads`` are the links whose contact with an object means holding. A
    vacuum gripper has no finger joints; its pad is the cup, closing is suction on, and of the openings 0 and ``stroke``
    the one means on, the other off. It pulls what the cup touches with the force it is closed with.
    """

    kind: Literal["parallel", "vacuum"] = "parallel"
    finger_joints: tuple[str, ...] = ()
    pads: tuple[str, ...] = ()
    stroke: float = 0.08  # m, widest opening
    speed: float = 0.1  # m/s, of the opening
    min_force: float = 5.0  # N
    max_force: float = 80.0  # N
    holding_force: float = 1.5  # N; simulated fingers that press harder hold something
    pad_friction: float = 1.0  # on a surface of the default material (``friction_on``)
    finger_thickness: float = 0.02  # m along the closing axis, outside of the opening
    fingertip_reach: float = 0.01  # m the fingertips extend beyond the tool centre along the approach axis
    palm_distance: float = 0.037  # m from the tool centre back to the palm
    hand_size: tuple[float, float] = (0.204, 0.064)  # m: width along the closing axis, thickness across it

    def friction_on(self, surface: float) -> float:
        """Sliding friction between a pad and a surface: ``pad_friction`` on the default material, and in proportion to
        the surface's own friction on others."""
        return self.pad_friction * (surface / Material().friction)


@attrs.frozen
class RobotDescription:
    """A serial arm with a gripper."""

    name: str
    urdf: str  # the XML text itself: kinematics, inertias, collision and visual shapes
    joints: tuple[JointDescription, ...]
    gripper: GripperDescription
    tool_link: str  # URDF link the tool frame is attached to
    tool_offset: Pose = Pose()  # of the tool frame in that link
    home: tuple[float, ...] = ()  # rad or m, one per joint
    allowed_contacts: tuple[tuple[str, str], ...] = ()  # pairs of links that may touch (neighbours always may)
    reach: float = 0.855  # m from the first joint's axis
    max_contact_force: float = 60.0  # N the hand may press with; more than this felt ends a guarded motion
    tool_speed: float = math.inf  # m/s that planned motions move the tool at, at most
    mesh_folder: str | None = None  # where the URDF's package:// or relative mesh files lie

    @property
    def joint_names(self) -> tuple[str, ...]:
        return tuple(joint.name for joint in self.joints)

    @property
    def position_units(self) -> tuple[str, ...]:
        """Units of the joints' positions for messages, ``m`` for a slide; ``rad`` also where the URDF cannot be read,
        since what a message is about matters more."""
        try:
            joints = read_urdf(self.urdf, self.mesh_folder).joints
        except InvalidArgument:
            joints = ()
        units = {joint.name: joint.units.position for joint in joints}
        return tuple(units.get(name, "rad") for name in self.joint_names)
