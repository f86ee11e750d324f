"""Forward kinematics and Jacobian of a serial arm, for many configurations at once.

Pinocchio reads the URDF; the recursion itself runs over batches in numpy, because choosing a branch means solving
hundreds of inverse-kinematics problems together. Batch arrays are (n, N): n joints, N configurations, N last, so that
every operation runs over contiguous memory. Rotations are (3, 3, N), positions (3, N); base frame, metres, radians.
"""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree

import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.robot.description import RobotDescription
from memo_core.robot.urdf.checks import check_limits
from memo_core.robot.urdf.reading import find_mesh
from memo_core.scene.pose import Array, Pose, quaternion_from_rotation


class ForwardKinematics:
    """Poses and Jacobians of the tool frame of a described arm. Raises ``InvalidArgument`` if the description does not
    fit its URDF."""

    def __init__(self, description: RobotDescription) -> None:
        check_limits(description)
        self.description = description
        self.lower = np.array([joint.lower for joint in description.joints])
        self.upper = np.array([joint.upper for joint in description.joints])
        self.velocity = np.array([joint.velocity for joint in description.joints])
        self.acceleration = np.array([joint.acceleration for joint in description.joints])
        self.jerk = np.array([joint.jerk for joint in description.joints])
        self.home = np.array(description.home) if description.home else (self.lower + self.upper) / 2
        if self.home.shape != self.lower.shape:
            raise InvalidArgument(
                f"robot {description.name!r}: home",
                f"has {len(description.home)} values",
                f"one for each of {len(self.lower)} joints",
            )
        self._read(description)

    @property
    def count(self) -> int:
        """Number of arm joints n."""
        return len(self.lower)

    def within_limits(self, joints: Array, tolerance: float = 1e-6) -> bool:
        return bool(np.all(joints >= self.lower - tolerance) and np.all(joints <= self.upper + tolerance))

    def _read(self, description: RobotDescription) -> None:
        """Fill the chain: constant transforms between joints whose axes are turned onto z."""
        import pinocchio as pin

        self.urdf = _with_angles(description)
        try:
            model = pin.buildModelFromXML(self.urdf)
        except (ValueError, RuntimeError) as error:
            problem = f"Pinocchio cannot read it ({' '.join(str(error).split())})"
            raise InvalidArgument(f"URDF of {description.name!r}", problem, "what its parser says above") from None
        self.model = model
        ids = []
        for joint in description.joints:
            if not model.existJointName(joint.name):
                raise InvalidArgument(
                    f"robot {description.name!r}: joint {joint.name!r}",
                    "is not a moving joint of the URDF",
                    ", ".join(list(model.names)[1:]),
                )
            ids.append(model.getJointId(joint.name))
        frame = tool_link_frame(model, description)
        above = 0
        turn = np.eye(3)
        self._onwards: list[Array] = []
        self.revolute: list[bool] = []
        for number in ids:
            if model.parents[number] != above:
                raise InvalidArgument(
                    f"robot {description.name!r}: joints",
                    f"{model.names[number]!r} does not follow {model.names[above]!r}",
                    "the joints of one serial chain from the base to the tool, in order",
                )
            data = model.joints[number].createData()
            model.joints[number].calc(data, np.zeros(model.nq))  # it reads its own part of all positions
            motion = np.asarray(data.S).reshape(6, -1)[:, 0]
            revolute = bool(np.linalg.norm(motion[3:]) > 0.5)
            axis = motion[3:] if revolute else motion[:3]
            placement = model.jointPlacements[number]
            onto = _z_onto(axis)
            self._onwards.append(_onwards(turn.T @ placement.rotation @ onto, turn.T @ placement.translation))
            self.revolute.append(revolute)
            turn = onto
            above = number
        if frame.parentJoint != above:
            raise InvalidArgument(
                f"robot {description.name!r}: tool_link",
                f"{description.tool_link!r} is not moved by the last joint {model.names[above]!r}",
            )
        tool = np.asarray(frame.placement.homogeneous) @ description.tool_offset.matrix
        self._onwards_to_tool = _onwards(turn.T @ tool[:3, :3], turn.T @ tool[:3, 3])
        self.joint_ids = tuple(ids)
        parts = [*self._onwards, self._onwards_to_tool, self.lower, self.upper, np.array(self.revolute, dtype=float)]
        self.fingerprint = b"".join(np.asarray(part).tobytes() for part in parts)
        self.shoulder = np.asarray(model.jointPlacements[ids[0]].translation).copy()

    def forward(self, joints: Array) -> tuple[Array, Array]:
        """Tool rotations (3, 3, N) and positions (3, N) for joints (n, N)."""
        columns, position, _, _ = self.propagate(joints)
        return columns.transpose(1, 0, 2), position

    def pose(self, joints: Array) -> Pose:
        """The tool's pose for one configuration, shape (n,)."""
        rotation, position = self.forward(np.asarray(joints, dtype=float)[:, None])
        return Pose(tuple(position[:, 0]), quaternion_from_rotation(rotation[:, :, 0]))

    def jacobian(self, joints: Array) -> Array:
        """Of the tool's origin in base axes, linear over angular, shape (6, n), for one configuration (n,)."""
        _columns, position, axes, origins = self.propagate(np.asarray(joints, dtype=float)[:, None])
        return self.jacobians(position, axes, origins)[0].T

    def chain(self, joints: Array) -> tuple[Array, Array, Array, Array]:
        """Tool rotations (3, 3, N), tool positions (3, N), joint axes and joint origins (n, 3, N) for joints (n, N)."""
        columns, position, axes, origins = self.propagate(joints)
        return columns.transpose(1, 0, 2), position, axes, origins

    def propagate(self, joints: Array) -> tuple[Array, Array, Array, Array]:
        """Columns of the tool's rotation (3, 3, N), the column's number first; tool position (3, N); joint axes and
        joint origins (n, 3, N)."""
        count, size = joints.shape
        axes = np.empty((count, 3, size))
        origins = np.empty((count, 3, size))
        columns = np.repeat(np.eye(3)[:, :, None], size, axis=2)
        position = np.zeros((3, size))
        cosine, sine = np.cos(joints), np.sin(joints)
        for i, onwards in enumerate(self._onwards):
            # One product for columns and translation: small arrays cost by the call.
            moved = (onwards @ columns.reshape(3, -1)).reshape(4, 3, size)
            columns, position = moved[:3], position + moved[3]
            axes[i] = columns[2]
            origins[i] = position
            if self.revolute[i]:
                turned = columns[:2] * cosine[i]
                across = columns[:2] * sine[i]
                columns[0] = turned[0] + across[1]
                columns[1] = turned[1] - across[0]
            else:
                position = position + columns[2] * joints[i]
        moved = (self._onwards_to_tool @ columns.reshape(3, -1)).reshape(4, 3, size)
        return moved[:3], position + moved[3], axes, origins

    def jacobians(self, position: Array, axes: Array, origins: Array) -> Array:
        """Transposed, configurations first: (N, n, 6)."""
        count, _, size = axes.shape
        arm = position - origins
        result = np.empty((count, 6, size))
        result[:, 0] = axes[:, 1] * arm[:, 2] - axes[:, 2] * arm[:, 1]
        result[:, 1] = axes[:, 2] * arm[:, 0] - axes[:, 0] * arm[:, 2]
        result[:, 2] = axes[:, 0] * arm[:, 1] - axes[:, 1] * arm[:, 0]
        result[:, 3:] = axes
        for i, revolute in enumerate(self.revolute):
            if not revolute:
                result[i, :3] = axes[i]
                result[i, 3:] = 0.0
        return np.ascontiguousarray(result.transpose(2, 0, 1))


