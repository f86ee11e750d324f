"""The ChArUco board that a camera is calibrated with: drawing it, finding it in a picture, and its pose.

The board's frame has its origin in the middle of the board, x to the right and y down as printed, z into the board.
"""

from __future__ import annotations

import attrs
import cv2
import numpy as np

from memo_core.plugin import Array, InvalidArgument, Pose, UnknownName, quaternion_from_rotation

_NAMES = [
    "4X4_50",
    "4X4_100",
    "5X5_50",
    "5X5_100",
    "6X6_50",
    "6X6_250",
    "APRILTAG_16h5",
    "APRILTAG_25h9",
    "APRILTAG_36h11",
]
DICTIONARIES = {name.lower(): int(getattr(cv2.aruco, f"DICT_{name}")) for name in _NAMES}
LEAST_CORNERS = 8  # of a board in a picture, for its pose to be trusted


@attrs.frozen
class Lens:
    """A pinhole camera: ``matrix`` (3, 3) in pixels and OpenCV's distortion coefficients (k1, k2, p1, p2, k3)."""

    matrix: Array = attrs.field(eq=attrs.cmp_using(eq=np.array_equal))
    distortion: Array = attrs.field(factory=lambda: np.zeros(5), eq=attrs.cmp_using(eq=np.array_equal))

    def project(self, points: Array) -> Array:
        """Pixels (..., 2) of points (..., 3) in the camera's frame."""
        flat = np.asarray(points, dtype=float).reshape(-1, 3)
        pixels, _ = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), self.matrix, self.distortion)
        return np.asarray(pixels, dtype=float).reshape(*points.shape[:-1], 2)


@attrs.frozen(eq=False)
class Sighting:
    """The corners of a board in one picture: their numbers (k,) and pixels (k, 2)."""

    corners: np.ndarray
    pixels: Array


@attrs.frozen
class Board:
    """A ChArUco board of ``columns`` x ``rows`` squares of ``square`` metres with markers of ``marker`` metres."""

    columns: int = attrs.field(default=7, validator=attrs.validators.ge(3))
    rows: int = attrs.field(default=5, validator=attrs.validators.ge(3))
    square: float = attrs.field(default=0.03, validator=attrs.validators.gt(0.0))
    marker: float = attrs.field(default=0.0225, validator=attrs.validators.gt(0.0))
    dictionary: str = "4x4_50"

    def __attrs_post_init__(self) -> None:
        if self.dictionary not in DICTIONARIES:
            raise UnknownName("marker dictionary", self.dictionary, tuple(DICTIONARIES))
        if not self.marker < self.square:
            given = f"markers of {1000 * self.marker:g} mm do not fit squares of {1000 * self.square:g} mm"
            raise InvalidArgument("board", given, "markers smaller than the squares")

    @property
    def size(self) -> tuple[float, float]:
        """Width and height (m)."""
        return self.columns * self.square, self.rows * self.square

    @property
    def points(self) -> Array:
        """All inner corners in the board's frame, shape ((columns - 1) * (rows - 1), 3), by number."""
        half = np.array([*self.size, 0.0]) / 2
        return np.asarray(self._board().getChessboardCorners(), dtype=float) - half

    def _board(self) -> cv2.aruco.CharucoBoard:
        dictionary = cv2.aruco.getPredefinedDictionary(DICTIONARIES[self.dictionary])
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, dictionary)

    def drawn(self, pixels_a_square: int = 120) -> np.ndarray:
        """The board to be printed, without a margin: grey, uint8, shape (rows * p, columns * p)."""
        wide, high = self.columns * pixels_a_square, self.rows * pixels_a_square
        return self._board().generateImage((wide, high))

    def seen_in(self, picture: np.ndarray) -> Sighting | None:
        """The board in a picture, RGB (H, W, 3) or grey (H, W), uint8; None unless at least ``LEAST_CORNERS`` of its
        corners are found, not all on one line."""
        grey = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) if picture.ndim == 3 else picture
        detector = cv2.aruco.CharucoDetector(self._board())
        found, numbers, _, _ = detector.detectBoard(grey)
        if numbers is None or len(numbers) < LEAST_CORNERS:
            return None
        sighting = Sighting(numbers.reshape(-1), found.reshape(-1, 2).astype(float))
        return None if _on_a_line(self.points[sighting.corners][:, :2]) else sighting

    def pose(self, sighting: Sighting, lens: Lens, near: Pose | None = None) -> Pose:
        """The board's pose in the camera's frame. A plane seen from afar has two; ``near`` chooses the more similar
        one, otherwise the one that fits better is taken."""
        points = self.points[sighting.corners]
        count, turns, shifts, errors = cv2.solvePnPGeneric(
            points, sighting.pixels, lens.matrix, lens.distortion, flags=cv2.SOLVEPNP_IPPE
        )
        best = None
        for i in range(count):
            turn, shift = cv2.solvePnPRefineLM(
                points, sighting.pixels, lens.matrix, lens.distortion, turns[i].copy(), shifts[i].copy()
            )
            found = pose_of(turn, shift)
            rank = float(np.ravel(errors[i])[0]) if near is None else found.distance(near)[1]
            if best is None or rank < best[0]:
                best = (rank, found)
        if best is None:
            raise InvalidArgument("board", "its corners give no pose", "a picture in which it is not seen edge-on")
        return best[1]

    def residual(self, sighting: Sighting, lens: Lens, pose: Pose) -> float:
        """Root mean square distance (px) of the corners from where this pose puts them."""
        expected = lens.project(pose.apply(self.points[sighting.corners]))
        return float(np.sqrt(((expected - sighting.pixels) ** 2).sum(axis=1).mean()))


def pose_of(turn: np.ndarray, shift: np.ndarray) -> Pose:
    """From OpenCV's rotation vector and translation."""
    rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=float)
    return Pose(tuple(np.ravel(shift)), quaternion_from_rotation(rotation))


def _on_a_line(points: Array) -> bool:
    centred = points - points.mean(axis=0)
    spread = np.linalg.svd(centred, compute_uv=False)
    return bool(spread[-1] < 0.05 * spread[0])
