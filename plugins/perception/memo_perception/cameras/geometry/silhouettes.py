"""Outlines of masks as support functions: how far a mask reaches in each direction of the picture.

The support function of a projected convex shape is the largest projection of its vertices, so a shape can be fitted to
masks of any number of cameras without tracing contours and without using depth. Where something nearer covers the
outline, or the picture ends, the direction does not count.
"""

from __future__ import annotations

import attrs
import cv2
import numpy as np

from memo_core.plugin import Array
from memo_perception.cameras.geometry.table import View

COUNT = 32
_ANGLES = 2 * np.pi * np.arange(COUNT) / COUNT
DIRECTIONS = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)])  # (COUNT, 2)
_BEYOND_CENTRE = 0.25  # px by which an outline lies outside the outermost pixel's centre, on average
_NEARER = 0.02  # m by which what covers an outline is nearer
_AROUND = 7  # px, window in which covering is looked for
_PIECE = 0.1  # pieces of a mask below this share of the largest are strays


@attrs.frozen(eq=False)
class Silhouette:
    """How far a mask reaches in one picture. ``scale``: pixels a metre at the thing's depth."""

    view: View
    mask: np.ndarray  # (H, W) bool
    blocked: np.ndarray | None  # (H, W) bool
    support: Array  # (COUNT,) px
    valid: np.ndarray  # (COUNT,) bool: nothing covers the outline there
    scale: float

    def residuals(self, vertices: Array) -> Array:
        """Metres by which shapes reach farther than the mask, shape (B, COUNT); ``vertices`` (B, K, 3), base frame.
        Where the outline is covered the mask is only the least that the shape must reach."""
        pixels, _ = _projected(self.view, vertices)
        missed = ((pixels @ DIRECTIONS.T).max(axis=1) - self.support) / self.scale
        return np.where(self.valid, missed, np.minimum(missed, 0.0))

    def holds(self, points: Array) -> tuple[np.ndarray, np.ndarray]:
        """Whether points (N, 3) of the base frame fall into the mask, and whether the picture tells: it shows their
        place, and nothing nearer covers it."""
        pixels, depths = _projected(self.view, points[None])
        height, width = self.mask.shape
        u, v = np.round(pixels[0]).astype(int).T
        shown = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        u, v = np.where(shown, u, 0), np.where(shown, v, 0)
        inside = shown & self.mask[v, u]
        measured = self.view.frame.depth[v, u]
        covered = (measured > 0) & (measured < depths[0] - _nearer(self.view.noise))
        if self.blocked is not None:
            covered |= self.blocked[v, u]
        return inside, shown & (inside | ~covered)

    def checked(self, vertices: Array) -> Silhouette:
        """With the directions left out in which a shape's outermost vertex, of (K, 3), is covered: what is seen of the
        thing there is not its end."""
        pixels, depths = _projected(self.view, vertices[None])
        outermost = np.argmax(pixels[0] @ DIRECTIONS.T, axis=0)
        seen = [self._seen(pixels[0, i], float(depths[0, i])) for i in range(len(vertices))]
        valid = self.valid & np.array([seen[i] for i in outermost])
        return attrs.evolve(self, valid=valid)

    def _seen(self, pixel: Array, depth: float) -> bool:
        height, width = self.mask.shape
        u, v = np.round(pixel).astype(int)
        if not (2 <= u < width - 2 and 2 <= v < height - 2):
            return False
        window = np.s_[v - 2 : v + 3, u - 2 : u + 3]
        if self.blocked is not None and self.blocked[window].any():
            return False
        around = self.view.frame.depth[window]
        near = _nearer(self.view.noise)
        return not bool(((around > 0) & (around < depth - near) & ~self.mask[window]).any())


def _projected(view: View, vertices: Array) -> tuple[Array, Array]:
    """Pixels (B, K, 2) and depths (B, K)."""
    frame, k = view.frame, view.frame.intrinsics
    local = (vertices - np.asarray(frame.pose.position)) @ frame.pose.rotation
    depth = np.maximum(local[..., 2], 0.05)
    return local[..., :2] / depth[..., None] * np.array([k.fx, k.fy]) + np.array([k.cx, k.cy]), depth


def main_pieces(mask: np.ndarray) -> np.ndarray:
    """The mask without stray pieces, shape (H, W)."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    if count <= 2:
        return mask
    areas = stats[1:, cv2.CC_STAT_AREA]
    large = np.flatnonzero(areas >= _PIECE * areas.max()) + 1
    return np.isin(labels, large)


def silhouette(view: View, mask: np.ndarray, blocked: np.ndarray | None = None) -> Silhouette | None:
    """Of a mask (H, W); None if it shows nothing with depth. ``blocked``: pixels of what covers everything behind
    it, such as the arm."""
    frame = view.frame
    contour = cv2.findNonZero(mask.astype(np.uint8))
    if contour is None:
        return None
    depth = frame.depth
    own = depth[mask & (depth > 0)]
    if len(own) == 0:
        return None
    hull = cv2.convexHull(contour)[:, 0, :].astype(float)
    extreme = hull[np.argmax(hull @ DIRECTIONS.T, axis=0)]  # (COUNT, 2)
    support = (extreme * DIRECTIONS).sum(axis=1) + _BEYOND_CENTRE
    valid = _uncovered(depth, mask, extreme.astype(int), blocked, _nearer(view.noise))
    scale = (frame.intrinsics.fx + frame.intrinsics.fy) / 2 / float(np.median(own))
    return Silhouette(view, mask, blocked, support, valid, scale)


def _nearer(noise: float) -> float:
    """By how much (m) the nearest pixels of what covers an outline are nearer, in depth with this deviation (m)."""
    return _NEARER + 2 * noise


def _uncovered(
    depth: np.ndarray, mask: np.ndarray, extreme: np.ndarray, blocked: np.ndarray | None, nearer: float
) -> np.ndarray:
    """Whether nothing that is ``nearer`` by so much (m) lies beside each of these outline pixels (COUNT, 2), and the
    picture goes on there."""
    height, width = depth.shape
    half = _AROUND // 2
    free = np.zeros(len(extreme), dtype=bool)
    for i, (u, v) in enumerate(extreme):
        if not (half <= u < width - half and half <= v < height - half):
            continue
        window = np.s_[v - half : v + half + 1, u - half : u + half + 1]
        inside, around = mask[window], depth[window]
        if blocked is not None and blocked[window].any():
            continue
        mine, others = around[inside & (around > 0)], around[~inside & (around > 0)]
        free[i] = len(mine) == 0 or len(others) == 0 or others.min() > np.median(mine) - nearer
    return free