def tool_link_frame(model: Any, description: RobotDescription) -> Any:
    """Pinocchio's frame of the tool link. Raises ``InvalidArgument`` if the URDF has no such link."""
    from pinocchio import FrameType

    # A joint may bear the name of a link; only the type tells their frames apart.
    name = description.tool_link
    if not model.existFrame(name, FrameType.BODY):
        raise InvalidArgument(f"robot {description.name!r}: tool_link", f"the URDF has no link {name!r}")
    return model.frames[model.getFrameId(name, FrameType.BODY)]


def _with_angles(description: RobotDescription) -> str:
    """The URDF as Pinocchio is to read it. Continuous joints become revolute ones: Pinocchio stores a continuous joint
    as cosine and sine, which would make configurations longer than the arm has joints; the limits that count are the
    description's. Looks are left out, since its parser refuses materials that are defined twice. Meshes are named by
    where they lie, so that Pinocchio finds those that the simulators find."""
    robot = ElementTree.fromstring(description.urdf)
    robot.set("name", robot.get("name") or "robot")
    for joint in robot.iter("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = ElementTree.SubElement(joint, "limit", effort="0", velocity="0")
            limit.set("lower", str(-2 * np.pi))
            limit.set("upper", str(2 * np.pi))
    for material in robot.findall("material"):
        robot.remove(material)
    for link in robot.iter("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        for mesh in link.iterfind("collision/geometry/mesh"):
            where = f"URDF link {link.get('name')!r}"
            found = find_mesh(where, mesh.get("filename", ""), description.mesh_folder)
            mesh.set("filename", f"file://{found.resolve()}")
    return ElementTree.tostring(robot, encoding="unicode")


def _z_onto(axis: Array) -> Array:
    """A rotation whose z column is ``axis``."""
    z = axis / np.linalg.norm(axis)
    x = np.cross([0.0, 1.0, 0.0], z) if abs(z[1]) < 0.9 else np.cross(z, [1.0, 0.0, 0.0])
    if z[2] > 0.999999:
        return np.eye(3)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _onwards(rotation: Array, translation: Array) -> Array:
    """Matrix (4, 3) that maps a frame's columns to the next frame's columns and, in its last row, to the
    translation."""
    return np.vstack([rotation.T, translation])
