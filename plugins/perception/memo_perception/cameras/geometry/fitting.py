"""Fitting a shape to what several pictures show of one thing: outlines first, depth second.

Outlines do not suffer from depth noise, and three of them fix an unoccluded box; depth says the rest. Of box, cylinder
and sphere the one that explains the outlines best is taken; long things that lie flat, as cutlery, are measured by
their footprints; what nothing explains gets the smallest upright rectangle around its points, trimmed by the noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import numpy as np
from scipy.optimize import least_squares

from memo_core.plugin import Array, Pose, quaternion_from_rotation
from memo_perception.cameras.geometry.footprints import CELL, footprint
from memo_perception.cameras.geometry.shapes import Box, Cylinder, Shape, Sphere
from memo_perception.cameras.geometry.silhouettes import Silhouette

POINTS = 160  # of a thing that a fit uses
_OUTLINE_SIGMA = 0.001  # m
_SUPPORT_SIGMA = 0.002  # m
_PRIOR_SIGMA = 0.02  # m: how far a fit may go from the points' extents where no outline speaks
_BLUR = 3.0  # deviations of depth by which the extents of a sphere may seem to differ
_STEP = 1e-5  # of the numerical Jacobian, m or rad
_SUNK = 0.015  # m: a shape that reaches this far below what the thing stands on is wrong
_NOT_THE_SHAPE = 0.0028  # m: outlines that miss by more are of something else
_CROSSWISE = 0.2  # sine of the angle by which a camera may look less across a direction than the best one
_COVERED = 0.005  # m, besides noise, by which an extent in one picture may exceed that in another that sees it better
_FLAT = 0.025  # m: what is no higher lies flat
_LENGTHY = 2.5  # length over width from which a flat thing is measured by its footprint
_FILLED = 0.75  # of its rectangle, up to which it is
_WHOLE = 0.96  # of the length its points have, that its footprint has
_LEAST_CELLS = 50
_INSIDE_LIMIT = 0.004  # m: points deeper inside a shape than this (of a hollow thing) count as this deep


@attrs.frozen(eq=False)
class Seen:
    """All that is seen of one thing."""

    points: Array  # (N, 3) base frame, m
    cameras: np.ndarray  # (N,) which of the silhouettes' pictures shows each point
    silhouettes: tuple[Silhouette, ...]
    noise: float  # m, standard deviation of depth
    support: float | None = None  # m: height of what it stands on, if known

    @property
    def outlines(self) -> int:
        """Number of directions in which an outline is seen."""
        return sum(int(one.valid.sum()) for one in self.silhouettes)


@attrs.frozen(eq=False)
class Fit:
    """A box around a thing. ``residual``: root mean square (m) by which its outlines miss; ``explained``: whether they
    are those of the shape, so that its size does not depend on the noise of depth."""

    pose: Pose
    size: tuple[float, float, float]
    shape: str  # "box", "cylinder", "sphere" or "rectangle"
    residual: float
    outlines: int
    explained: bool = False


def fit_thing(seen: Seen) -> Fit:
    """The upright box around a whole thing, about which nothing is known."""
    if (flat := _flat(seen)) is not None:
        return flat
    box = rectangle(seen)
    low_high = _heights(seen)
    start = _start(box, low_high, seen)
    width, depth, height = box.size
    fits = [_fitted(Box(), start, seen)]
    middle, radius = start[:3], (width + depth) / 4
    # The diagonal is a box's other explanation: start from there too when it is nearly square.
    if max(width, depth) < 1.35 * min(width, depth):
        turned = start.copy()
        turned[6] += np.pi / 4
        fits.append(_fitted(Box(), turned, seen))
        fits.append(_fitted(Cylinder(), np.array([*middle, radius, start[5]]), seen))
    blur = _BLUR * seen.noise
    if max(width, depth) < 1.35 * min(width, depth) + blur and abs(height / 2 - radius) < 0.3 * radius + blur / 2:
        fits.append(_fitted(Sphere(), np.array([*middle, radius]), seen))
    best = min(fits, key=lambda fit: fit.residual * _COMPLEXITY[fit.shape])
    if seen.outlines < 8:
        return best if best.residual < 2 * _NOT_THE_SHAPE else box
    sunk = _sunk(best, seen, low_high)
    if sunk and seen.support is None:  # then it may begin where it is seen to begin
        return fit_thing(attrs.evolve(seen, support=low_high[0]))
    fits_well = best.residual < _NOT_THE_SHAPE and not sunk
    return attrs.evolve(best, explained=True) if fits_well else attrs.evolve(box, residual=best.residual)


def _sunk(fit: Fit, seen: Seen, heights: tuple[float, float]) -> bool:
    """Whether a shape reaches below what the thing stands on, or where that is not known, far beyond the heights at
    which it is seen: outlines from above alone do not tell how high it is."""
    low, high = (fit.pose.position[2] + side * fit.size[2] / 2 for side in (-1, 1))
    if seen.support is not None:
        return low < seen.support - _SUNK
    beyond = _SUNK + 2 * seen.noise
    return fit.shape != "sphere" and (low < heights[0] - beyond or high > heights[1] + beyond)


_COMPLEXITY = {"box": 1.1, "cylinder": 1.0, "sphere": 1.0}  # a box has more parameters than the others


def fit_box(seen: Seen, base: Array, axes: tuple[int, ...], size: Sequence[float] | None = None) -> Fit:
    """A box whose orientation is known but for small rotations about some axes of ``base``. ``size``: known extents
    (m), kept."""
    low, high = extents(seen, base)
    full = high - low if size is None else np.asarray(size, dtype=float)
    start = np.array([*(base @ ((low + high) / 2)), *full, *[0.0] * len(axes)])
    fixed = () if size is None else (3, 4, 5)
    return _fitted(Box(base, axes), start, seen, fixed)


def rectangle(seen: Seen) -> Fit:
    """The upright box whose outline from above is the smallest rectangle around the points, trimmed by the noise; for
    long things along their principal axis, since the smallest rectangle follows a tapering side."""
    points = seen.points
    flat = points[:, :2]
    base = _upright(_yaw(flat, seen.noise))
    low, high = extents(seen, base)
    low[2], high[2] = _heights(seen)
    size = np.maximum(high - low, 0.002)
    pose = Pose(tuple(base @ ((low + high) / 2)), quaternion_from_rotation(base))
    return Fit(pose, tuple(size.tolist()), "rectangle", 0.0, seen.outlines)


def _flat(seen: Seen) -> Fit | None:
    """The rectangle around the footprint of what lies flat, is long and fills no rectangle, as cutlery; None for
    anything else, and where outlines leave less of it than its points show."""
    if seen.support is None:
        return None
    high = seen.support + _upper(seen)
    if high - seen.support > _FLAT:
        return None
    cells = footprint(seen.silhouettes, seen.points[:, :2], seen.support, high)
    if len(cells) < _LEAST_CELLS:
        return None
    base = _upright(_yaw(cells, 0.0))
    local = cells @ base[:2, :2]
    low, high_xy = local.min(axis=0) - CELL / 2, local.max(axis=0) + CELL / 2
    wide, long = sorted((high_xy - low).tolist())
    shown = max(rectangle(seen).size[:2])
    if long < _LENGTHY * wide or len(cells) * CELL**2 > _FILLED * wide * long or long < _WHOLE * shown:
        return None
    middle = base @ np.array([*(low + high_xy) / 2, (seen.support + high) / 2])
    size = (*(high_xy - low).tolist(), high - seen.support)
    return Fit(Pose(tuple(middle), quaternion_from_rotation(base)), size, "rectangle", 0.0, seen.outlines, True)


def _upper(seen: Seen) -> float:
    """How far the upper side of a flat thing lies above its support (m): noise cancels out over its pixels, of which
    most show that side."""
    return max(float(np.percentile(seen.points[:, 2], 75)) - (seen.support or 0.0), 0.004)


def _upright(yaw: float) -> Array:
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def extents(seen: Seen, base: Array) -> tuple[Array, Array]:
    """Lowest and highest coordinates (3,) of a thing along the columns of ``base`` (3, 3).

    Noise moves points along the rays of the camera that measured them, so each coordinate is taken from the pictures
    whose rays are most nearly across it, and trimmed by what noise remains."""
    local = seen.points @ base
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    groups = []
    for i, one in enumerate(seen.silhouettes):
        own = local[seen.cameras == i]
        if len(own) >= 20:
            ray = np.median(seen.points[seen.cameras == i], axis=0) - np.asarray(one.view.frame.pose.position)
            groups.append((own, np.abs(base.T @ ray) / np.linalg.norm(ray)))
    if not groups:
        return trimmed_extents(local, seen.noise)
    for axis in range(3):
        least = min(float(leaks[axis]) for _, leaks in groups)
        for own, leaks in sorted(groups, key=lambda group: float(group[1][axis])):
            one_low, one_high = trimmed_extents(own[:, axis : axis + 1], seen.noise * float(leaks[axis]))
            crosswise = leaks[axis] <= least + _CROSSWISE
            # What those pictures do not show, since something covers it, others do: by more than noise explains.
            slack = 0.0 if crosswise else _COVERED + 3 * seen.noise * float(leaks[axis])
            if one_low[0] < low[axis] - slack:
                low[axis] = one_low[0]
            if one_high[0] > high[axis] + slack:
                high[axis] = one_high[0]
    return low, high


def trimmed_extents(points: Array, noise: float) -> tuple[Array, Array]:
    """Lowest and highest coordinates (3,) that points (N, 3) reach, without what noise adds to their extremes."""
    share = min(4.0, 0.2 + 1500 * max(noise - 0.0006, 0.0))  # percent to cut at each end: 4 at 3 mm
    low, high = np.percentile(points, [share, 100 - share], axis=0)
    back = 0.8 * max(noise - 0.0006, 0.0)
    return low + back, high - back


def _yaw(flat: Array, noise: float) -> float:
    cells = np.unique(np.round(flat / 0.002).astype(int), axis=0) * 0.002  # equal weight for equal area
    spread, axes = np.linalg.eigh(np.cov(cells.T)) if len(cells) > 3 else (np.ones(2), np.eye(2))
    if spread[1] > 4 * max(spread[0], 1e-9):
        return float(np.arctan2(axes[1, 1], axes[0, 1]))
    cells = cells[:: max(1, len(cells) // 1500)]
    yaws = np.radians(np.arange(0, 90, 2.0))
    areas = [_area(cells, yaw, noise) for yaw in yaws]
    return float(yaws[int(np.argmin(areas))])


def _area(flat: Array, yaw: float, noise: float) -> float:
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    low, high = trimmed_extents(flat @ turn, noise)
    return float(np.prod(high - low))


def _heights(seen: Seen) -> tuple[float, float]:
    """Underside and top of a thing (m): the underside on its support, if it stands on something known."""
    low, high = extents(seen, np.eye(3))
    if seen.support is not None:
        low[2] = seen.support
    return float(low[2]), float(max(high[2], low[2] + 0.002))


def _start(box: Fit, heights: tuple[float, float], seen: Seen) -> Array:
    x, y, _ = box.pose.position
    low, high = heights
    w, _, _, z = box.pose.orientation
    return np.array([x, y, (low + high) / 2, box.size[0], box.size[1], high - low, 2 * np.arctan2(z, w)])


def _fitted(shape: Shape, start: Array, seen: Seen, fixed: tuple[int, ...] = ()) -> Fit:
    """Least squares with a soft loss over the parameters that are not ``fixed``, twice: which outlines are covered is
    judged by the shape itself, first by the start, then by what was found from there."""
    points = _thinned(seen.points)
    best, looked = start, seen
    for _ in range(2):
        vertices = shape.vertices(best[None])[0]
        looked = attrs.evolve(seen, silhouettes=tuple(one.checked(vertices) for one in seen.silhouettes))
        best = _least_squares(shape, best, start, looked, points, fixed)
    pose, size = shape.box(best)
    return Fit(pose, size, shape.name, _misfit(shape, best, looked, points), looked.outlines)


def _least_squares(shape: Shape, at: Array, prior: Array, seen: Seen, points: Array, fixed: tuple[int, ...]) -> Array:
    free = [i for i in range(len(at)) if i not in fixed]
    depth_sigma = max(0.0012, seen.noise) * np.sqrt(max(1.0, len(points) / 40))
    prior_sigma = np.full(len(at), _PRIOR_SIGMA)
    prior_sigma[6:] = 0.35 if isinstance(shape, Box) and len(shape.axes) == 1 else 0.1

    def residuals(batch: Array) -> Array:
        parameters = np.repeat(at[None], len(batch), axis=0)
        parameters[:, free] = batch
        vertices = shape.vertices(parameters)
        rows = [one.residuals(vertices) / _OUTLINE_SIGMA for one in seen.silhouettes]
        rows.append(np.maximum(shape.distances(parameters, points), -_INSIDE_LIMIT) / depth_sigma)
        rows.append((parameters - prior) / prior_sigma)
        if seen.support is not None:
            rows.append((shape.underside(parameters)[:, None] - seen.support) / _SUPPORT_SIGMA)
        return np.concatenate(rows, axis=1)

    def jacobian(values: Array) -> Array:
        rows = residuals(np.vstack([values, values + _STEP * np.eye(len(values))]))
        return ((rows[1:] - rows[0]) / _STEP).T

    found = least_squares(
        lambda values: residuals(values[None])[0], at[free], jac=jacobian, loss="soft_l1", f_scale=2.0, max_nfev=12
    )
    best = at.copy()
    best[free] = found.x
    return best


def _misfit(shape: Shape, parameters: Array, seen: Seen, points: Array) -> float:
    vertices = shape.vertices(parameters[None])
    rows = [one.residuals(vertices)[0] for one in seen.silhouettes]
    if seen.outlines < 8:
        rows.append(shape.distances(parameters[None], points)[0])
    missed = np.concatenate(rows) if rows else np.zeros(1)
    return float(np.sqrt(np.mean(missed**2)))


def _thinned(points: Array) -> Array:
    if len(points) <= POINTS:
        return points
    return points[np.linspace(0, len(points) - 1, POINTS).astype(int)]
