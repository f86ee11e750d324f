"""Insides: the room in a container, where its lining is seen, and through which side it is seen."""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.scene.pose import Array, Pose
from memo_perception.cameras.geometry.fitting import Fit, Seen, trimmed_extents

LEAST_POINTS = 25  # of the lining
_LINING = 0.012  # m from a container's outside beyond which a point on it is its lining
_VOTE = 0.5  # share of the lining that must be seen through one side
_WALL = (0.002, 0.04)  # m, thinnest and thickest wall that is assumed where one is not seen
_FACES = [(axis, sign) for axis in range(3) for sign in (-1.0, 1.0)]


@attrs.frozen(eq=False)
class Inside:
    """A room: its box and the outward direction of its open side, base frame."""

    pose: Pose
    size: tuple[float, float, float]
    opening: tuple[float, float, float]


def lining_points(seen: Seen, container: Fit) -> Array:
    """Those points (N, 3) of a container that lie deeper in its box than its outside does."""
    local = container.pose.inverse().apply(seen.points)
    depth = (np.asarray(container.size) / 2 - np.abs(local)).min(axis=1)
    return seen.points[depth > _LINING + 2 * seen.noise]


def fit_inside(lining: Seen, container: Fit) -> Inside | None:
    """The room whose lining is seen; None if it is seen from nowhere in particular. ``lining``: with the silhouettes of
    the pictures that show it, of which only the cameras' places count."""
    if len(lining.points) < LEAST_POINTS or not lining.silhouettes:
        return None
    half = np.asarray(container.size) / 2
    local = container.pose.inverse().apply(lining.points)
    local = local[np.all(np.abs(local) < half + 0.02 + lining.noise, axis=1)]
    if len(local) < LEAST_POINTS:
        return None
    eyes = container.pose.inverse().apply([one.view.frame.pose.position for one in lining.silhouettes])
    votes = np.sum([_exits(local, eye, half) for eye in eyes], axis=0)
    face = int(np.argmax(votes))
    if votes[face] < _VOTE * votes.sum():
        return None
    axis, sign = _FACES[face]
    low, high = _walls(local, half, axis, sign, lining.noise)
    if container.shape == "cylinder" and axis == 2:
        low, high = _square_in_circle(local, low, high, lining.noise)
    pose = container.pose * Pose(tuple((low + high) / 2))
    opening = container.pose.rotation[:, axis] * sign
    size = np.maximum(high - low, 0.002)
    return Inside(pose, tuple(size.tolist()), tuple(opening.tolist()))


def _exits(points: Array, eye: Array, half: Array) -> Array:
    """How many rays from the points to the eye leave the box through each face, shape (6,)."""
    ways = eye - points
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.stack([(sign * half[axis] - points[:, axis]) / ways[:, axis] for axis, sign in _FACES], axis=1)
    reach[~(reach > 1e-6)] = np.inf
    return np.bincount(np.argmin(reach, axis=1), minlength=6).astype(float)


def _walls(local: Array, half: Array, axis: int, sign: float, noise: float) -> tuple[Array, Array]:
    """Lowest and highest corner (3,) of the room in the container's frame. A wall that is not seen is as thick as the
    one opposite."""
    low, high = trimmed_extents(local, noise)
    low, high = np.maximum(low, -half), np.minimum(high, half)
    gaps = np.stack([low + half, half - high], axis=1)  # (axis, side)
    for i in range(3):
        if i == axis:
            continue
        thin = float(np.clip(gaps[i].min(), *_WALL))
        unseen = gaps[i] > 2 * thin + 0.01
        if unseen[0]:
            low[i] = -half[i] + thin
        if unseen[1]:
            high[i] = half[i] - thin
    if sign > 0:
        high[axis] = half[axis]
    else:
        low[axis] = -half[axis]
    return low, high


def _square_in_circle(local: Array, low: Array, high: Array, noise: float) -> tuple[Array, Array]:
    """Of a round container: the largest square that stands in the room."""
    radius = np.percentile(np.hypot(local[:, 0], local[:, 1]), 97) - noise
    side = radius / np.sqrt(2)
    return np.array([-side, -side, low[2]]), np.array([side, side, high[2]])
