"""Kinematics of a serial arm, for many configurations at once.

Pinocchio reads the URDF; the recursion itself runs over batches in numpy, because choosing a branch means solving some
hundreds of inverse-kinematics problems together. Batch arrays are (n, N): n joints, N configurations, N last, so that
every operation runs over contiguous memory. Rotations are (3, 3, N), positions (3, N); base frame, metres, radians.
"""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.interfaces.robot import RobotDescription
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

        model = pin.buildModelFromXML(description.urdf)
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
        self._fixed: list[tuple[Array, Array]] = []
        self._revolute: list[bool] = []
        for number in ids:
            if model.parents[number] != above:
                raise InvalidArgument(
                    f"robot {description.name!r}: joints",
                    f"{model.names[number]!r} does not follow {model.names[above]!r}",
                    "the joints of one serial chain from the base to the tool, in order",
                )
            data = model.joints[number].createData()
            model.joints[number].calc(
                data, np.zeros(model.joints[number].nq) if model.joints[number].nq == 1 else np.array([1.0, 0.0])
            )
            motion = np.asarray(data.S).reshape(6, -1)[:, 0]
            revolute = bool(np.linalg.norm(motion[3:]) > 0.5)
            axis = motion[3:] if revolute else motion[:3]
            placement = model.jointPlacements[number]
            onto = _z_onto(axis)
            self._fixed.append((turn.T @ placement.rotation @ onto, turn.T @ placement.translation))
            self._revolute.append(revolute)
            turn = onto
            above = number
        if frame.parentJoint != above:
            raise InvalidArgument(
                f"robot {description.name!r}: tool_link",
                f"{description.tool_link!r} is not moved by the last joint {model.names[above]!r}",
            )
        tool = np.asarray(frame.placement.homogeneous) @ description.tool_offset.matrix
        self._tool = (turn.T @ tool[:3, :3], turn.T @ tool[:3, 3])
        self.joint_ids = tuple(ids)
        self.shoulder = np.asarray(model.jointPlacements[ids[0]].translation).copy()

    # -- forward -----------------------------------------------------------------------------------------------------
    def forward(self, joints: Array) -> tuple[Array, Array]:
        """Tool rotations (3, 3, N) and positions (3, N) for joints (n, N)."""
        rotation, position, _, _ = self._chain(joints)
        return rotation, position

    def pose(self, joints: Array) -> Pose:
        """The tool's pose for one configuration, shape (n,)."""
        rotation, position = self.forward(np.asarray(joints, dtype=float)[:, None])
        return Pose(tuple(position[:, 0]), quaternion_from_rotation(rotation[:, :, 0]))

    def jacobian(self, joints: Array) -> Array:
        """Of the tool's origin in base axes, linear over angular, shape (6, n), for one configuration (n,)."""
        _rotation, position, axes, origins = self._chain(np.asarray(joints, dtype=float)[:, None])
        return self._jacobian(position, axes, origins)[:, :, 0]

    def _chain(self, joints: Array) -> tuple[Array, Array, Array, Array]:
        """Tool rotation, tool position, joint axes (n, 3, N), joint origins (n, 3, N)."""
        count, size = joints.shape
        axes = np.empty((count, 3, size))
        origins = np.empty((count, 3, size))
        rotation = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, size))
        position = np.zeros((3, size))
        cosine, sine = np.cos(joints), np.sin(joints)
        for i, (turn, offset) in enumerate(self._fixed):
            position = position + np.matmul(offset, rotation)
            rotation = np.matmul(turn.T, rotation)
            axes[i] = rotation[:, 2]
            origins[i] = position
            if self._revolute[i]:
                turned = np.empty((3, 3, size))
                turned[:, 0] = rotation[:, 0] * cosine[i] + rotation[:, 1] * sine[i]
                turned[:, 1] = rotation[:, 1] * cosine[i] - rotation[:, 0] * sine[i]
                turned[:, 2] = rotation[:, 2]
                rotation = turned
            else:
                position = position + rotation[:, 2] * joints[i]
        turn, offset = self._tool
        position = position + np.matmul(offset, rotation)
        return np.matmul(turn.T, rotation), position, axes, origins

    def _jacobian(self, position: Array, axes: Array, origins: Array) -> Array:
        """(6, n, N)"""
        arm = position - origins
        result = np.empty((6, axes.shape[0], axes.shape[2]))
        result[0] = axes[:, 1] * arm[:, 2] - axes[:, 2] * arm[:, 1]
        result[1] = axes[:, 2] * arm[:, 0] - axes[:, 0] * arm[:, 2]
        result[2] = axes[:, 0] * arm[:, 1] - axes[:, 1] * arm[:, 0]
        result[3:] = axes.transpose(1, 0, 2)
        for i, revolute in enumerate(self._revolute):
            if not revolute:
                result[:3, i] = axes[i]
                result[3:, i] = 0.0
        return result

    # -- inverse -----------------------------------------------------------------------------------------------------
    def solve(
        self, seeds: Array, rotation: Array, position: Array, iterations: int = 25, margin: float = 0.01
    ) -> Solutions:
        """Damped least squares from every seed (n, N) to its own goal (3, 3, N), (3, N), inside the joint limits.

        Steps are Levenberg-Marquardt's with the damping of Sugihara (2011), which vanishes with the error, clipped to
        the joint limits drawn in by ``margin`` (rad); the minimal-norm step keeps the redundancy where the seed had it.
        """
        lower, upper = self.lower + margin, self.upper - margin
        seeds = np.asarray(seeds, dtype=float)
        size = seeds.shape[1]
        rotation = np.broadcast_to(rotation, (3, 3, size))
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
            error[3:] = _rotation_vectors(turned, rotation[:, :, active])
            place_error[active] = np.sqrt((error[:3] ** 2).sum(axis=0))
            turn_error[active] = np.sqrt((error[3:] ** 2).sum(axis=0))
            open_ = (place_error[active] > POSITION_TOLERANCE / 4) | (turn_error[active] > ROTATION_TOLERANCE / 4)
            if iteration == iterations or not open_.any():
                break
            jacobian = self._jacobian(placed, axes, origins)
            if not open_.all():
                active, now, error, jacobian = active[open_], now[:, open_], error[:, open_], jacobian[:, :, open_]
            step = _damped_step(jacobian, error)
            largest = np.abs(step).max(axis=0)
            step *= np.minimum(1.0, _MAXIMUM_STEP / np.maximum(largest, 1e-12))
            joints[:, active] = np.clip(now + step, lower[:, None], upper[:, None])
        solved = (place_error < POSITION_TOLERANCE) & (turn_error < ROTATION_TOLERANCE)
        return Solutions(joints, place_error, turn_error, solved)

    def samples(self, count: int) -> Array:
        """Configurations spread evenly over the joint limits, shape (n, count); always the same ones (Halton)."""
        primes = (2, 3, 5, 7, 11, 13, 17, 19, 23)
        unit = np.array([_halton(count, primes[i % len(primes)]) for i in range(self.count)])
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


