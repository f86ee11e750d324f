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

from memo_core.skillbook.id_table import IdTable
from memo_core.skillbook.shared_terms import Terms, Wanted
from memo_core.skillbook.term_lists import TermLists, ranges, sorted_unique
from memo_core.skillbook.text_index import Likeness

EXACT = 20_000  # entries; 30 MB of vectors at 384 components
_MORE = 20_000  # entries that can be appended; or a quarter of those there are
_BLOCK = 512  # vectors compared at once: as numbers they stay in the processor's cache


class EntryIndex:
    """Entries by position, 0, 1, 2 …; keys by row, in the order in which ``follow`` was told them, -1 for one that it
    was not told. (Inside, keys are also counted by slot, in the order in which they were met.)"""

    def __init__(self, likeness: Likeness, kind: str, terms: Terms) -> None:
        self._likeness = likeness
        self._kind = kind
        self._terms = terms
        self._clear(0)

    @property
    def nbytes(self) -> int:
        """Bytes of memory in use."""
        used = self._count * (self._vectors.shape[1] * self._vectors.itemsize + 4 + 8 + 4 + 1)
        return used + self.terms.nbytes + self._term_slots.nbytes + self._term_rows.nbytes + self._by_id.nbytes

    def __len__(self) -> int:
        return self._valid

    # -- following the book --------------------------------------------------------------------------------------------
    def follow(self, keys: Sequence[int], changed: frozenset[int] | None, total: int) -> None:
        """Bring up to date. ``keys``: ids of all keys that have entries, ascending; ``changed``: those whose entries
        may have changed, None: any; ``total``: how many entries there are."""
        asked = sorted({*keys, *self._slot_of} if changed is None else changed)
        if not self._count or total > len(self._ids) or not self._compare(asked):
            self._read_all(keys, total)
        self._starts, stops = np.array(self._spans, np.int64).reshape(-1, 2).T
        self._lengths = stops - self._starts
        self._slot_at = np.fromiter((self._slot_of.get(key, -1) for key in keys), np.int64, len(keys))
        there = np.flatnonzero(self._slot_at >= 0)
        self._row_at = np.full(len(self._keys) + 1, -1, np.int64)
        self._row_at[self._slot_at[there]] = there
        self._term_rows = self._row_at[self._term_slots]
        self.sizes = np.bincount(self._slots[: self._count][self._there[: self._count]], minlength=len(self._row_at))
        self.sizes = self.sizes[self._slot_at]

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
        self._slot_at = self._row_at = np.zeros(0, np.int64)  # by row, and by slot
        self._by_id = IdTable()  # positions
        self.terms = TermLists(self._terms)
        self._term_slots = np.zeros(0, np.int32)  # of each term the slots where it occurs, of what was read at first
        self._term_rows = np.zeros(0, np.int64)  # the same as rows
        self._term_starts = np.zeros(1, np.int64)  # where those of each term begin, and the end
        self._pairs: dict[int, set[int]] = {}  # term -> slots, of what was appended
        self.sizes = np.zeros(0, np.int64)  # by row, how many valid entries are there

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
        both = sorted_unique(np.concatenate(pairs)) if pairs else np.zeros(0, np.int64)
        self._term_slots = (both & 0xFFFFFFFF).astype(np.int32)
        self._term_starts = np.concatenate([[0], np.cumsum(np.bincount(both >> 32))])

    def _compare(self, keys: Sequence[int]) -> bool:
        """Take over what came and went under these keys. Returns whether there was room for it."""
        for key, ids in self._likeness.members(self._kind, keys):
            slot = self._slot_of.get(key)
            mine = np.zeros(0, np.int64) if slot is None else self._of_slots(np.array([slot]))
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
        self._by_id.put(ids, np.arange(start, stop))
        text_of, terms = self.terms.add(texts)
        self._there[start:stop] = True
        self._count = stop
        self._valid += len(ids)
        return text_of, terms

    # -- reading -------------------------------------------------------------------------------------------------------
    def ids(self, positions: np.ndarray) -> np.ndarray:
        return self._ids[positions]

    def rows(self, positions: np.ndarray) -> np.ndarray:
        """Of entries, the rows of their keys; -1 only where somebody writes meanwhile, which the book's
        generation tells before anything is served."""
        return self._row_at[self._slots[positions]]

    def positions(self, ids: np.ndarray) -> np.ndarray:
        """Of those of the ids that are valid entries of this kind, ascending, each once, int64."""
        found = self._by_id.get(ids)
        found = sorted_unique(found[found >= 0])
        return found[self._there[found]]

    def under(self, rows: np.ndarray) -> np.ndarray:
        """Positions of the valid entries under these keys, int64."""
        slots = self._slot_at[rows]
        return self._of_slots(slots[slots >= 0])

    def _of_slots(self, slots: np.ndarray) -> np.ndarray:
        found = ranges(self._starts[slots], self._lengths[slots])
        if self._appended:
            later = [np.array(self._appended[slot], np.int64) for slot in slots.tolist() if slot in self._appended]
            found = np.concatenate([found, *later])
        return found[self._there[found]]

    def overlap(self, positions: np.ndarray, wanted: Wanted) -> np.ndarray:
        """``Terms.overlap`` of entries, float64."""
        return self.terms.overlap(positions, wanted)

    def most_overlap(self, wanted: Wanted) -> np.ndarray:
        """By row, what the overlap of an entry there is at most, float64."""
        found = np.zeros(len(self._slot_at) + 1)  # the last one is of keys without a row
        for term, weight in self.terms.numbers_of(wanted).items():
            if term + 1 < len(self._term_starts):
                rows = self._term_rows[self._term_starts[term] : self._term_starts[term + 1]]
            else:
                rows = self._term_rows[:0]  # no text had it when all were read
            if term in self._pairs:
                rows = np.union1d(rows, self._row_at[list(self._pairs[term])])
            found[rows] += weight
        return np.minimum(found[:-1] / wanted[1], 1.0)

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

    def compared(self, meant: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions of all valid entries, and the cosines of their texts as ``similar`` gives them."""
        if self._vectors.dtype == np.int8:
            positions = np.flatnonzero(self._there[: self._count])
            return positions, self.similar(positions, meant)
        cosines = np.vecdot(self._vectors[: self._count], meant)
        if self._valid == self._count:
            return np.arange(self._count), cosines
        positions = np.flatnonzero(self._there[: self._count])
        return positions, cosines[positions]

    def parts(self, size: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Ids and vectors, float32 (n, d), of all valid entries, ``size`` at a time."""
        there = np.flatnonzero(self._there[: self._count])
        for start in range(0, len(there), size):
            part = there[start : start + size]
            yield self._ids[part], self._vectors[part] * self._scales[part, None]
