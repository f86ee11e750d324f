"""Shapes that are fitted to silhouettes and points. Each takes a batch of parameter vectors (B, P), so that a numerical
Jacobian costs little more than one evaluation."""

from __future__ import annotations

from typing import Protocol

import attrs
import numpy as np

from memo_core.plugin import Array, Pose, quaternion_from_rotation

_CORNERS = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
_RING = 24
_CIRCLE = np.column_stack([f(2 * np.pi * np.arange(_RING) / _RING) for f in (np.cos, np.sin)])
_LEAST = 0.002  # m, smallest extent


class Shape(Protocol):
    """A convex shape with parameters."""

    @property
    def name(self) -> str: ...

    def vertices(self, parameters: Array) -> Array:
        """Points whose convex hull is the shape, shape (B, K, 3), base frame."""
        ...

    def distances(self, parameters: Array, points: Array) -> Array:
        """Signed distance (m) of points (N, 3) from the surface, negative inside, shape (B, N)."""
        ...

    def underside(self, parameters: Array) -> Array:
        """Height (m) of the lowest point, shape (B,)."""
        ...

    def box(self, parameters: Array) -> tuple[Pose, tuple[float, float, float]]:
        """Pose of the centre and full extents of the box around the shape; ``parameters`` (P,)."""
        ...


@attrs.frozen(eq=False)
class Box:
    """Parameters: centre (3), full extents (3), then as many small rotations as ``axes`` names, about the axes of
    ``base`` (3, 3), in this order. Upright boxes turn about z only."""

    base: Array = attrs.field(factory=lambda: np.eye(3))
    axes: tuple[int, ...] = (2,)
    name: str = "box"

    def vertices(self, parameters: Array) -> Array:
        local = _CORNERS[None] * np.maximum(parameters[:, None, 3:6], _LEAST)
        return local @ np.swapaxes(self.rotation(parameters), 1, 2) + parameters[:, None, :3]

    def distances(self, parameters: Array, points: Array) -> Array:
        local = (points[None] - parameters[:, None, :3]) @ self.rotation(parameters)
        beyond = np.abs(local) - np.maximum(parameters[:, None, 3:6], _LEAST) / 2
        outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=2)
        return outside + np.minimum(beyond.max(axis=2), 0.0)

    def underside(self, parameters: Array) -> Array:
        return self.vertices(parameters)[..., 2].min(axis=1)

    def box(self, parameters: Array) -> tuple[Pose, tuple[float, float, float]]:
        rotation = self.rotation(parameters[None])[0]
        size = np.maximum(parameters[3:6], _LEAST)
        return Pose(tuple(parameters[:3]), quaternion_from_rotation(rotation)), tuple(size.tolist())

    def rotation(self, parameters: Array) -> Array:
        """Columns are the box's axes, shape (B, 3, 3)."""
        turned = np.broadcast_to(self.base, (len(parameters), 3, 3))
        for i, axis in enumerate(self.axes):
            turned = turned @ _turn(axis, parameters[:, 6 + i])
        return turned


@attrs.frozen(eq=False)
class Cylinder:
    """Upright. Parameters: centre (3), radius, height."""

    name: str = "cylinder"

    def vertices(self, parameters: Array) -> Array:
        radius, half = np.maximum(parameters[:, 3], _LEAST), np.maximum(parameters[:, 4], _LEAST) / 2
        ring = np.zeros((len(parameters), 2 * _RING, 3))
        ring[:, :, :2] = np.tile(_CIRCLE, (2, 1))[None] * radius[:, None, None]
        ring[:, :_RING, 2], ring[:, _RING:, 2] = -half[:, None], half[:, None]
        return ring + parameters[:, None, :3]

    def distances(self, parameters: Array, points: Array) -> Array:
        local = points[None] - parameters[:, None, :3]
        radial = np.linalg.norm(local[..., :2], axis=2) - np.maximum(parameters[:, 3:4], _LEAST)
        axial = np.abs(local[..., 2]) - np.maximum(parameters[:, 4:5], _LEAST) / 2
        outside = np.hypot(np.maximum(radial, 0.0), np.maximum(axial, 0.0))
        return outside + np.minimum(np.maximum(radial, axial), 0.0)

    def underside(self, parameters: Array) -> Array:
        return parameters[:, 2] - parameters[:, 4] / 2

    def box(self, parameters: Array) -> tuple[Pose, tuple[float, float, float]]:
        width, height = 2 * max(float(parameters[3]), _LEAST), max(float(parameters[4]), _LEAST)
        return Pose(tuple(parameters[:3])), (width, width, height)


@attrs.frozen(eq=False)
class Sphere:
    """Parameters: centre (3), radius."""

    name: str = "sphere"

    def vertices(self, parameters: Array) -> Array:
        return parameters[:, None, :3] + _BALL[None] * np.maximum(parameters[:, None, 3:4], _LEAST)

    def distances(self, parameters: Array, points: Array) -> Array:
        apart = np.linalg.norm(points[None] - parameters[:, None, :3], axis=2)
        return apart - np.maximum(parameters[:, 3:4], _LEAST)

    def underside(self, parameters: Array) -> Array:
        return parameters[:, 2] - parameters[:, 3]

    def box(self, parameters: Array) -> tuple[Pose, tuple[float, float, float]]:
        width = 2 * max(float(parameters[3]), _LEAST)
        return Pose(tuple(parameters[:3])), (width, width, width)


def _ball(count: int = 120) -> Array:
    """Points spread evenly over the unit sphere (a Fibonacci lattice), pushed out so that their hull is as wide."""
    i = np.arange(count) + 0.5
    polar, azimuth = np.arccos(1 - 2 * i / count), np.pi * (1 + 5**0.5) * i
    points = np.column_stack([np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)])
    return points * 1.008


_BALL = _ball()


def _turn(axis: int, angles: Array) -> Array:
    """Rotations about a coordinate axis, shape (B, 3, 3)."""
    turned = np.zeros((len(angles), 3, 3))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    c, s = np.cos(angles), np.sin(angles)
    turned[:, axis, axis] = 1.0
    turned[:, i, i], turned[:, i, j], turned[:, j, i], turned[:, j, j] = c, -s, s, c
    return turned
