"""Kinematics of a serial arm, for many configurations at once.

Pinocchio reads the URDF; the recursion itself runs over batches in numpy, because choosing a branch means solving some
hundreds of inverse-kinematics problems together. Batch arrays are (n, N): n joints, N configurations, N last, so that
every operation runs over contiguous memory. Rotations are (3, 3, N), positions (3, N); base frame, metres, radians.
"""

from __future__ import annotations

from collections.abc import Callable
from xml.etree import ElementTree

import attrs
import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array, Pose, quaternion_from_rotation

POSITION_TOLERANCE = 2e-4  # m; a solution is one within both
ROTATION_TOLERANCE = 1e-3  # rad
_MAXIMUM_STEP = 0.4  # rad a joint may move in one iteration


@attrs.frozen(eq=False)
class Solutions:
    """What ``Kinematics.solve`` found: joints (n, N), their remaining errors (N,), and which are solutions."""

    joints: Array
    position_error: Array  # m
    rotation_error: Array  # rad
    solved: np.ndarray  # bool, (N,)


class Kinematics:
    """Forward and inverse kinematics of the tool frame of a described arm. Raises ``InvalidArgument`` where the
    description does not fit its URDF.

    ``poll`` is called every few milliseconds while something is searched for, here and by all planning that works on
    these kinematics; what it raises (``Stopped``) ends the search.
    """

    def __init__(self, description: RobotDescription, poll: Callable[[], None] = lambda: None) -> None:
        self.description = description
        self.poll = poll
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

    def _read(self, description: RobotDescription) -> None:
        """Fill the chain: constant transforms between joints whose axes are turned onto z."""
        import pinocchio as pin

        self.urdf = _with_angles(description.urdf)
        model = pin.buildModelFromXML(self.urdf)
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
        if not model.existFrame(description.tool_link):
            raise InvalidArgument(
                f"robot {description.name!r}: tool_link", f"the URDF has no link {description.tool_link!r}"
            )
        frame = model.frames[model.getFrameId(description.tool_link)]
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
            model.joints[number].calc(data, np.zeros(1))
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

    # -- forward -----------------------------------------------------------------------------------------------------
    def forward(self, joints: Array) -> tuple[Array, Array]:
        """Tool rotations (3, 3, N) and positions (3, N) for joints (n, N)."""
        columns, position, _, _ = self._chain(joints)
        return columns.transpose(1, 0, 2), position

    def pose(self, joints: Array) -> Pose:
        """The tool's pose for one configuration, shape (n,)."""
        rotation, position = self.forward(np.asarray(joints, dtype=float)[:, None])
        return Pose(tuple(position[:, 0]), quaternion_from_rotation(rotation[:, :, 0]))

    def jacobian(self, joints: Array) -> Array:
        """Of the tool's origin in base axes, linear over angular, shape (6, n), for one configuration (n,)."""
        _columns, position, axes, origins = self._chain(np.asarray(joints, dtype=float)[:, None])
        return self._jacobian(position, axes, origins)[0].T

    def chain(self, joints: Array) -> tuple[Array, Array, Array, Array]:
        """Tool rotations (3, 3, N), tool positions (3, N), joint axes and joint origins (n, 3, N) for joints (n, N)."""
        columns, position, axes, origins = self._chain(joints)
        return columns.transpose(1, 0, 2), position, axes, origins

    def _chain(self, joints: Array) -> tuple[Array, Array, Array, Array]:
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

    def _jacobian(self, position: Array, axes: Array, origins: Array) -> Array:
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

    # -- inverse -----------------------------------------------------------------------------------------------------
    def solve(
        self, seeds: Array, rotation: Array, position: Array, iterations: int = 25, margin: float = 0.01
    ) -> Solutions:
        """Damped least squares from every seed (n, N) to its own goal (3, 3, N), (3, N), inside the joint limits.

        Steps are Levenberg-Marquardt's with the damping of Sugihara (2011), which vanishes with the error, clipped to
        the joint limits drawn in by ``margin`` (rad); the minimal-norm step leaves the
        redundant degree of freedom where the seed had it.
        """
        lower, upper = self.lower + margin, self.upper - margin
        seeds = np.asarray(seeds, dtype=float)
        size = seeds.shape[1]
        goals = np.ascontiguousarray(np.broadcast_to(rotation, (3, 3, size)).transpose(1, 0, 2))
        position = np.broadcast_to(position, (3, size))
        joints = np.clip(seeds, lower[:, None], upper[:, None])
        place_error = np.full(size, np.inf)
        turn_error = np.full(size, np.inf)
        active = np.arange(size)
        for iteration in range(iterations + 1):
            self.poll()
            now = joints[:, active]
            turned, placed, axes, origins = self._chain(now)
            error = np.empty((6, active.size))
            error[:3] = position[:, active] - placed
            error[3:] = _rotation_vectors(turned, goals[:, :, active])
            place_error[active] = np.sqrt((error[:3] ** 2).sum(axis=0))
            turn_error[active] = np.sqrt((error[3:] ** 2).sum(axis=0))
            open_ = (place_error[active] > POSITION_TOLERANCE / 4) | (turn_error[active] > ROTATION_TOLERANCE / 4)
            if iteration == iterations or not open_.any():
                break
            jacobian = self._jacobian(placed, axes, origins)
            if not open_.all():
                active, now, error, jacobian = active[open_], now[:, open_], error[:, open_], jacobian[open_]
            step = _damped_step(jacobian, error)
            largest = np.abs(step).max(axis=0)
            step *= np.minimum(1.0, _MAXIMUM_STEP / np.maximum(largest, 1e-12))
            joints[:, active] = np.clip(now + step, lower[:, None], upper[:, None])
        solved = (place_error < POSITION_TOLERANCE) & (turn_error < ROTATION_TOLERANCE)
        return Solutions(joints, place_error, turn_error, solved)

    def samples(self, count: int, moving: slice = slice(None)) -> Array:
        """Configurations spread evenly over the joint limits, shape (n, count); always the same ones (Halton).
        ``moving``: only these joints are spread, the others stand in the middle."""
        primes = (2, 3, 5, 7, 11, 13, 17, 19, 23)
        unit = np.full((self.count, count), 0.5)
        for number, i in enumerate(range(self.count)[moving]):
            unit[i] = _halton(count, primes[number % len(primes)])
        return self.lower[:, None] + unit * (self.upper - self.lower)[:, None]

    def inverse(self, pose: Pose, seeds: Array | None = None, samples: int = 300) -> Array:
        """Distinct configurations (n, K) that reach ``pose``, from ``seeds`` (n, N) and ``samples`` spread seeds."""
        start = self.samples(samples)
        if seeds is not None:
            start = np.concatenate([seeds, start], axis=1)
        found = self.solve(start, pose.rotation[:, :, None], np.asarray(pose.position)[:, None])
        return thin(found.joints[:, found.solved], 0.15)

    def within_limits(self, joints: Array, tolerance: float = 1e-6) -> bool:
        return bool(np.all(joints >= self.lower - tolerance) and np.all(joints <= self.upper + tolerance))


