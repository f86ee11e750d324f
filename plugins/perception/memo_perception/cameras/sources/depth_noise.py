"""Depth noise of three cameras, laid over rendered depth. The figures are those of the makers and of published
measurements; they stand for a kind of camera, not for one device.

- D435 (active stereo, 50 mm baseline): standard deviation z² · 0.08 px / (447 px · 50 mm), 2.9 mm at 0.9 m, correlated
  over about 2 px; what the second imager does not see is not measured; edges blend near and far ("flying pixels");
  surfaces at grazing angles have holes; steps of 1 mm.
- D405 (passive stereo, 18 mm baseline): standard deviation 1 % of the distance, so that 95 % are within the maker's 2 %
  at 0.5 m; the same shadows, edges and holes; nothing below 0.07 m.
- Femto Mega (time of flight): 1.2 mm + 0.6 mm (z / m)²; flying pixels and holes, no shadow of a second imager.
"""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np
from scipy import ndimage

from memo_perception.cameras.frames import Intrinsics

_GRAZING = np.cos(np.radians(80.0))  # cosine of the angle between ray and normal below which a surface has holes
_EDGE = 0.02  # relative step of depth between neighbours that counts as an edge
_BLUR_GAIN = 2 * np.sqrt(np.pi)  # restores the deviation of white noise blurred by a Gaussian of 1 px


@attrs.frozen(eq=False)
class DepthNoise:
    """One kind of camera. ``deviation``: of depth (m) as a function of depth (m); ``baseline``: between the imagers of
    a stereo pair (m), 0 without a second imager."""

    deviation: Callable[[np.ndarray], np.ndarray]
    baseline: float
    nearest: float  # m, nothing is measured below
    farthest: float = 6.0  # m
    step: float = 0.001  # m, resolution
    flying: float = 0.5  # probability that a pixel at an edge lies between near and far


NOISE = {
    "d435": DepthNoise(lambda z: z**2 * 0.08 / (447 * 0.05), 0.05, 0.15),
    "d405": DepthNoise(lambda z: 0.01 * z * np.maximum(1.0, z / 0.5), 0.018, 0.07),
    "femto": DepthNoise(lambda z: 0.0012 + 0.0006 * z**2, 0.0, 0.25),
}


def noisy(depth: np.ndarray, intrinsics: Intrinsics, noise: DepthNoise, rng: np.random.Generator) -> np.ndarray:
    """Depth (H, W) float32 metres as this camera would measure it, 0 where it would not. ``depth``: true, 0 for
    nothing."""
    true = depth.astype(float)
    seen = (true > noise.nearest) & (true < noise.farthest)
    near, far = ndimage.minimum_filter(true, 3), ndimage.maximum_filter(true, 3)
    edge = seen & (near > 0) & (far - near > _EDGE * near)
    white = ndimage.gaussian_filter(rng.normal(size=true.shape), 1.0, truncate=3.0) * _BLUR_GAIN
    measured = true + white * noise.deviation(true)
    flying = edge & (rng.random(true.shape) < noise.flying)
    measured[flying] = (near + (far - near) * rng.random(true.shape))[flying]
    lost = ~seen | (_grazing(true, intrinsics) & (rng.random(true.shape) < 0.7))
    if noise.baseline:
        lost |= _second_imager_blind(true, intrinsics.fx * noise.baseline)
    measured = np.round(measured / noise.step) * noise.step
    measured[lost | (measured < noise.nearest)] = 0.0
    return measured.astype(np.float32)


def _grazing(depth: np.ndarray, intrinsics: Intrinsics) -> np.ndarray:
    """Where the surface is nearly parallel to the ray, shape (H, W)."""
    dz_dv, dz_du = np.gradient(depth)
    z = np.maximum(depth, 1e-6)
    nx, ny = -dz_du * intrinsics.fx / z, -dz_dv * intrinsics.fy / z  # normal of the surface, z component 1, roughly
    return 1.0 / np.sqrt(1.0 + nx**2 + ny**2) < _GRAZING


def _second_imager_blind(depth: np.ndarray, focal_baseline: float) -> np.ndarray:
    """Pixels that a nearer surface hides from the second imager, to the right of the first; ``focal_baseline`` (px m)
    over depth is the disparity in pixels."""
    height, width = depth.shape
    disparity = np.where(depth > 0, focal_baseline / np.maximum(depth, 1e-6), 0.0)
    target = np.round(np.arange(width)[None, :] - disparity).astype(int)
    inside = (target >= 0) & (depth > 0)
    best = np.zeros((height, width))
    rows = np.broadcast_to(np.arange(height)[:, None], target.shape)
    np.maximum.at(best, (rows[inside], target[inside]), disparity[inside])
    best = ndimage.maximum_filter(best, (1, 3))  # a nearer surface leaves gaps between its pixels
    blind = np.zeros_like(inside)
    blind[inside] = disparity[inside] < best[rows[inside], target[inside]] - 3.0
    return blind
