"""What stands out of a flat face of the same colour: the handle of a black door, and the door itself of a grey locker.

Furniture is convex but for what is fixed to it, so nothing of it lies before the plane of one of its faces. A face out
of which something stands is a door or a drawer front, and is parted from the rest as well.
"""

from __future__ import annotations

from collections.abc import Iterator

import attrs
import cv2
import numpy as np

from memo_core.plugin import Array
from memo_perception.cameras.geometry.panels import largest_plane

_WIDE = 0.15  # m: a face is at least this long and half as wide
_FACES = 3  # of a box, as many are seen
_LEAST_SHARE = 0.08  # of the pixels, that a face has
_MOST_SHARE = 0.3  # of the pixels, that stand out; with more it is no face that they stand out of
_OFF = 0.012  # m before the plane from which on something stands out, without noise
_FAR = 0.1  # m before the plane up to which it does
_LEAST_PIXELS = 25
_BESIDE = 0.02  # m beyond the face's edge where something may stand out
_UPRIGHT = 0.5  # vertical share of a face's normal up to which it stands


@attrs.frozen(eq=False)
class Split:
    """Pieces of a segment, each a mask (H, W): what stands out, the faces it stands out of, and the rest."""

    out: tuple[np.ndarray, ...]
    faces: tuple[np.ndarray, ...]
    rest: np.ndarray


def split(points: Array, mask: np.ndarray, others: np.ndarray, noise: float, eye: Array, depth: int = 2) -> Split:
    """Pieces of the pixels ``mask`` (H, W), whose points are ``points`` (H, W, 3; m, NaN: not measured), as seen from
    ``eye`` (3,). ``others`` (H, W): pixels of other things, which may stand out of a face as well; ``depth``: how often
    what stands out may itself be split, as a door with a handle."""
    out: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    rest = mask.copy()
    own = points[mask]
    own = own[np.isfinite(own[:, 0])]
    if len(own) < 10 * _LEAST_PIXELS or not depth:
        return Split((), (), rest)
    near = max(0.004, 2.5 * noise)
    for normal, distance in _planes(own, noise, near, eye):
        off = points @ normal - distance
        with np.errstate(invalid="ignore"):
            face = rest & (np.abs(off) <= max(_OFF, 2.5 * noise))
            before = (rest | others) & (off > _OFF + 3 * noise) & (off < _FAR)
        if not before.any() or not face.any():
            continue
        before &= _beside(points, face, before, normal)
        if np.count_nonzero(before & mask) > _MOST_SHARE * np.count_nonzero(mask):
            continue
        pieces = _pieces(before & rest)
        fixed = [one for one in _pieces(before & others) if _is_fixed(points[one], off[one], points[face])]
        if not pieces and not fixed:
            continue
        for one in pieces:
            inner = split(points, one, others, noise, eye, depth - 1)
            out += [*inner.out, *inner.faces]
            if inner.rest.any():
                out.append(inner.rest)
            rest &= ~one
        if abs(normal[2]) < _UPRIGHT:
            faces.append(face)
            rest &= ~face
    return Split(tuple(out), tuple(faces), rest)


def _is_fixed(piece: Array, off: Array, face: Array) -> bool:
    """Whether a piece of something else (N, 3), so far before a face (N,), is fixed to the face (M, 3) rather than
    standing before it."""
    reaches = float(np.percentile(off, 1)) < 2.5 * _OFF
    return reaches and float(np.nanmin(piece[:, 2])) > float(np.nanpercentile(face[:, 2], 1)) + _BESIDE


def _planes(own: Array, noise: float, near: float, eye: Array) -> Iterator[tuple[Array, float]]:
    """The faces among points (N, 3), the largest first: unit normals (3,) towards the eye, and distances along them."""
    left = own
    for _ in range(_FACES):
        plane = largest_plane(left, noise)
        if plane is None:
            return
        normal, anchor = plane
        if normal @ (eye - anchor) < 0:
            normal = -normal
        distance = float(normal @ anchor)
        on = np.abs(left @ normal - distance) <= near
        if np.count_nonzero(on) < _LEAST_SHARE * len(own):
            return
        # The plane through a corner of a round thing is long, but not wide.
        low, high = np.percentile((left[on] - anchor) @ _across(normal).T, [3, 97], axis=0)
        if max(high - low) >= _WIDE and min(high - low) >= _WIDE / 2:
            yield normal, distance
        left = left[~on]


def _across(normal: Array) -> Array:
    """Two unit vectors (2, 3) in a plane, one of them level."""
    level = np.cross(normal, [0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else np.cross(normal, [0.0, 1.0, 0.0])
    level /= np.linalg.norm(level)
    return np.array([level, np.cross(normal, level)])


def _beside(points: Array, face: np.ndarray, before: np.ndarray, normal: Array) -> np.ndarray:
    """Those pixels (H, W) of ``before`` whose points lie before the face itself, not beyond its edges."""
    sides = _across(normal)
    low, high = np.percentile(points[face] @ sides.T, [1, 99], axis=0)
    inside = np.zeros_like(before)
    flat = points[before] @ sides.T
    inside[before] = np.all((flat > low - _BESIDE) & (flat < high + _BESIDE), axis=1)
    return inside


def _pieces(mask: np.ndarray) -> list[np.ndarray]:
    """Its connected pieces that are not tiny; a gap of two pixels is none."""
    joined = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8))
    count, labels = cv2.connectedComponents(joined, connectivity=8)
    pieces = [mask & (labels == label) for label in range(1, count)]
    return [piece for piece in pieces if np.count_nonzero(piece) >= _LEAST_PIXELS]
