"""Doors, drawers, lids, handles and knobs: parts, measured in the frame of what they belong to."""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.plugin import Array, Pose, quaternion_from_rotation
from memo_perception.cameras.geometry.fitting import Fit, Seen, fit_box, rectangle

CLOSERS = ("door", "lid", "drawer", "flap", "gate", "hatch", "cover")  # words for what closes an inside
OPEN_ANGLE = np.radians(6.5)  # turned farther than this, a door is open: the hand of a person begins to fit
OPEN_GAP = 0.02  # m that a drawer or lid stands off farther than its own thickness
_THICK = 0.05  # m: what is deeper than this is no panel
_ASKEW = np.radians(8)  # from which on a long part does not follow what it is part of
_LONG = 1.8  # length over width and height from which a part is long
_UPRIGHT = 0.5  # vertical share of a panel's normal up to which it stands


def is_closer(label: str) -> bool:
    """Whether a part with this label closes an inside."""
    return bool(set(label.lower().split()) & set(CLOSERS))


def slides(label: str) -> bool:
    """Whether a part with this label is pulled out straight, without turning."""
    return "drawer" in label.lower().split()


def owner_frame(fit: Fit, front: Array | None) -> Array:
    """Upright axes of a piece of furniture as columns (3, 3): x into its depth, away from who stands before it, y to
    the left, z up. ``front``: a direction (3,) out of its front, if one is known; otherwise it faces the robot."""
    rotation = fit.pose.rotation
    towards = np.asarray(fit.pose.position) if front is None else -np.asarray(front, dtype=float)
    towards = np.array([towards[0], towards[1], 0.0])
    options = [sign * rotation[:, axis] for axis in (0, 1, 2) if abs(rotation[2, axis]) < 0.5 for sign in (1, -1)]
    x = max(options, key=lambda option: float(option @ towards))
    x = np.array([x[0], x[1], 0.0]) / np.hypot(x[0], x[1])
    return np.column_stack([x, np.cross([0.0, 0.0, 1.0], x), [0.0, 0.0, 1.0]])


def in_frame(fit: Fit, frame: Array) -> Fit:
    """The same box with the axes of ``frame`` (3, 3), which are its own in another order."""
    order = [int(np.argmax(np.abs(fit.pose.rotation.T @ frame[:, axis]))) for axis in range(3)]
    size = (fit.size[order[0]], fit.size[order[1]], fit.size[order[2]])
    return attrs.evolve(fit, pose=Pose(fit.pose.position, quaternion_from_rotation(frame)), size=size)


def fit_panel(seen: Seen, label: str, owner: Fit) -> Fit:
    """A door, drawer or lid of ``owner``, whose axes are those of ``owner_frame``. Its x axis points against its outer
    face's normal; a hinged one may have turned about any axis of its own plane."""
    frame = owner.pose.rotation
    if slides(label):
        return fit_box(seen, frame, ())
    normal = plane_normal(seen)
    if normal is None:
        return fit_box(seen, frame, (2,))
    eyes = np.mean([one.view.frame.pose.position for one in seen.silhouettes], axis=0)
    middle = np.median(seen.points, axis=0)
    if abs(normal[2]) < _UPRIGHT:
        # An upright door shows its inner face when it is wide open: keep the side that was outer when closed.
        x = -normal if normal @ (eyes - middle) > 0 else normal
        x = np.array([x[0], x[1], 0.0]) / np.hypot(x[0], x[1])
        base = np.column_stack([x, np.cross([0.0, 0.0, 1.0], x), [0.0, 0.0, 1.0]])
        return fit_box(seen, base, (2,))
    x = normal if normal[2] < 0 else -normal
    sides = [frame[:, 0], frame[:, 1]]
    y = min(sides, key=lambda side: abs(float(side @ normal)))
    y = y - (y @ x) * x
    y /= np.linalg.norm(y)
    base = np.column_stack([x, y, np.cross(x, y)])
    return fit_box(seen, base, (1,))


def plane_normal(seen: Seen) -> Array | None:
    """Unit normal (3,) of the largest plane among the points; None for too few points."""
    plane = largest_plane(seen.points, seen.noise)
    return None if plane is None else plane[0]


def largest_plane(points: Array, noise: float, tries: int = 60) -> tuple[Array, Array] | None:
    """Unit normal (3,) and a point (3,) of the largest plane among points (N, 3), by RANSAC (Fischler and Bolles,
    1981); None for too few points. ``noise``: standard deviation of depth (m)."""
    if len(points) < 30:
        return None
    rng = np.random.default_rng(len(points))
    some = points[rng.integers(len(points), size=min(len(points), 600))]
    triples = some[rng.integers(len(some), size=(tries, 3))]
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    good = lengths > 1e-5
    normals, anchors = normals[good] / lengths[good, None], triples[good, 0]
    if len(normals) == 0:
        return None
    within = max(0.003, 2.0 * noise)
    votes = (np.abs(some @ normals.T - np.sum(anchors * normals, axis=1)) < within).sum(axis=0)
    best = int(np.argmax(votes))
    near = np.abs((points - anchors[best]) @ normals[best]) < within
    on = points[near]
    if len(on) <= 10:
        return normals[best], anchors[best]
    middle = on.mean(axis=0)
    return np.linalg.svd(on - middle, full_matrices=False)[2][2], middle


def fit_part(seen: Seen, owner: Fit) -> Fit:
    """A handle, knob, button or any other part: a box along the axes of what it is part of, unless it is long and lies
    across them, as a pan's handle or a lever does."""
    own = rectangle(seen)
    long, short = (0, 1) if own.size[0] >= own.size[1] else (1, 0)
    along = own.pose.rotation[:, long]
    across = float(np.abs(owner.pose.rotation.T @ along).max()) < np.cos(_ASKEW)
    if across and own.size[long] > _LONG * max(own.size[short], own.size[2]):
        return fit_box(seen, own.pose.rotation, (2,))
    return fit_box(seen, owner.pose.rotation, ())


def is_open(panel: Fit, owner: Fit) -> bool:
    """Whether a closer of ``owner`` stands open, by its angle to the face it closes and its distance from it."""
    local = owner.pose.inverse().apply(np.asarray(panel.pose.position))
    half = np.asarray(owner.size) / 2
    faces = {(0, -1.0): -local[0] - half[0], (2, 1.0): local[2] - half[2]}
    faces |= {(1, sign): sign * local[1] - half[1] for sign in (-1.0, 1.0)}
    # The front counts double: an open door hangs beyond a side of the front as well.
    axis, sign = max(faces, key=lambda face: faces[face] + (0.01 if face[0] == 0 else 0.0))
    out = sign * owner.pose.rotation[:, axis]
    thin = int(np.argmin(panel.size))
    if panel.size[thin] < _THICK:
        turned = np.arccos(min(1.0, abs(float(out @ panel.pose.rotation[:, thin]))))
        if turned > OPEN_ANGLE:
            return True
        gap = faces[axis, sign] - panel.size[thin] / 2
        return bool(gap > OPEN_GAP)
    reach = float(np.abs(panel.pose.rotation.T @ out) @ np.asarray(panel.size)) / 2
    return bool(faces[axis, sign] + reach > _THICK + OPEN_GAP)
