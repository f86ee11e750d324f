"""The table's plane in each picture: the part of a calibration error that shows in it is taken out, and its roughness
tells how noisy the depth is."""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.plugin import Array, Pose, quaternion_from_axis_angle
from memo_perception.cameras.frames import Frame

_NEAR_PLANE = 0.025  # m within which a pixel may be the table's
_LEAST_PIXELS = 2000
_LARGEST_TILT = 0.035  # rad; more is not a calibration error
_TABLE = ((-0.35, 1.25), (-0.8, 0.8))  # m: where its top is, x and y in the base frame


@attrs.frozen(eq=False)
class View:
    """A frame with its points and what is known of its depth."""

    frame: Frame
    points: Array  # (H, W, 3) base frame, m; NaN where not measured
    noise: float  # m: standard deviation of depth, from the table's roughness; at least 0.5 mm
    aligned: bool  # whether the table was seen well enough to correct the pose


def aligned_view(frame: Frame, table_height: float, blocked: np.ndarray | None = None) -> View:
    """The frame with its pose turned and lifted so that the table it shows lies at ``table_height`` (m).

    A plane has three degrees of freedom, so half of a calibration error can be seen in every picture. ``blocked``:
    pixels (H, W) not to use, such as the arm's.
    """
    points = frame.points()
    sample = points[::3, ::3]
    near = _near_table(sample, table_height)
    if blocked is not None:
        near &= ~blocked[::3, ::3]
    if np.count_nonzero(near) * 9 < _LEAST_PIXELS:
        return View(frame, points, 0.001, False)
    on = sample[near]
    for _ in range(3):
        middle = np.median(on, axis=0)
        slope, offset = _plane(on - middle)
        residual = (on - middle) @ np.array([-slope[0], -slope[1], 1.0]) - offset
        spread = max(1.4826 * float(np.median(np.abs(residual))), 1e-4)
        keep = np.abs(residual) < 3 * spread
        if np.count_nonzero(keep) < 100:
            break
        on = on[keep]
    normal = np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1 + slope @ slope)
    tilt = float(np.arccos(min(1.0, normal[2])))
    noise = _along_ray(spread, frame, middle, normal)
    if tilt > _LARGEST_TILT:
        return View(frame, points, noise, False)
    axis = np.cross(normal, [0.0, 0.0, 1.0])
    turn = Pose(orientation=quaternion_from_axis_angle(axis.tolist(), tilt)) if tilt > 1e-6 else Pose()
    lift = table_height - (middle[2] + offset)
    about = Pose(tuple(middle))
    correction = Pose((0.0, 0.0, float(lift))) * about * turn * about.inverse()
    moved = attrs.evolve(frame, pose=correction * frame.pose)
    return View(moved, correction.apply(points), noise, True)


def _near_table(points: Array, height: float) -> np.ndarray:
    (x0, x1), (y0, y1) = _TABLE
    with np.errstate(invalid="ignore"):
        x, y, z = np.moveaxis(points, -1, 0)
        return (np.abs(z - height) < _NEAR_PLANE) & (x > x0) & (x < x1) & (y > y0) & (y < y1)


def _plane(points: Array) -> tuple[Array, float]:
    """Slopes (2,) and offset of z = slope · (x, y) + offset, by least squares."""
    design = np.column_stack([points[:, :2], np.ones(len(points))])
    found, *_ = np.linalg.lstsq(design, points[:, 2], rcond=None)
    return found[:2].astype(np.float64), float(found[2])


def _along_ray(spread: float, frame: Frame, at: Array, normal: Array) -> float:
    """Deviation of depth (m) that makes this deviation across the plane."""
    ray = at - np.asarray(frame.pose.position)
    ray /= np.linalg.norm(ray)
    forward = frame.pose.rotation[:, 2]
    across = abs(float(ray @ normal)) / max(float(ray @ forward), 0.2)
    return max(spread / max(across, 0.1), 0.0005)
