"""Exact cosines of one key with all keys of a book, from the few parts that the keys are made of.

A key's vectors consist of those of a verb, the moved object and the destination
(``memo_core.skillbook.key_embedding``), and a book of thousands of keys has some dozens of verbs and some hundreds of
objects. So inner products are computed once per distinct part and combined per key: a few numbers per key instead of
complete vectors.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

import attrs
import numpy as np

_Part = TypeVar("_Part", bound=Hashable)


@attrs.frozen(eq=False)
class KeyParts:
    """Keys split into their parts; d is the embedder's dimension. The objects' unit vector of key i is
    ``[moved[moved_of[i]] ; places[place_of[i]]] * share[i]``."""

    actions: np.ndarray  # unit vectors of the different verbs, float32 (verbs, d)
    action_of: np.ndarray  # int64 (keys,)
    moved: np.ndarray  # of what is moved, float32 (different ones, d)
    moved_of: np.ndarray  # int64 (keys,)
    places: np.ndarray  # of where to, float32 (different ones, d); zeros for keys without
    place_of: np.ndarray  # int64 (keys,)
    share: np.ndarray  # what makes both halves together a unit vector, float32 (keys,)

    def __len__(self) -> int:
        return len(self.action_of)

    def cosines(self, action: np.ndarray, objects: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Cosines of all keys' actions with ``action``, shape (d,), of their objects with ``objects``, shape (2 d,),
        both unit vectors, of the moved objects alone, and of the objects in exchanged roles, what is moved compared
        with the destination (0 where one of both has no destination); float64, shape (keys,)."""
        half = len(objects) // 2
        thing, place = objects[:half], objects[half:]
        by_action = np.vecdot(self.actions, action).astype(np.float64)[self.action_of]
        by_moved = np.vecdot(self.moved, thing).astype(np.float64)[self.moved_of]
        alone = by_moved / (float(np.linalg.norm(thing)) or 1.0)
        if not place.any():
            return by_action, by_moved * self.share, alone, np.zeros(len(self))
        by_place = np.vecdot(self.places, place).astype(np.float64)[self.place_of]
        as_place = np.vecdot(self.moved, place).astype(np.float64)[self.moved_of]
        as_moved = np.vecdot(self.places, thing).astype(np.float64)[self.place_of]
        crossed = np.where(as_place * as_moved != 0, (as_place + as_moved) * self.share, 0.0)
        return by_action, (by_moved + by_place) * self.share, alone, crossed


def distinct(parts: Sequence[_Part], make: Callable[[list[_Part]], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Vectors of the distinct parts, in order of appearance, and the index of each part among them, int64."""
    place_of = {part: place for place, part in enumerate(dict.fromkeys(parts))}
    vectors = np.ascontiguousarray(make([*place_of]), dtype=np.float32)
    return vectors, np.fromiter((place_of[part] for part in parts), dtype=np.int64, count=len(parts))
