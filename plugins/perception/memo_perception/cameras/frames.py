"""A frame: one RGB-D picture with what is needed to turn its pixels into points in the base frame.

Conventions, throughout this package: the base frame is the robot's (metres, x forward, y left, z up); a camera's pose
is ``world_T_camera`` in the OpenCV convention (+x right, +y down, +z forward, along the optical axis); depth is
measured along +z, not along the ray; a pixel (u, v) is column and row, with the centre of the first one at (0, 0).
"""

from __future__ import annotations

import hashlib
import math

import attrs
import numpy as np

from memo_core.plugin import Array, InvalidArgument, Pose


@attrs.frozen
class Intrinsics:
    """Pinhole model without distortion, in pixels: focal lengths and principal point."""

    fx: float
    fy: float
    cx: float
    cy: float

    @classmethod
    def from_field_of_view(cls, vertical: float, width: int, height: int) -> Intrinsics:
        """Square pixels, principal point in the middle; ``vertical`` in radians."""
        focal = height / 2 / math.tan(vertical / 2)
        return cls(focal, focal, (width - 1) / 2, (height - 1) / 2)

    @property
    def matrix(self) -> Array:
        """Camera matrix, shape (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


@attrs.frozen(eq=False)
class Frame:
    """One RGB-D picture. ``depth`` is registered to ``rgb``: the same size and optical centre."""

    name: str  # of the camera; unique in a look
    rgb: np.ndarray  # (H, W, 3) uint8
    depth: np.ndarray  # (H, W) float32, metres along the optical axis; 0: not measured
    intrinsics: Intrinsics
    pose: Pose  # world_T_camera (OpenCV convention) when the picture was taken
    time: float = 0.0  # s, on the robot's clock

    def __attrs_post_init__(self) -> None:
        height, width = self.depth.shape[:2]
        if self.rgb.dtype != np.uint8 or self.rgb.shape != (height, width, 3) or self.depth.ndim != 2:
            given = f"rgb {self.rgb.dtype} {self.rgb.shape}, depth {self.depth.shape}"
            raise InvalidArgument(f"frame {self.name!r}", given, "rgb uint8 (H, W, 3) and depth (H, W)")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.depth.shape[1], self.depth.shape[0]

    def points(self) -> Array:
        """Every pixel's point in the base frame (m), shape (H, W, 3); NaN where depth was not measured."""
        width, height = self.size
        k = self.intrinsics
        z = np.where(self.depth > 0, self.depth, np.nan).astype(float)
        x = (np.arange(width) - k.cx)[None, :] / k.fx * z
        y = (np.arange(height) - k.cy)[:, None] / k.fy * z
        return self.pose.apply(np.stack([x, y, z], axis=-1))

    def project(self, points: Array) -> tuple[Array, Array]:
        """Pixels (u, v), shape (..., 2), and depths (m), shape (...), of points in the base frame, shape (..., 3).
        Those with a depth <= 0 are behind the camera."""
        local = self.pose.inverse().apply(points)
        k, z = self.intrinsics, local[..., 2]
        safe = np.where(np.abs(z) < 1e-9, 1e-9, z)
        return np.stack([k.fx * local[..., 0] / safe + k.cx, k.fy * local[..., 1] / safe + k.cy], axis=-1), z

    def digest(self) -> str:
        """Identifies the pictures and where they were taken from, whatever the time."""
        digest = hashlib.sha256(self.name.encode())
        digest.update(np.ascontiguousarray(self.rgb).tobytes())
        digest.update(np.ascontiguousarray(self.depth, dtype=np.float32).tobytes())
        digest.update(repr((attrs.astuple(self.intrinsics), self.pose)).encode())
        return digest.hexdigest()[:32]
