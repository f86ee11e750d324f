"""Rigid poses. Positions in metres, orientations as unit quaternions (w, x, y, z), never compared as Euler angles."""

from __future__ import annotations

import math
from collections.abc import Sequence

import attrs
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def _position(value: Sequence[float]) -> tuple[float, float, float]:
    # Written out, since poses are made in the physics loop: a general check takes three times as long.
    try:
        x, y, z = value
        position = (float(x), float(y), float(z))
    except ValueError as error:
        raise ValueError(f"expected 3 finite numbers, got {value!r}") from error
    if not math.isfinite(position[0] + position[1] + position[2]):
        raise ValueError(f"expected 3 finite numbers, got {value!r}")
    return position


def _unit_quaternion(value: Sequence[float]) -> tuple[float, float, float, float]:
    try:
        w, x, y, z = value
        w, x, y, z = float(w), float(x), float(y), float(z)
    except ValueError as error:
        raise ValueError(f"expected 4 finite numbers, got {value!r}") from error
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    if not math.isfinite(norm):
        raise ValueError(f"expected 4 finite numbers, got {value!r}")
    if norm < 1e-9:
        raise ValueError("a quaternion of length zero has no orientation")
    return (w / norm, x / norm, y / norm, z / norm)


@attrs.frozen
class Pose:
    """A position (m) and an orientation (unit quaternion w, x, y, z) of one frame in another (by default the base)."""

    position: tuple[float, float, float] = attrs.field(default=(0.0, 0.0, 0.0), converter=_position)
    orientation: tuple[float, float, float, float] = attrs.field(
        default=(1.0, 0.0, 0.0, 0.0), converter=_unit_quaternion
    )

    @classmethod
    def from_matrix(cls, matrix: Array) -> Pose:
        """Pose of a homogeneous matrix, shape (4, 4), translation in m."""
        return cls(tuple(matrix[:3, 3]), quaternion_from_rotation(matrix[:3, :3]))

    @classmethod
    def from_yaw(cls, position: Sequence[float], yaw: float) -> Pose:
        """Upright pose at ``position`` (m, shape (3,)), turned by ``yaw`` (rad) about +z."""
        return cls(tuple(position), (math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)))

    @property
    def rotation(self) -> Array:
        """Rotation matrix, shape (3, 3); its columns are this frame's axes."""
        w, x, y, z = self.orientation
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    @property
    def matrix(self) -> Array:
        """Homogeneous matrix, shape (4, 4)."""
        result = np.eye(4)
        result[:3, :3] = self.rotation
        result[:3, 3] = self.position
        return result

    def __mul__(self, other: Pose) -> Pose:
        """Composition: ``parent_from_a * a_from_b = parent_from_b``."""
        position = np.asarray(self.position) + self.rotation @ np.asarray(other.position)
        return Pose(tuple(position), multiply_quaternions(self.orientation, other.orientation))

    def inverse(self) -> Pose:
        w, x, y, z = self.orientation
        return Pose(tuple(-(self.rotation.T @ np.asarray(self.position))), (w, -x, -y, -z))

    def apply(self, points: npt.ArrayLike) -> Array:
        """Transform points from this frame to its parent's.

        Args:
            points: points in this frame (m), shape (..., 3).

        Returns:
            The points in the parent frame, of the same shape.
        """
        return np.asarray(points, dtype=float) @ self.rotation.T + np.asarray(self.position)

    def distance(self, other: Pose) -> tuple[float, float]:
        """Distance (m) and angle of rotation (rad, 0 to pi) between this pose and another in the same frame."""
        offset = np.asarray(self.position) - np.asarray(other.position)
        return float(np.linalg.norm(offset)), quaternion_angle(self.orientation, other.orientation)


def multiply_quaternions(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float, float]:
    """Hamilton product of two quaternions (w, x, y, z)."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def quaternion_angle(a: Sequence[float], b: Sequence[float]) -> float:
    """Angle of the rotation between two orientations; a quaternion and its negative are the same orientation.

    Args:
        a: unit quaternion (w, x, y, z).
        b: unit quaternion (w, x, y, z).

    Returns:
        Angle in radians, from 0 to pi.
    """
    dot = abs(sum(p * q for p, q in zip(a, b, strict=True)))
    return 2.0 * math.acos(min(1.0, dot))


def quaternion_from_axis_angle(axis: Sequence[float], angle: float) -> tuple[float, float, float, float]:
    """Quaternion of a right-handed rotation about an axis.

    Args:
        axis: direction of the axis, shape (3,), of any length but zero.
        angle: angle of the rotation (rad).

    Returns:
        Unit quaternion (w, x, y, z).

    Raises:
        ValueError: if the axis has length zero.
    """
    x, y, z = (float(v) for v in axis)
    norm = math.sqrt(x * x + y * y + z * z)
    if norm < 1e-12:
        raise ValueError("a rotation axis of length zero")
    s = math.sin(angle / 2) / norm
    return (math.cos(angle / 2), x * s, y * s, z * s)


def quaternion_from_rotation(rotation: Array) -> tuple[float, float, float, float]:
    """Quaternion of a rotation matrix.

    Args:
        rotation: rotation matrix, shape (3, 3); small deviations from orthogonality are averaged out.

    Returns:
        Unit quaternion (w, x, y, z) with w >= 0.
    """
    m = np.asarray(rotation, dtype=float)
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
            [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], m[0, 0] + m[1, 1] + m[2, 2]],
        ]
    )
    values, vectors = np.linalg.eigh(k / 3.0, UPLO="L")
    x, y, z, w = vectors[:, int(np.argmax(values))]
    sign = -1.0 if w < 0 else 1.0
    return (sign * float(w), sign * float(x), sign * float(y), sign * float(z))


def look_at(eye: Sequence[float], target: Sequence[float]) -> Pose:
    """Camera pose that looks at a point, in the OpenCV convention: +z forward, +x right, +y down.

    Args:
        eye: position of the camera (m), shape (3,).
        target: point in the centre of the image (m), shape (3,), in the same frame and different from ``eye``.

    Returns:
        Pose in the frame of the two points, with the image upright with respect to that frame's +z; a camera that looks
        along z has +x of the frame at the top of its image.
    """
    forward = np.asarray(target, dtype=float) - np.asarray(eye, dtype=float)
    forward /= np.linalg.norm(forward)
    up = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.999 else np.array([1.0, 0.0, 0.0])
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    rotation = np.column_stack([right, np.cross(forward, right), forward])
    return Pose(tuple(float(v) for v in eye), quaternion_from_rotation(rotation))
