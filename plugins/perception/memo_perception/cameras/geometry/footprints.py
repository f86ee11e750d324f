"""Footprints of flat things, from outlines alone: a visual hull (Laurentini, 1994) of one layer.

Of a thing that lies flat, depth noise is larger than what tells a spoon from a knife, and no simple shape has its
outline. But where it lies is known, and how thick it is can be averaged over all its pixels: so a place belongs to it
if, in every picture that shows the place, both its lower and its upper end are in the mask.
"""

from __future__ import annotations

import numpy as np

from memo_core.plugin import Array
from memo_perception.cameras.geometry.silhouettes import Silhouette

CELL = 0.002  # m
_AROUND = 0.02  # m beyond the points in which places are tried


def footprint(silhouettes: tuple[Silhouette, ...], flat: Array, low: float, high: float) -> Array:
    """Places (N, 2) of the base frame, ``CELL`` apart, that a thing between the heights ``low`` and ``high`` (m)
    covers. ``flat`` (M, 2): roughly where it is seen. A picture in which something covers a place does not count
    there."""
    corner, end = np.percentile(flat, [2, 98], axis=0)
    axes = [np.arange(a - _AROUND, b + _AROUND, CELL) for a, b in zip(corner, end, strict=True)]
    x, y = (grid.ravel() for grid in np.meshgrid(*axes, indexing="ij"))
    there, shown = np.ones(len(x), dtype=bool), np.zeros(len(x), dtype=bool)
    for one in silhouettes:
        inside, seen = one.holds(np.column_stack([x, y, np.full_like(x, low)]))
        upper, above = one.holds(np.column_stack([x, y, np.full_like(x, high)]))
        seen &= above
        there &= (inside & upper) | ~seen
        shown |= seen
    return np.column_stack([x, y])[there & shown]
