"""The pose of a marker from all pictures that show it.

One picture of a small square leaves two poses that mirror each other, and its distance is uncertain: 1.6 mm at 0.9 m
for a side of 50 mm. So the corners in all pictures and the depth measured on the square are explained together, with
each such pose as a start; the pose with the smallest error is taken.
"""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import cv2
import numpy as np
from scipy.optimize import least_squares

from memo_core.plugin import Array, Pose
from memo_perception.calibration.board import Lens, pose_of
from memo_perception.calibration.tags import tag_corners, tag_poses
from memo_perception.cameras.frames import Frame

_CORNER_SIGMA = 0.3  # px
_DEPTH_BIAS = 0.001  # m by which depth may be off all over a square, however large
_CORRELATED = 12  # pixels of depth whose noise is about one draw
_SAMPLES = 50  # points of depth that are used
_MIRRORED = np.radians(10)  # between two explanations, from which on they are different ones
_FLIP = 2.0  # times that the second explanation must cost more, for the first to be trusted
_APART = 4.0  # px, root mean square, from which on the pictures cannot show one marker


@attrs.frozen(eq=False)
class Sighting:
    """A marker in one picture: its corners (4, 2) in pixels, clockwise from the top left as printed."""

    frame: Frame
    corners: Array


@attrs.frozen(eq=False)
class MarkerPose:
    """A marker's pose in the base frame: x to the right and y up as printed, z out of it. ``flag``: why it may be
    wrong; empty: nothing is known against it."""

    pose: Pose
    flag: str = ""


def marker_pose(sightings: Sequence[Sighting], side: float, noise: float) -> MarkerPose | None:
    """The pose of one marker with sides of ``side`` m; ``noise``: standard deviation of depth (m). None if no pose
    explains its corners."""
    depths = [_depth(one) for one in sightings]

    def residuals(x: Array) -> Array:
        pose = pose_of(x[:3], x[3:])
        return np.concatenate(
            [_residuals(one, points, pose, side, noise) for one, points in zip(sightings, depths, strict=True)]
        )

    fits = []
    for one in sightings:
        for seen, _ in tag_poses(one.corners, side, Lens(one.frame.intrinsics.matrix)):
            start = one.frame.pose * seen
            turn = cv2.Rodrigues(start.rotation)[0].ravel()
            fits.append(least_squares(residuals, np.concatenate([turn, start.position]), loss="soft_l1", max_nfev=30))
    if not fits:
        return None
    fits.sort(key=lambda fit: float(fit.cost))
    pose = pose_of(fits[0].x[:3], fits[0].x[3:])
    others = [fit for fit in fits if pose.distance(pose_of(fit.x[:3], fit.x[3:]))[1] > _MIRRORED]
    if _missed(sightings, pose, side) > _APART:
        return MarkerPose(pose, "its marker is not in one place in all pictures")
    if others and others[0].cost < _FLIP * fits[0].cost:
        return MarkerPose(pose, "its marker is seen so small that its orientation may be the mirrored one")
    return MarkerPose(pose)


def _residuals(one: Sighting, points: Array, pose: Pose, side: float, noise: float) -> Array:
    seen, _ = one.frame.project(pose.apply(tag_corners(side)))
    corners = (seen - one.corners).ravel() / _CORNER_SIGMA
    if len(points) == 0:
        return corners
    off = (points - np.asarray(pose.position)) @ pose.rotation[:, 2]
    draws = max(1.0, cv2.contourArea(one.corners.astype(np.float32)) / _CORRELATED)
    sigma = np.hypot(noise / np.sqrt(draws), _DEPTH_BIAS)
    return np.concatenate([corners, off / (sigma * np.sqrt(len(points)))])


def _depth(one: Sighting) -> Array:
    """Points (N, 3) measured on the square, base frame (m)."""
    square = np.zeros(one.frame.depth.shape, dtype=np.uint8)
    cv2.fillConvexPoly(square, np.round(one.corners).astype(np.int32), 1)
    inside = cv2.erode(square, np.ones((3, 3), np.uint8)) > 0  # along its edges depth may be that of what is behind
    rows, columns = np.nonzero(inside & (one.frame.depth > 0))
    some = np.linspace(0, len(rows) - 1, min(len(rows), _SAMPLES)).astype(int)
    z = one.frame.depth[rows[some], columns[some]].astype(float)
    k = one.frame.intrinsics
    return one.frame.pose.apply(
        np.stack([(columns[some] - k.cx) / k.fx * z, (rows[some] - k.cy) / k.fy * z, z], axis=-1)
    )


def _missed(sightings: Sequence[Sighting], pose: Pose, side: float) -> float:
    """Root mean square (px) by which the corners are missed."""
    off = [one.frame.project(pose.apply(tag_corners(side)))[0] - one.corners for one in sightings]
    return float(np.sqrt(np.mean(np.square(off)) * 2))
