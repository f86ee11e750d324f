"""How things are built as far as a look tells: which parts they have, how these are shaped and where they sit.

A door is a thin panel with its handle near an edge, a drawer a deep box with its handle in the middle. Compared are
shapes and places in proportion to the thing itself, so neither names nor size, side or orientation count.
"""

from __future__ import annotations

import itertools
import math

import attrs
import numpy as np

from memo_core.scene.graph import Node, SceneGraph

_SCALE = 0.6  # sum of the differences of two parts' numbers at which their likeness is 1/e
_OTHER_NOUN = 0.7  # likeness of parts that are called by different words, over that of others
_LEAST = 1e-4  # m; flat boxes have no sides of length 0


@attrs.frozen
class Part:
    """A thing or one of its parts. ``shape``: its two shorter extents over the longest; ``place``: the offset of its
    centre from that of what it is part of over that one's extents, largest first, at most 0.5 (on the surface)."""

    noun: str  # last word of its label; "" for the thing itself
    shape: tuple[float, float]
    place: tuple[float, float, float] = (0.0, 0.0, 0.0)


@attrs.frozen
class Structure:
    """The thing itself, then its parts."""

    parts: tuple[Part, ...]


def structure_of(scene: SceneGraph, node: Node) -> Structure:
    """Of a whole thing with all parts that are seen; of a part, such as one drawer of several, with what it is part of
    and its own parts only."""
    by_id = {one.id: one for one in scene.nodes}
    chain = [node]
    while (above := by_id.get(chain[0].part_of or "")) is not None and above not in chain:
        chain.insert(0, above)
    found = [_part(one, whole) for one, whole in zip(chain, [None, *chain], strict=False)]
    level, seen = [node], {one.id for one in chain}
    while level:
        below = [(one, by_id[one.part_of]) for one in scene.nodes if one.part_of in {above.id for above in level}]
        below = [(one, whole) for one, whole in below if one.kind != "space" and one.id not in seen]
        found += [_part(one, whole) for one, whole in below]
        level = [one for one, _ in below]
        seen |= {one.id for one in level}
    return Structure(tuple(found))


def alikeness(one: Structure, other: Structure) -> float:
    """0 (nothing in common) to 1 (built the same): twice the likeness of the parts that correspond, the most alike
    first, over the number of parts of both (the coefficient of Dice, 1945, with graded matches)."""
    pairs = sorted(
        (-_likeness(a, b), i, j) for (i, a), (j, b) in itertools.product(enumerate(one.parts), enumerate(other.parts))
    )
    mine, theirs, shared = set(range(len(one.parts))), set(range(len(other.parts))), 0.0
    for negative, i, j in pairs:
        if i in mine and j in theirs:
            mine.discard(i)
            theirs.discard(j)
            shared -= negative
    return 2 * shared / (len(one.parts) + len(other.parts))


def _part(node: Node, whole: Node | None) -> Part:
    small, middle, large = sorted(max(extent, _LEAST) for extent in node.size)
    shape = (middle / large, small / large)
    if whole is None:
        return Part("", shape)
    offset = whole.pose.rotation.T @ (np.asarray(node.pose.position) - np.asarray(whole.pose.position))
    shares = np.minimum(np.abs(offset) / np.maximum(whole.size, _LEAST), 0.5)
    first, second, third = sorted(shares.tolist(), reverse=True)
    words = node.label.lower().split()
    return Part(words[-1] if words else "", shape, (first, second, third))


def _likeness(one: Part, other: Part) -> float:
    if bool(one.noun) != bool(other.noun):  # a thing itself and a part
        return 0.0
    numbers = zip((*one.shape, *one.place), (*other.shape, *other.place), strict=True)
    alike = math.exp(-sum(abs(a - b) for a, b in numbers) / _SCALE)
    return alike if one.noun == other.noun else _OTHER_NOUN * alike
