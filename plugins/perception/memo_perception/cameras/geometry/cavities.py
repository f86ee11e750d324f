"""Insides: the room in a container, where its lining is seen, and through which side it is seen."""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.plugin import Array, Pose
from memo_perception.cameras.geometry.fitting import Fit, Seen, extents

LEAST_POINTS = 25  # of the lining
_LINING = 0.012  # m from the outside of a container beyond which a place is in its room, not its wall
_BEFORE = 0.02  # m
_VOTE = 0.5  # share of the lining that must be seen through one side
_AT_WALL = 0.004  # m from the end of a lining in which the points of a wall lie
_CROWDED = 0.03  # share of the points there, besides twice the usual one, that makes a wall of them
_WALL = (0.002, 0.04)  # m, thinnest and thickest wall that is assumed where one is not seen
_FACES = [(axis, sign) for axis in range(3) for sign in (-1.0, 1.0)]


@attrs.frozen(eq=False)
class Inside:
    """A room: its box and the outward direction of its open side, base frame."""

    pose: Pose
    size: tuple[float, float, float]
    opening: tuple[float, float, float]


def is_lining(seen: Seen, container: Fit) -> np.ndarray:
    """Which points (N,) of a container line its room: a little before them, seen by the camera, is deep in its box."""
    eyes = np.array([one.view.frame.pose.position for one in seen.silhouettes])[seen.cameras]
    rays = eyes - seen.points
    before = seen.points + _BEFORE * rays / np.linalg.norm(rays, axis=1, keepdims=True)
    depth = (np.asarray(container.size) / 2 - np.abs(container.pose.inverse().apply(before))).min(axis=1)
    return depth > _LINING + seen.noise


def fit_inside(lining: Seen, container: Fit) -> Inside | None:
    """The room whose lining is seen; None if it is seen from nowhere in particular. ``lining``: with the silhouettes of
    the pictures that show it, of which only the cameras' places count."""
    if len(lining.points) < LEAST_POINTS or not lining.silhouettes:
        return None
    half = np.asarray(container.size) / 2
    local = container.pose.inverse().apply(lining.points)
    near = np.all(np.abs(local) < half + 0.02 + lining.noise, axis=1)
    if np.count_nonzero(near) < LEAST_POINTS:
        return None
    local, cameras = local[near], lining.cameras[near]
    eyes = container.pose.inverse().apply([one.view.frame.pose.position for one in lining.silhouettes])
    votes = np.sum([_exits(local[cameras == i], eye, half) for i, eye in enumerate(eyes)], axis=0)
    face = int(np.argmax(votes))
    if votes[face] < _VOTE * votes.sum():
        return None
    axis, sign = _FACES[face]
    low, high = extents(lining, container.pose.rotation)
    centre = container.pose.rotation.T @ np.asarray(container.pose.position)
    low, high = low - centre, high - centre
    low, high = _walls(low, high, half, axis, sign, _seen_walls(local, low, high, lining.noise))
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


def _seen_walls(local: Array, low: Array, high: Array, noise: float) -> np.ndarray:
    """Whether the lining (N, 3) ends at a wall, at each end of each axis, (3, 2) bool: many of its points lie there.
    Where something covers the rest, it ends without one."""
    near = _AT_WALL + 2 * noise
    shares = [(np.mean(local < low + near, axis=0)), (np.mean(local > high - near, axis=0))]
    usual = near / np.maximum(high - low, near)  # of points that lie evenly
    return np.stack(shares, axis=1) > _CROWDED + 2 * usual[:, None]


def _walls(low: Array, high: Array, half: Array, axis: int, sign: float, seen: np.ndarray) -> tuple[Array, Array]:
    """Lowest and highest corner (3,) of the room in the container's frame, from those of the lining. A wall that is not
    ``seen`` (3, 2) is as thick as the one opposite."""
    low, high = np.maximum(low, -half), np.minimum(high, half)
    gaps = np.stack([low + half, half - high], axis=1)  # (axis, side)
    gaps[axis, int(sign > 0)] = np.inf
    for i in range(3):
        thin = float(np.clip(gaps[i].min(), *_WALL))
        unseen = gaps[i] > 2 * thin + 0.01
        if i == axis:  # opposite the opening: as thick as the walls around it
            thin = float(np.clip(np.delete(gaps, axis, axis=0).min(), *_WALL))
            unseen = gaps[i] > 4 * thin + 0.01
        unseen &= ~seen[i]
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
