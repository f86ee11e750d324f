"""Cartesian paths of the tool: straight pieces between waypoints with interpolated orientation."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from memo_core.scene.pose import Array, Pose

TURNING_LENGTH = 0.25  # m of path that one radian of turning counts as


class CartesianPath:
    """Poses over a path parameter s (m): s grows by a piece's length or by ``TURNING_LENGTH`` times its rotation angle,
    whichever is more."""

    def __init__(self, poses: Sequence[Pose]) -> None:
        kept = [poses[0]]
        self._places = [0]
        for pose in poses[1:]:
            if _extent(kept[-1], pose) > 1e-7:
                kept.append(pose)
            self._places.append(len(kept) - 1)
        self.poses = tuple(kept)
        self._positions = np.array([pose.position for pose in kept])
        quaternions = np.array([pose.orientation for pose in kept])
        for i in range(1, len(kept)):
            if quaternions[i] @ quaternions[i - 1] < 0:
                quaternions[i] *= -1
        self._quaternions = quaternions
        self.knots = np.concatenate([[0.0], np.cumsum([_extent(a, b) for a, b in itertools.pairwise(kept)])])

    @property
    def length(self) -> float:
        return float(self.knots[-1])

    def parameter(self, number: int) -> float:
        """s at the pose with this index in the list from which the path was made."""
        return float(self.knots[self._places[number]])

    def grid(self, step: float, most: int = 10_000) -> Array:
        """Parameters from 0 to the end, evenly spaced by at most ``step``, at most ``most`` of them."""
        count = min(most, max(1, int(np.ceil(self.length / step))) + 1) if self.length > 0 else 1
        return np.linspace(0.0, self.length, count)

    def at(self, s: Array, tilt: Array | float = 0.0) -> tuple[Array, Array]:
        """Rotations (3, 3, N) and positions (3, N) at parameters (N,), tilted about the tool's y axis (rad)."""
        s = np.asarray(s, dtype=float)
        if len(self.poses) == 1:
            position = np.repeat(self._positions[0][:, None], len(s), axis=1)
            quaternion = np.repeat(self._quaternions[0][:, None], len(s), axis=1)
        else:
            piece = np.clip(np.searchsorted(self.knots, s, side="right") - 1, 0, len(self.poses) - 2)
            part = np.clip((s - self.knots[piece]) / (self.knots[piece + 1] - self.knots[piece]), 0.0, 1.0)
            position = (self._positions[piece] * (1 - part)[:, None] + self._positions[piece + 1] * part[:, None]).T
            quaternion = _slerp(self._quaternions[piece].T, self._quaternions[piece + 1].T, part)
        return tilted(_rotations(quaternion), tilt), position

    def pose(self, s: float) -> Pose:
        """The untilted pose at one parameter."""
        rotation, position = self.at(np.array([s]))
        matrix = np.eye(4)
        matrix[:3, :3] = rotation[:, :, 0]
        matrix[:3, 3] = position[:, 0]
        return Pose.from_matrix(matrix)


def tilted(rotation: Array, tilt: Array | float) -> Array:
    """Rotations (3, 3, N), rotated about their own y axis by ``tilt`` (N,) or one number (rad)."""
    c, s = np.cos(tilt), np.sin(tilt)
    return np.stack(
        [rotation[:, 0] * c - rotation[:, 2] * s, rotation[:, 1], rotation[:, 0] * s + rotation[:, 2] * c], axis=1
    )


def turns_between(nominal: Pose, actual: Pose) -> tuple[float, float, float]:
    """Angles (a, b, c) about the x, then the turned y, then the turned z axis of the tool (rad) that turn ``nominal``
    into ``actual``: b is a tilt about the closing direction, a the rotation of a bar between the fingers."""
    relative = nominal.rotation.T @ actual.rotation
    b = float(np.arcsin(np.clip(relative[0, 2], -1.0, 1.0)))
    a = float(np.arctan2(-relative[1, 2], relative[2, 2]))
    c = float(np.arctan2(-relative[0, 1], relative[0, 0]))
    return a, b, c


def turned_about_x(pose: Pose, angle: float) -> Pose:
    """The pose turned about its own x axis (rad)."""
    return pose * Pose(orientation=(float(np.cos(angle / 2)), float(np.sin(angle / 2)), 0.0, 0.0))


def lagging(poses: Sequence[Pose], grasp: int, share: float, most: float) -> list[Pose]:
    """Poses after the grasp in which the hand rotates less about its own x axis than the door does, by a share of the
    rotation and at most by ``most`` (rad): a round bar can rotate between the fingers."""
    result = list(poses[: grasp + 1])
    for pose in poses[grasp + 1 :]:
        angle = turns_between(poses[grasp], pose)[0]
        result.append(turned_about_x(pose, -float(np.clip(share * angle, -most, most))))
    return result


def _extent(a: Pose, b: Pose) -> float:
    distance, angle = a.distance(b)
    return max(distance, TURNING_LENGTH * angle)


def _slerp(a: Array, b: Array, part: Array) -> Array:
    dot = np.clip((a * b).sum(axis=0), -1.0, 1.0)
    angle = np.arccos(dot)
    sine = np.sin(angle)
    near = sine < 1e-6
    safe = np.where(near, 1.0, sine)
    first = np.where(near, 1 - part, np.sin((1 - part) * angle) / safe)
    second = np.where(near, part, np.sin(part * angle) / safe)
    result = first * a + second * b
    return result / np.sqrt((result**2).sum(axis=0))


def _rotations(quaternion: Array) -> Array:
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
