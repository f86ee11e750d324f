"""Seeds for inverse kinematics close to the goal, from a table of sampled configurations and their tool poses.

A search from arbitrary configurations needs some tens of iterations and often fails. Here the goal is looked up first.
What the first and the last joint do to the tool is known in closed form where they turn: the one turns everything about
its own axis, the other only the tool about its last axis. So the table is over the joints between them and over what
those decide: how far and how high the last axis stands, and which way it points."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from memo_core.arm.inverse_kinematics import Kinematics, first_of_cells
from memo_core.scene.pose import Array

_COUNT = 16384
_CHUNK = 2048  # configurations between two polls
_POINTING = 0.4  # m that one radian of another direction counts as
_POOL = 4  # times as many of the nearest are looked at as are wanted
_CELL = 0.6  # rad; of those in one cell of the joints only the nearest is taken
_BEYOND = 0.3  # rad by which a closed-form joint may miss its limits

_tables: dict[bytes, Seeds] = {}


def seeds_of(kinematics: Kinematics) -> Seeds:
    """The table of this arm; every arm of the process with the same chain and limits has the same one."""
    key = kinematics.fingerprint
    if key not in _tables:
        _tables[key] = Seeds(kinematics)
    return _tables[key]


class Seeds:
    """Looks up configurations of one arm. Deterministic; filling the table takes some tens of milliseconds, once."""

    def __init__(self, kinematics: Kinematics) -> None:
        self._lower, self._upper = kinematics.lower.copy(), kinematics.upper.copy()
        self._between = len(self._lower) > 2 and kinematics.revolute[0] and kinematics.revolute[-1]
        chunks = []
        if not self._between:
            self._joints = kinematics.samples(_COUNT)
            for first in range(0, _COUNT, _CHUNK):
                kinematics.poll()
                chunks.append(_pose_features(*kinematics.forward(self._joints[:, first : first + _CHUNK])))
            self._features = np.concatenate(chunks, axis=1)
            self._square = (self._features**2).sum(axis=0)
            return
        self._joints = kinematics.samples(_COUNT, slice(1, -1))
        self._joints[[0, -1]] = 0.0
        azimuths, rotations = [], []
        for first in range(0, _COUNT, _CHUNK):
            kinematics.poll()
            rotation, position, axes, origins = kinematics.chain(self._joints[:, first : first + _CHUNK])
            if first == 0:
                self._base, self._foot = _frame_on(axes[0, :, 0]), origins[0, :, 0].copy()
                self._axis = rotation[:, :, 0].T @ axes[-1, :, 0]  # in the tool's frame, as is a point on it
                self._point = rotation[:, :, 0].T @ (origins[-1, :, 0] - position[:, 0])
            features, azimuth = self._axis_features(axes[-1], origins[-1])
            chunks.append(features)
            azimuths.append(azimuth)
            rotations.append(np.einsum("ji,jkn->ikn", self._base, rotation))
        # Whole turns of both that the limits allow, the least first.
        ends = list(zip(self._lower[[0, -1]], self._upper[[0, -1]], strict=True))
        ways = [[0, *([1] if upper > np.pi else []), *([-1] if lower < -np.pi else [])] for lower, upper in ends]
        self._turns = sorted(itertools.product(*ways), key=lambda turns: sum(map(abs, turns)))
        self._features = np.concatenate(chunks, axis=1)
        self._square = (self._features**2).sum(axis=0)
        self._azimuths = np.concatenate(azimuths)
        self._rotations = np.concatenate(rotations, axis=2)

    def near(
        self, rotation: Array, position: Array, most: int, poll: Callable[[], None] = lambda: None
    ) -> tuple[Array, Array]:
        """Configurations (n, M) whose tool is near goals (3, 3, K), (3, K), for each goal ``most`` at most, and which
        goal (M,) each is for. ``poll`` as in ``Kinematics``."""
        if self._between:
            axis, point = np.einsum("ijk,j->ik", rotation, self._axis), np.einsum("ijk,j->ik", rotation, self._point)
            wanted, azimuths = self._axis_features(axis, position + point)
        else:
            wanted, azimuths = _pose_features(rotation, position), np.zeros(position.shape[1])
        joints, which = [], []
        for goal in range(position.shape[1]):
            poll()
            far = self._square - 2.0 * wanted[:, goal] @ self._features
            pool = np.argpartition(far, most * _POOL)[: most * _POOL]
            pool = pool[np.lexsort((pool, far[pool]))]
            found = self._joints[:, pool]
            if self._between:
                found = self._closed(pool, self._base.T @ rotation[:, :, goal], azimuths[goal])
            found = _spread(found, most)
            joints.append(found)
            which.append(np.full(found.shape[1], goal))
        return np.concatenate(joints, axis=1), np.concatenate(which)

    def _axis_features(self, axes: Array, points: Array) -> tuple[Array, Array]:
        """What turning about the first axis leaves of last axes (3, N) through points (3, N), in m: (5, N), and how far
        (rad) each is turned about it (N,)."""
        x, y, z = self._base.T @ (points - self._foot[:, None])
        azimuth = np.arctan2(y, x)
        cosine, sine = np.cos(azimuth), np.sin(azimuth)
        u, v, w = self._base.T @ axes
        pointing = _POINTING * np.array([u * cosine + v * sine, v * cosine - u * sine, w])
        return np.concatenate([[np.hypot(x, y), z], pointing]), azimuth

    def _closed(self, pool: np.ndarray, rotation: Array, azimuth: float) -> Array:
        """Configurations (n, M) of the pool with the first and last joint set for a goal's rotation (3, 3), in the
        first axis's frame; what lies too far outside the limits is left out."""
        first = azimuth - self._azimuths[pool]
        cosine, sine = np.cos(first), np.sin(first)
        turned = self._rotations[:, :, pool]
        turned = np.stack([turned[0] * cosine - turned[1] * sine, turned[0] * sine + turned[1] * cosine, turned[2]])
        left = np.einsum("jin,jk->ikn", turned, rotation)
        across = np.array([left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1]])
        along = left[0, 0] + left[1, 1] + left[2, 2] - np.einsum("i,ijn,j->n", self._axis, left, self._axis)
        last = np.arctan2(self._axis @ across, along)
        found, rank = [], []
        for turns in self._turns:
            joints = self._joints[:, pool]
            ends = _wrapped(np.array([first, last])) + 2 * np.pi * np.array(turns)[:, None]
            joints[[0, -1]] = np.clip(ends, self._lower[[0, -1], None], self._upper[[0, -1], None])
            near = np.flatnonzero(np.abs(joints[[0, -1]] - ends).max(axis=0) < _BEYOND)
            found.append(joints[:, near])
            rank.append(near)
        return np.concatenate(found, axis=1)[:, np.argsort(np.concatenate(rank), kind="stable")]


def _spread(joints: Array, most: int) -> Array:
    """The first of every cell of joint space, the nearest of them, ``most`` at most."""
    return joints[:, first_of_cells(np.round(joints / _CELL))[:most]]


def _pose_features(rotation: Array, position: Array) -> Array:
    """(12, N) in m, so that near poses are near."""
    return np.concatenate([position, _POINTING / np.sqrt(2) * rotation.reshape(9, -1)])


def _frame_on(axis: Array) -> Array:
    """A rotation (3, 3) whose z column is ``axis``."""
    aside = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(aside, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def _wrapped(angle: Array) -> Array:
    return (angle + np.pi) % (2 * np.pi) - np.pi
