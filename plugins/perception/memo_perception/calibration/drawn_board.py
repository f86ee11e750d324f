"""A board drawn into a picture where it would be seen: no simulator has one. Nothing hides it, and it has no shadow."""

from __future__ import annotations

import cv2
import numpy as np

from memo_core.plugin import Array, Pose, look_at
from memo_perception.calibration.board import Board, Lens

_FINER = 3  # times the picture's resolution at which it is drawn
_MARGIN = 0.5  # of a square: white paper around the board


def draw_board(picture: np.ndarray, board: Board, pose: Pose, lens: Lens) -> np.ndarray:
    """A copy of the picture, RGB uint8 (H, W, 3), with the board at ``pose`` in the camera's frame. The lens must be
    without distortion."""
    size = 100  # pixels a square
    sheet = np.pad(board.drawn(size), round(_MARGIN * size), constant_values=255)
    high, wide = sheet.shape
    # From the sheet's pixels to the board's plane: the centre of a pixel is at a whole number.
    metre = board.square / size
    to_plane = np.array([[metre, 0, (0.5 - wide / 2) * metre], [0, metre, (0.5 - high / 2) * metre], [0, 0, 1]])
    to_picture = lens.matrix @ np.column_stack([pose.rotation[:, :2], pose.position]) @ to_plane
    finer = np.array([[_FINER, 0, (_FINER - 1) / 2], [0, _FINER, (_FINER - 1) / 2], [0, 0, 1]])
    rows, columns = picture.shape[:2]
    canvas = (columns * _FINER, rows * _FINER)
    drawn = cv2.warpPerspective(sheet, finer @ to_picture, canvas, flags=cv2.INTER_LINEAR)
    inside = cv2.warpPerspective(np.full_like(sheet, 255), finer @ to_picture, canvas, flags=cv2.INTER_LINEAR)
    shrunk = cv2.resize(drawn, (columns, rows), interpolation=cv2.INTER_AREA).astype(float)
    share = cv2.resize(inside, (columns, rows), interpolation=cv2.INTER_AREA).astype(float)[..., None] / 255
    return np.round(picture * (1 - share) + shrunk[..., None] * (share > 0)).clip(0, 255).astype(np.uint8)


def facing(position: Array, camera: Pose, tilt: float = 0.2) -> Pose:
    """A board at ``position`` that faces a camera, nearly: a plane seen exactly from the front has no certain pose."""
    eye = np.asarray(camera.position)
    away = look_at(tuple(position), tuple(2 * np.asarray(position) - eye))
    half = tilt / 2
    return away * Pose(orientation=(float(np.cos(half)), float(np.sin(half)), 0.0, 0.0))