def _rotation_vectors(current: Array, goal: Array) -> Array:
    """Rotation vectors (3, N), base axes, that turn ``current`` into ``goal``, both (3, 3, N)."""
    axis = np.zeros((3, current.shape[2]))
    trace = np.zeros(current.shape[2])
    for i in range(3):
        a, b = current[:, i], goal[:, i]
        axis[0] += a[1] * b[2] - a[2] * b[1]
        axis[1] += a[2] * b[0] - a[0] * b[2]
        axis[2] += a[0] * b[1] - a[1] * b[0]
        trace += (a * b).sum(axis=0)
    axis *= 0.5
    sine = np.sqrt((axis**2).sum(axis=0))
    angle = np.arctan2(sine, (trace - 1.0) / 2.0)
    scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
    # Half a turn has no axis in this formula; any axis gets the iteration off that spot.
    stuck = (sine <= 1e-9) & (trace < 0)
    axis[0, stuck] = 1.0
    return axis * scale


def _damped_step(jacobian: Array, error: Array) -> Array:
    """J^T (J J^T + d I)^-1 e for a batch: (6, n, N), (6, N) -> (n, N), by a Cholesky factorisation over the batch."""
    damping = np.minimum(0.5 * (error**2).sum(axis=0), 0.05) + 1e-6
    lower: list[list[Array]] = []
    for i in range(6):
        row: list[Array] = []
        for j in range(i + 1):
            value = np.einsum("kn,kn->n", jacobian[i], jacobian[j])
            if i == j:
                value = value + damping
            for k in range(j):
                value = value - row[k] * (lower[j][k] if j < i else row[k])
            row.append(np.sqrt(np.maximum(value, 1e-12)) if i == j else value / lower[j][j])
        lower.append(row)
    solution: list[Array] = []
    for i in range(6):
        value = error[i]
        for k in range(i):
            value = value - lower[i][k] * solution[k]
        solution.append(value / lower[i][i])
    for i in reversed(range(6)):
        value = solution[i]
        for k in range(i + 1, 6):
            value = value - lower[k][i] * solution[k]
        solution[i] = value / lower[i][i]
    return np.einsum("ikn,in->kn", jacobian, np.array(solution))
