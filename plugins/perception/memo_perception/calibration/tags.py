"""ArUco and AprilTag markers: finding them in a picture and their poses.

A tag's frame has its origin in the tag's middle, x to the right and y up as printed, z out of it. Corners are refined
as AprilTag does it: with subpixel corners a 50 mm tag at 0.9 m seems 12 mm too far away.
"""

from __future__ import annotations

from collections.abc import Iterator

import attrs
import cv2
import numpy as np

from memo_core.plugin import Array, Pose
from memo_perception.calibration.board import DICTIONARIES, Lens, pose_of

_FLIP = 2.0  # times that the second of a square's two poses must fit worse, for the first to be trusted


@attrs.frozen(eq=False)
class Tag:
    """A tag in a picture. ``corners`` (4, 2) in pixels, clockwise from the top left as printed."""

    number: int
    corners: Array
    pose: Pose  # in the camera's frame
    certain: bool  # False: seen so small or so squarely that its orientation may be the mirrored one


def find_tags(picture: np.ndarray, dictionary: str, size: float, lens: Lens) -> Iterator[Tag]:
    """The tags of one dictionary with sides of ``size`` m in a picture, RGB or grey, uint8. A number that is seen twice
    is left out: it says nothing about which is which."""
    grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) if picture.ndim == 3 else picture
    found, numbers = found_corners(grey, dictionary)
    for corners, number in zip(found, numbers, strict=True):
        if numbers.count(number) > 1:
            continue
        poses = tag_poses(corners, size, lens)
        if poses:
            off = [error for _, error in poses]
            yield Tag(number, corners, poses[0][0], len(off) < 2 or off[1] > _FLIP * max(off[0], 1e-6))


def tag_corners(size: float) -> Array:
    """Corners (4, 3) of a tag with sides of ``size`` m in its own frame, clockwise from the top left as printed."""
    half = size / 2
    return np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])


def tag_poses(corners: Array, size: float, lens: Lens) -> list[tuple[Pose, float]]:
    """The one or two poses in the camera's frame that explain a tag's corners (4, 2) in pixels (Collins and Bartoli,
    2014), the better first, each with its error (px)."""
    count, turns, shifts, errors = cv2.solvePnPGeneric(
        tag_corners(size), corners, lens.matrix, lens.distortion, flags=cv2.SOLVEPNP_IPPE_SQUARE
    )
    off = [float(np.ravel(error)[0]) for error in errors[:count]] if count else []
    return sorted(((pose_of(turns[i], shifts[i]), error) for i, error in enumerate(off)), key=lambda one: one[1])


def found_corners(grey: np.ndarray, dictionary: str) -> tuple[list[Array], list[int]]:
    """Corners (4, 2) and numbers of all tags of one dictionary in a grey picture."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    known = cv2.aruco.getPredefinedDictionary(DICTIONARIES[dictionary])
    corners, numbers, _ = cv2.aruco.ArucoDetector(known, parameters).detectMarkers(grey)
    if numbers is None:
        return [], []
    return [one.reshape(4, 2).astype(float) for one in corners], [int(one) for one in np.ravel(numbers)]
