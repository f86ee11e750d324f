"""Pictures of AprilTags that lie on a table, for tests."""

from __future__ import annotations

import cv2
import numpy as np
from boards import LENS
from memo_perception.calibration.board import DICTIONARIES

from memo_core.scene.pose import Pose, look_at

EYE = look_at((0.2, -0.5, 0.7), (0.5, 0.0, 0.0))
TAGS = {3: Pose((0.5, 0.1, 0.0)), 7: Pose.from_yaw((0.35, -0.1, 0.0), 0.4)}
SIZE = 0.05


def picture(eye: Pose = EYE, tags: dict[int, Pose] = TAGS, seed: int = 0) -> np.ndarray:
    """Tags lying on a grey table, drawn at three times the resolution."""
    rng = np.random.default_rng(seed)
    known = cv2.aruco.getPredefinedDictionary(DICTIONARIES["apriltag_36h11"])
    fine = np.diag([3.0, 3.0, 1.0])
    fine[:2, 2] = 1
    canvas = np.full((1440, 1920), 150, dtype=np.uint8)
    for number, tag in tags.items():
        sheet = cv2.copyMakeBorder(
            cv2.aruco.generateImageMarker(known, number, 300), *[60] * 4, cv2.BORDER_CONSTANT, value=255
        )
        metre = SIZE / 300
        middle = (sheet.shape[0] - 1) / 2
        to_plane = np.array([[metre, 0, -middle * metre], [0, -metre, middle * metre], [0, 0, 1]])
        seen = eye.inverse() * tag
        to_picture = fine @ LENS.matrix @ np.column_stack([seen.rotation[:, :2], seen.position]) @ to_plane
        drawn = cv2.warpPerspective(sheet, to_picture, (1920, 1440))
        inside = cv2.warpPerspective(np.full_like(sheet, 255), to_picture, (1920, 1440)) > 127
        canvas[inside] = drawn[inside]
    small = cv2.resize(canvas, (640, 480), interpolation=cv2.INTER_AREA).astype(float)
    grey = (small + rng.normal(0, 2, small.shape)).clip(0, 255).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)
