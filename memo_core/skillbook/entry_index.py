"""The valid entries of one kind in memory: which key each is under, the vector and the terms of its text.

Derived data: read from the book when it is first needed, and brought up to date key by key when the book changes.
Entries that were read together lie together, key after key; later ones are appended, and those that are retired stay as
gaps, until so many were appended that everything is read anew.

Up to ``EXACT`` entries keep their vectors as they are. Of a larger book they are rounded to 8 bits a component, with a
scale for each vector: a cosine with a unit vector is then off by some 0.0004, at most 0.01; equal texts still tie.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from memo_core.skillbook.shared_terms import Terms, Wanted
from memo_core.skillbook.term_lists import TermLists, ranges, sorted_unique
from memo_core.skillbook.text_index import Likeness

EXACT = 20_000  # entries; 30 MB of vectors at 384 components
_MORE = 20_000  # entries that can be appended; or a quarter of those there are
_BLOCK = 512  # vectors compared at once: as numbers they stay in the processor's cache


class EntryIndex:
    """Entries by position, 0, 1, 2 …; keys by slot, in the order in which they were met."""

    def __init__(self, likeness: Likeness, kind: str, terms: Terms) -> None:
        self._likeness = likeness
        self._kind = kind
        self._terms = terms
        self._clear(0)

    @property
    def nbytes(self) -> int:
        """Bytes of memory in use."""
        used = self._count * (self._vectors.shape[1] * self._vectors.itemsize + 4 + 8 + 4 + 1)
        return used + self.terms.nbytes + self._term_slots.nbytes + self._sorted_ids.nbytes + self._by_id.nbytes

    def __len__(self) -> int:
        return self._valid

    # -- following the book --------------------------------------------------------------------------------------------
    def follow(self, keys: Sequence[int], changed: frozenset[int] | None, total: int) -> None:
        """Bring up to date. ``keys``: all keys that have entries, ascending; ``changed``: those whose entries may have
        changed, None: any; ``total``: how many entries there are."""
        asked = sorted({*keys, *self._slot_of} if changed is None else changed)
        if not self._count or total > len(self._ids) or not self._compare(asked):
            self._read_all(keys, total)
        self.sizes = np.bincount(self._slots[: self._count][self._there[: self._count]], minlength=self.slots)
        self._starts, stops = np.array(self._spans, np.int64).reshape(-1, 2).T
        self._lengths = stops - self._starts

    def clear(self) -> None:
        """Drop everything; the next ``follow`` reads it anew."""
        self._clear(0)

    def _clear(self, room: int, dimension: int = 0) -> None:
        rounded = room > EXACT + _MORE
        self._vectors = np.empty((room, dimension), np.int8 if rounded else np.float32)
        self._scales = np.ones(room, np.float32)
        self._ids = np.zeros(room, np.int64)
        self._slots = np.zeros(room, np.int32)
        self._there = np.zeros(room, bool)
        self._count = self._valid = 0
        self._keys: list[int] = []  # by slot
        self._slot_of: dict[int, int] = {}
        self._spans: list[tuple[int, int]] = []  # by slot: the positions of what was read at first
        self._appended: dict[int, list[int]] = {}  # by slot
        self._starts = self._lengths = np.zeros(0, np.int64)  # the same as arrays
        self._sorted_ids = np.zeros(0, np.int64)  # of what was read at first
        self._by_id = np.zeros(0, np.int32)  # and their positions
        self._appended_at: dict[int, int] = {}  # id -> position
        self.terms = TermLists(self._terms)
        self._term_slots = np.zeros(0, np.int32)  # of each term the slots where it occurs, of what was read at first
        self._term_starts = np.zeros(1, np.int64)  # where those of each term begin, and the end
        self._pairs: dict[int, set[int]] = {}  # term -> slots, of what was appended
        self.sizes = np.zeros(0, np.int64)  # by slot, how many valid entries are there

    def _read_all(self, keys: Sequence[int], total: int) -> None:
        self._clear(0)
        pairs: list[np.ndarray] = []
        for found in self._likeness.groups(self._kind, keys):
            ids = np.concatenate([ids for _, ids, _ in found])
            if not len(ids):
                continue
            if not self._count:
                dimension = next(vectors.shape[1] for _, ids, vectors in found if len(ids))
                self._clear(total + max(_MORE, total // 4), dimension)
            if self._count + len(ids) > len(self._ids):
                break  # somebody adds a great deal meanwhile: the book's generation tells that
            start = self._count
            slots = np.repeat([self._new_slot(key) for key, *_ in found], [len(some) for _, some, _ in found])
            for key, some, _ in found:
                slot = self._slot_of[key]
                self._spans[slot] = (start, start + len(some))
                start += len(some)
            vectors = np.concatenate([vectors for _, some, vectors in found if len(some)])
            known = self._likeness.texts_under(self._kind, [key for key, *_ in found])
            texts = [known.get(entry, "") for entry in ids.tolist()]  # "": retired just now, the generation tells
            text_of, terms = self._append(ids, slots, vectors, texts)
            pairs.append(sorted_unique((terms << 32) | slots[text_of]))
        self._by_id = np.argsort(self._ids[: self._count], kind="stable").astype(np.int32)
        self._sorted_ids = self._ids[self._by_id]
        both = sorted_unique(np.concatenate(pairs)) if pairs else np.zeros(0, np.int64)
        self._term_slots = (both & 0xFFFFFFFF).astype(np.int32)
        self._term_starts = np.concatenate([[0], np.cumsum(np.bincount(both >> 32))])

    def _compare(self, keys: Sequence[int]) -> bool:
        """Take over what came and went under these keys. Returns whether there was room for it."""
        for key, ids in self._likeness.members(self._kind, keys):
            slot = self._slot_of.get(key)
            mine = np.zeros(0, np.int64) if slot is None else self.of_slots(np.array([slot]))
            gone = mine[~np.isin(self._ids[mine], ids)]
            self._there[gone] = False
            self._valid -= len(gone)
            new = ids[~np.isin(ids, self._ids[mine])]
            if not len(new):
                continue
            if self._count + len(new) > len(self._ids):
                return False
            slot = self._new_slot(key) if slot is None else slot
            texts, vectors = self._likeness.exact(new.tolist())
            start = self._count
            _, terms = self._append(new, np.full(len(new), slot), vectors, texts)
            self._appended.setdefault(slot, []).extend(range(start, self._count))
            self._appended_at.update(zip(new.tolist(), range(start, self._count), strict=True))
            for term in np.unique(terms).tolist():
                self._pairs.setdefault(term, set()).add(slot)
        return True

    def _new_slot(self, key: int) -> int:
        slot = self._slot_of[key] = len(self._keys)
        self._keys.append(key)
        self._spans.append((0, 0))
        return slot

    def _append(
        self, ids: np.ndarray, slots: np.ndarray, vectors: np.ndarray, texts: Sequence[str]
    ) -> tuple[np.ndarray, np.ndarray]:
        """Returns which of them has which term."""
        start, stop = self._count, self._count + len(ids)
        if self._vectors.dtype == np.int8:
            scales = np.maximum(np.abs(vectors).max(axis=1), 1e-12) / np.float32(127)
            self._vectors[start:stop] = np.rint(vectors / scales[:, None])
            self._scales[start:stop] = scales
        else:
            self._vectors[start:stop] = vectors
        self._ids[start:stop], self._slots[start:stop] = ids, slots
        text_of, terms = self.terms.add(texts)
        self._there[start:stop] = True
        self._count = stop
        self._valid += len(ids)
        return text_of, terms

    # -- reading -------------------------------------------------------------------------------------------------------
    def slots_of(self, keys: Sequence[int]) -> np.ndarray:
        """Slots of keys by their ids, -1 for one that has no entries here; int64."""
        return np.fromiter((self._slot_of.get(key, -1) for key in keys), np.int64, len(keys))

    @property
    def slots(self) -> int:
        return len(self._keys)

    def ids(self, positions: np.ndarray) -> np.ndarray:
        return self._ids[positions]

    def slot(self, positions: np.ndarray) -> np.ndarray:
        return self._slots[positions]

    def positions(self, ids: np.ndarray) -> np.ndarray:
        """Of those of the ids that are valid entries of this kind, ascending, each once, int64."""
        place = np.searchsorted(self._sorted_ids, ids)
        place[place == len(self._sorted_ids)] = 0
        found = self._by_id[place[self._sorted_ids[place] == ids]] if len(self._sorted_ids) else self._by_id
        if self._appended_at:
            later = [self._appended_at[one] for one in ids.tolist() if one in self._appended_at]
            found = np.concatenate([found, np.array(later, np.int32)])
        found = sorted_unique(found.astype(np.int64))
        return found[self._there[found]]

    def of_slots(self, slots: np.ndarray) -> np.ndarray:
        """Positions of the valid entries under these keys, int64."""
        found = ranges(self._starts[slots], self._lengths[slots])
        if self._appended:
            later = [np.array(self._appended[slot], np.int64) for slot in slots.tolist() if slot in self._appended]
            found = np.concatenate([found, *later])
        return found[self._there[found]]

    def overlap(self, positions: np.ndarray, wanted: Wanted) -> np.ndarray:
        """``Terms.overlap`` of entries, float64."""
        return self.terms.overlap(positions, wanted)

    def most_overlap(self, wanted: Wanted) -> np.ndarray:
        """By slot, what the overlap of an entry there is at most, float64."""
        found = np.zeros(self.slots)
        for term, weight in self.terms.numbers_of(wanted).items():
            first, end = self._term_starts[[min(number, len(self._term_starts) - 1) for number in (term, term + 1)]]
            slots = self._term_slots[first:end]
            if term in self._pairs:
                slots = np.union1d(slots, np.fromiter(self._pairs[term], np.int64))
            found[slots] += weight
        return np.minimum(found / wanted[1], 1.0)

    def similar(self, positions: np.ndarray, meant: np.ndarray) -> np.ndarray:
        """Cosines of texts with a unit vector of shape (d,), float32 (n,)."""
        found = np.empty(len(positions), np.float32)
        block = np.empty((min(_BLOCK, len(positions)), len(meant)), np.float32)
        for start in range(0, len(positions), _BLOCK):
            part = positions[start : start + _BLOCK]
            some = block[: len(part)]
            some[...] = self._vectors[part]
            np.vecdot(some, meant, out=found[start : start + _BLOCK])  # one thread, whatever else is running
        found *= self._scales[positions]
        return found

    def parts(self, size: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Ids and vectors, float32 (n, d), of all valid entries, ``size`` at a time."""
        there = np.flatnonzero(self._there[: self._count])
        for start in range(0, len(there), size):
            part = there[start : start + size]
            yield self._ids[part], self._vectors[part] * self._scales[part, None]
