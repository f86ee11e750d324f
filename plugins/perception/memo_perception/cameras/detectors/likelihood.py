"""How likely a region is a line of an inventory, and which lines all regions together are most likely to be.

Costs are negative logarithms of likelihoods. Extents are compared with heavy tails, since things cover each other and a
region may be a piece of a thing only; how sure a name is follows from the next best explanation of everything.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import attrs
import numpy as np
from scipy.optimize import linear_sum_assignment

from memo_core.plugin import Array
from memo_perception.cameras.geometry.panels import slides
from memo_perception.cameras.inventory import Hint, Item
from memo_perception.cameras.regions import Region

UNKNOWN = 7.0  # cost of a line that is not there, and a region that no line describes
_NEVER = 1e3
_COLOUR = 2.5  # weight of the logarithm of the share of pixels that have a line's colours
_MOST = 0.7  # share of the pixels from which on the colour is right
_LEAST = 0.02  # share of the pixels whose colour may be wrong
_SIZE = 1.5  # weight of an extent
_RELATIVE = 0.02  # of an extent, by which a list may be wrong
_COVERED = (3.0, 0.05)  # of what is covered or touches others more may be missing: times as much, and of the extent
_BARE = (1.5, 0.0)  # the same of what stands alone
_UNSAID = 2.0  # cost of a line that says no size, or no colour
_SHADED = 0.4
_NEXT = {
    frozenset(pair)
    for pair in (
        ("white", "grey"),
        ("grey", "black"),
        ("white", "beige"),
        ("brown", "orange"),
        ("brown", "beige"),
        ("brown", "black"),
    )
}  # colours that shade or glare turns into each other


@attrs.frozen(eq=False)
class Piece:
    """What is compared of a region, or of several together."""

    regions: tuple[Region, ...]
    low: Array  # (3,) m
    high: Array  # (3,) m
    extents: Array  # (3,) m, descending
    deviation: float  # m, of each of the extents
    colours: dict[str, float]  # word -> share of the pixels
    bare: bool = False  # whether nothing covers it or touches it

    @property
    def ids(self) -> frozenset[int]:
        return frozenset(region.id for region in self.regions)

    @property
    def count(self) -> int:
        return sum(len(region.points) for region in self.regions)


def most_likely(
    items: Sequence[Item],
    pieces: Sequence[Piece],
    hints: Sequence[Hint],
    together: Callable[[Item, Piece, Piece], bool],
) -> list[tuple[Item, Piece, float]]:
    """The lines and pieces that belong together in the likeliest explanation of all, and the probability of each pair
    against the likeliest explanation without it. ``together``: whether two pieces may both be of one such thing, so
    that neither speaks against the other."""
    if not items or not pieces:
        return []
    costs = np.array([[cost(item, piece, hints) for piece in pieces] for item in items])
    total, pairs = _assigned(costs)
    found = []
    for i, j in pairs:
        same = [k for k, item in enumerate(items) if item.label == items[i].label]
        of_it = {k for k, piece in enumerate(pieces) if k != j and together(items[i], pieces[j], piece)}
        rival, instead = _without(costs, same, [j])
        if of_it & {column for row, column in instead if row in same} and j not in {column for _, column in instead}:
            rival, _ = _without(costs, same, [j, *of_it])
        found.append((items[i], pieces[j], float(1 / (1 + np.exp(total - rival)))))
    return found


def _without(costs: Array, rows: list[int], columns: list[int]) -> tuple[float, list[tuple[int, int]]]:
    """``_assigned`` with these pairs forbidden."""
    other = costs.copy()
    other[np.ix_(rows, columns)] = _NEVER
    return _assigned(other)


def _assigned(costs: Array) -> tuple[float, list[tuple[int, int]]]:
    """The least sum of costs (N, M), and the pairs in it that are better than ``UNKNOWN``."""
    padded = np.concatenate([costs, np.full((len(costs), len(costs)), UNKNOWN)], axis=1)
    rows, columns = linear_sum_assignment(padded)
    pairs = [(int(i), int(j)) for i, j in zip(rows, columns, strict=True) if j < costs.shape[1]]
    return float(padded[rows, columns].sum()), pairs


def cost(item: Item, piece: Piece, hints: Sequence[Hint] = ()) -> float:
    """Negative logarithm of the likelihood of what is seen of a piece if it is this item, up to a constant."""
    middle = (piece.low + piece.high) / 2
    for hint in hints:
        place = hint.position
        if hint.label == item.label and place is not None and np.linalg.norm(middle - np.asarray(place)) < 0.05:
            return _NEVER  # a person said that this is not it
    return _colour_cost(item, piece) + _size_cost(item, piece)


def _colour_cost(item: Item, piece: Piece) -> float:
    if not item.colours:
        return _UNSAID
    share = sum(share * _alike(word, item.colours) for word, share in piece.colours.items()) / _MOST
    return float(-_COLOUR * np.log(np.clip(share, _LEAST, 1.0)))


def _size_cost(item: Item, piece: Piece) -> float:
    if not item.size:
        return _UNSAID
    wanted = np.sort(np.asarray(item.size, dtype=float))[::-1]
    costs = [_extents_cost(piece.extents, wanted, piece)]
    if slides(item.label):  # of a drawer that is pushed in the front is seen, and not how deep it is
        costs += [_extents_cost(piece.extents[:2], np.delete(wanted, axis), piece) for axis in range(3)]
    if item.kind == "part" and item.label.endswith("handle"):  # it stands on posts, as far out as they reach
        costs.append(_extents_cost(piece.extents[[0, 2]], wanted[[0, 2]], piece))
    return min(costs)


def _extents_cost(extents: Array, wanted: Array, piece: Piece) -> float:
    """Of two lists of extents (m) in the same order."""
    excess = extents - wanted
    usual = piece.deviation + _RELATIVE * wanted
    times, share = _BARE if piece.bare else _COVERED
    scale = np.where(excess > 0, usual, times * usual + share * wanted)
    return float(_SIZE * np.log1p(0.5 * (excess / scale) ** 2).sum())


def _alike(word: str, wanted: Sequence[str]) -> float:
    """1 for a colour that is wanted, less for one that shade or glare makes of it."""
    return 1.0 if word in wanted else _SHADED if any(frozenset((word, one)) in _NEXT for one in wanted) else 0.0