def thin(joints: Array, distance: float, most: int = 400) -> Array:
    """Those of the configurations (n, N) that differ from all earlier ones by ``distance`` rad in some joint."""
    kept = np.empty((joints.shape[0], 0))
    for i in range(joints.shape[1]):
        one = joints[:, i : i + 1]
        if kept.shape[1] == 0 or np.abs(kept - one).max(axis=0).min() > distance:
            kept = np.concatenate([kept, one], axis=1)
            if kept.shape[1] >= most:
                break
    return kept


def first_of_cells(cells: np.ndarray) -> np.ndarray:
    """Indices, ascending, of the first of each distinct column of whole numbers (m, N)."""
    # One number a column, since sorting columns takes several times as long; two differ with 1 - 2^-64.
    mixed = (cells.astype(np.int64) * _MIXERS[: len(cells), None]).sum(axis=0)
    _, first = np.unique(mixed, return_index=True)
    first.sort()
    return first


def _with_angles(urdf: str) -> str:
    """The URDF with continuous joints as revolute ones. Pinocchio stores a continuous joint as cosine and sine, which
    would make configurations longer than the arm has joints; the limits that count are the description's."""
    robot = ElementTree.fromstring(urdf)
    for joint in robot.iter("joint"):
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            if limit is None:
                limit = ElementTree.SubElement(joint, "limit", effort="0", velocity="0")
            limit.set("lower", str(-2 * np.pi))
            limit.set("upper", str(2 * np.pi))
    return ElementTree.tostring(robot, encoding="unicode")


def _z_onto(axis: Array) -> Array:
    """A rotation whose z column is ``axis``."""
    z = axis / np.linalg.norm(axis)
    x = np.cross([0.0, 1.0, 0.0], z) if abs(z[1]) < 0.9 else np.cross(z, [1.0, 0.0, 0.0])
    if z[2] > 0.999999:
        return np.eye(3)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _halton(count: int, base: int) -> Array:
    result = np.zeros(count)
    index = np.arange(1, count + 1)
    fraction = 1.0
    while index.any():
        fraction /= base
        result += fraction * (index % base)
        index = index // base
    return result


def _onwards(rotation: Array, translation: Array) -> Array:
    """Matrix (4, 3) that maps a frame's columns to the next frame's columns and, last, the translation to it."""
    return np.vstack([rotation.T, translation])


_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])


def _rotation_vectors(current: Array, goal: Array) -> Array:
    """Rotation vectors (3, N), base axes, that turn ``current`` into ``goal``, both columns first (3, 3, N)."""
    axis = 0.5 * (current[:, _NEXT] * goal[:, _LAST] - current[:, _LAST] * goal[:, _NEXT]).sum(axis=0)
    trace = (current * goal).sum(axis=(0, 1))
    sine = np.sqrt((axis**2).sum(axis=0))
    angle = np.arctan2(sine, (trace - 1.0) / 2.0)
    scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
    # At half a turn the formula gives no axis; any axis lets the iteration continue.
    stuck = (sine <= 1e-9) & (trace < 0)
    axis[0, stuck] = 1.0
    return axis * scale


def _damped_step(jacobian: Array, error: Array) -> Array:
    """J^T (J J^T + d I)^-1 e for a batch: J^T (N, n, 6), e (6, N) -> (n, N)."""
    damping = np.minimum(0.5 * (error**2).sum(axis=0), 0.05) + 1e-6
    square = jacobian.transpose(0, 2, 1) @ jacobian
    square[:, _SIX, _SIX] += damping[:, None]
    return (jacobian @ np.linalg.solve(square, error.T[:, :, None]))[:, :, 0].T


_SIX = np.arange(6)
_MIXERS = np.random.default_rng(1).integers(-(2**62), 2**62, 64) * 2 + 1
