"""The insides of a thing: the largest empty boxes between the boxes that it is made of for collisions."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence

import attrs
import numpy as np

from memo_core.plugin import Array, Vector

CELL_M = 0.005
_LEAST_SIDE_M, _LEAST_VOLUME_M3 = 0.03, 1e-4
_WALL_CELLS = 4  # a wall this near counts
_WALLED = 0.5  # share of a side that must be walled
_SEED_CELLS = 4  # distance of the cells from which boxes are grown
_SIDES = tuple((axis, sign) for axis in range(3) for sign in (-1, 1))
_DOWN = (2, -1)


@attrs.frozen
class Solid:
    """A box: its centre (m), unit axes as rows, and half extents (m)."""

    centre: Vector
    axes: tuple[Vector, Vector, Vector]
    half: Vector


@attrs.frozen
class Hollow:
    """An empty box between walls: centre, full extents (m), and the outward direction of its open side."""

    centre: Vector
    size: Vector
    opening: Vector


@functools.lru_cache(maxsize=256)
def hollows(solids: tuple[Solid, ...], most: int) -> tuple[Hollow, ...]:
    """Find the insides of a thing.

    Args:
        solids: what it is made of, in a frame whose z is up.
        most: how many are looked for.

    Returns:
        The largest first: boxes with a floor and at least two walls, 3 cm or more in every direction.
    """
    if not solids:
        return ()
    low, solid = _occupied(solids)
    filled = solid.copy()
    found: list[Hollow] = []
    while len(found) < most:
        box = _largest(filled, solid)
        if box is None:
            break
        filled[tuple(slice(a, b) for a, b in zip(*box, strict=True))] = True
        found.append(_told(box, low, solid))
    return tuple(found)


Box = tuple[tuple[int, ...], tuple[int, ...]]  # first cells, and those after the last


def _occupied(solids: Sequence[Solid]) -> tuple[Array, np.ndarray]:
    """Lowest corner of a grid around all of them, and which of its cells are solid."""
    reaches = [np.abs(np.array(one.axes)).T @ np.array(one.half) for one in solids]
    low = np.min([np.array(one.centre) - reach for one, reach in zip(solids, reaches, strict=True)], axis=0)
    high = np.max([np.array(one.centre) + reach for one, reach in zip(solids, reaches, strict=True)], axis=0)
    cells = np.maximum(np.ceil((high - low) / CELL_M).astype(int), 1)
    centres = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in cells), indexing="ij"), -1) * CELL_M + low
    occupied = np.zeros(cells, dtype=bool)
    for one in solids:
        local = np.abs((centres - np.array(one.centre)) @ np.array(one.axes).T)
        occupied |= np.all(local <= np.maximum(one.half, CELL_M / 2 + 1e-6), axis=-1)
    return low, occupied


def _largest(filled: np.ndarray, solid: np.ndarray) -> Box | None:
    """The largest box of empty cells that has a floor and walls."""
    sums = np.pad(filled, ((1, 0),) * 3).astype(int).cumsum(0).cumsum(1).cumsum(2)
    best, volume = None, _LEAST_VOLUME_M3 / CELL_M**3
    for seed in itertools.product(*(range(_SEED_CELLS // 2, n, _SEED_CELLS) for n in filled.shape)):
        if filled[seed] or (best is not None and _within(seed, best)):
            continue
        box = _grown(sums, seed)
        extents = [b - a for a, b in zip(*box, strict=True)]
        if min(extents) * CELL_M >= _LEAST_SIDE_M and np.prod(extents) > volume and _is_inside(box, solid):
            best, volume = box, float(np.prod(extents))
    return best


def _within(cell: Sequence[int], box: Box) -> bool:
    return all(a <= at < b for a, at, b in zip(box[0], cell, box[1], strict=True))


def _grown(sums: np.ndarray, seed: tuple[int, ...]) -> Box:
    """A box of empty cells around one, grown on all sides in turn as far as it goes."""
    low, high = list(seed), [at + 1 for at in seed]
    growing = list(_SIDES)
    while growing:
        for axis, sign in tuple(growing):
            corner = low if sign < 0 else high
            corner[axis] += sign
            if not 0 <= corner[axis] < sums.shape[axis] or _count(sums, low, high):
                corner[axis] -= sign
                growing.remove((axis, sign))
    return tuple(low), tuple(high)


def _count(sums: np.ndarray, low: Sequence[int], high: Sequence[int]) -> int:
    """Filled cells in a box, from the sums of all boxes that begin at the origin."""
    (a, b, c), (x, y, z) = low, high
    upper = sums[x, y, z] - sums[a, y, z] - sums[x, b, z] + sums[a, b, z]
    return int(upper - sums[x, y, c] + sums[a, y, c] + sums[x, b, c] - sums[a, b, c])


def _walled(box: Box, side: tuple[int, int], solid: np.ndarray) -> float:
    """Share of a side of a box that has something solid next to it."""
    axis, sign = side
    across = [slice(a, b) for a, b in zip(*box, strict=True)]
    edge = box[0][axis] if sign < 0 else box[1][axis]
    across[axis] = slice(max(edge - _WALL_CELLS, 0), edge) if sign < 0 else slice(edge, edge + _WALL_CELLS)
    return float(solid[tuple(across)].any(axis=axis).mean()) if across[axis].start != across[axis].stop else 0.0


def _is_inside(box: Box, solid: np.ndarray) -> bool:
    walls = [side for side in _SIDES if side[0] != 2 and _walled(box, side, solid) > _WALLED]
    return len(walls) >= 2 and _walled(box, _DOWN, solid) > _WALLED


def _told(box: Box, low: Array, solid: np.ndarray) -> Hollow:
    first, last = (np.array(corner) * CELL_M + low for corner in box)
    # The way in from above first, where that is as open as from a side.
    sides = sorted((side for side in _SIDES if side != _DOWN), key=lambda side: side != (2, 1))
    axis, sign = min(sides, key=lambda side: round(_walled(box, side, solid), 1))
    opening = tuple(float(sign) if number == axis else 0.0 for number in range(3))
    return Hollow(_vector((first + last) / 2), _vector(last - first), _vector(opening))


def _vector(values: Sequence[float] | Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
