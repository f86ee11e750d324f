"""Pictures by Bullet's own software renderer, which needs no graphics library."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from memo_core.plugin import Camera

_NEAR, _FAR = 0.02, 30.0  # m
_SKY = (235, 240, 247)


class Pictures:
    """Colour, depth and segmentation from a camera in one go."""

    def __init__(self, client: Any, shadows: bool) -> None:
        self._client = client
        self._shadows = shadows

    def shoot(self, camera: Camera, width: int, height: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """RGB (H, W, 3) uint8, depth (H, W) m with inf where nothing is, bodies and links (H, W), -1 where nothing."""
        import pybullet

        eye = np.array(camera.pose.position)
        rotation = camera.pose.rotation
        view = self._client.computeViewMatrix(eye.tolist(), (eye + rotation[:, 2]).tolist(), (-rotation[:, 1]).tolist())
        projection = self._client.computeProjectionMatrixFOV(
            math.degrees(camera.field_of_view), width / height, _NEAR, _FAR
        )
        _, _, colour, depth, seen = self._client.getCameraImage(
            width,
            height,
            view,
            projection,
            lightDirection=(-0.3, -0.9, 2.0),
            lightColor=(1.0, 1.0, 1.0),
            lightAmbientCoeff=0.65,
            lightDiffuseCoeff=0.45,
            lightSpecularCoeff=0.05,
            shadow=int(self._shadows),
            renderer=pybullet.ER_TINY_RENDERER,
            flags=pybullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX,
        )
        seen = np.asarray(seen, dtype=np.int64).reshape(height, width)
        buffer = np.asarray(depth, dtype=np.float64).reshape(height, width)
        metres = _FAR * _NEAR / (_FAR - (_FAR - _NEAR) * buffer)
        nothing = seen < 0
        bodies = np.where(nothing, -1, seen & ((1 << 24) - 1))
        links = np.where(nothing, -1, (seen >> 24) - 1)
        picture = np.asarray(colour, dtype=np.uint8).reshape(height, width, 4)[:, :, :3].copy()
        picture[nothing] = _SKY
        return picture, np.where(nothing, np.inf, metres).astype(np.float32), bodies, links
