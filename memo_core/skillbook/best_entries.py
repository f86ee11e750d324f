"""The entries with the best scores of all, without scoring all of them.

The score of an entry under key v is ``base[v] + by_text[v] · cosine + by_terms[v] · overlap``. The vector store finds
the texts nearest to the subtask's words, so the cosine of every other text is bounded; the overlap is bounded by the
terms that occur under the key, and then known. Whatever cannot reach the worst of the best scores found so far is left
out. This is the threshold algorithm of Fagin, Lotem and Naor (2003): exact with an exact store; with an approximate
one an entry can only be missed if the store missed its text.
"""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.skillbook.entry_index import EntryIndex
from memo_core.skillbook.retrieval_score import TIE
from memo_core.skillbook.shared_terms import Wanted
from memo_core.skillbook.term_lists import within

_KEYS_FIRST = 64  # the most promising keys, of which
_FIRST = 15  # times as many entries as are wanted are scored to learn which others cannot be among the best


@attrs.frozen(eq=False)
class Weighed:
    """A subtask as it is compared with the entries of one index. Arrays have one value a slot, float64."""

    index: EntryIndex
    meant: np.ndarray  # unit vector of the subtask's words
    wanted: Wanted
    base: np.ndarray  # what the key adds to the score; -inf: its entries are left out
    by_text: np.ndarray
    by_terms: np.ndarray
    key_similar: np.ndarray  # cosine of the key's words and the subtask's
    most: np.ndarray  # what the overlap of an entry there is at most

    def only(self, slots: np.ndarray) -> Weighed:
        """With the entries of these slots alone, bool."""
        return attrs.evolve(self, base=np.where(slots, self.base, -np.inf))


@attrs.frozen(eq=False)
class Scored:
    """Entries by position, int64 (n,), with their cosines and overlaps."""

    positions: np.ndarray
    similar: np.ndarray
    overlap: np.ndarray

    def only(self, chosen: np.ndarray) -> Scored:
        return Scored(self.positions[chosen], self.similar[chosen], self.overlap[chosen])

    @classmethod
    def joined(cls, several: list[Scored]) -> Scored:
        """All of them, each once."""
        every = cls.appended(several)
        return every.only(np.unique(every.positions, return_index=True)[1])

    @classmethod
    def appended(cls, several: list[Scored]) -> Scored:
        """All of them, one after the other."""
        if len(several) == 1:
            return several[0]
        columns = zip(*((one.positions, one.similar, one.overlap) for one in several), strict=True)
        return cls(*[np.concatenate(column) for column in columns])


def scored(asked: Weighed, positions: np.ndarray, overlap: np.ndarray | None = None) -> Scored:
    """Entries with what their scores are made of."""
    index = asked.index
    known = index.overlap(positions, asked.wanted) if overlap is None else overlap
    return Scored(positions, index.similar(positions, asked.meant).astype(np.float64), known)


def best_entries(asked: Weighed, count: int, near: np.ndarray, nearest: float, floor: float = -np.inf) -> Scored:
    """The ``count`` best entries and all that may tie with the last of them, in no order.

    ``near``: positions of the entries that the store found, ascending; ``nearest``: the largest cosine that any other
    may have.
    ``floor``: entries that share no term with the subtask are left out if the mean cosine of text and key is smaller.
    """
    index = asked.index
    slots = np.flatnonzero(np.isfinite(asked.base))
    if not len(slots) or count < 1:
        return scored(asked, np.zeros(0, np.int64))
    limits = (asked.base + asked.by_text * nearest + asked.by_terms * asked.most)[slots]
    order = np.argpartition(-limits, _KEYS_FIRST)[:_KEYS_FIRST] if len(slots) > _KEYS_FIRST else np.arange(len(slots))
    order = order[np.argsort(-limits[order], kind="stable")]
    few = _FIRST * count
    order = order[: 1 + int(np.searchsorted(np.cumsum(index.sizes[slots[order]]), few))]
    near = near[np.isfinite(asked.base[index.slot(near)])]

    first = _Likely.under(asked, slots[order], nearest, floor, near)
    begun = scored(asked, np.concatenate([near, first.positions[:few]]))
    found, least = _best(asked, [begun], count, floor)
    reaching = limits >= least
    reaching[order] = False
    others = _Likely.under(asked, slots[reaching], nearest, floor, near)
    left = first.after(few).joined(others)
    for start, stop in ((0, few), (few, None)):
        some = left.reaching(least).only(slice(start, stop))
        if len(some.positions):
            found, least = _best(asked, [found, scored(asked, some.positions, some.overlap)], count, floor)
    return found


@attrs.frozen(eq=False)
class _Likely:
    """Entries with their overlaps and what their scores are at most, the largest first."""

    positions: np.ndarray
    overlap: np.ndarray
    limit: np.ndarray

    @classmethod
    def under(cls, asked: Weighed, slots: np.ndarray, nearest: float, floor: float, but: np.ndarray) -> _Likely:
        """Those under some keys that may be served, without those at the positions ``but``, ascending."""
        positions = asked.index.of_slots(slots)
        positions = positions[~within(positions, but)]
        overlap, of = asked.index.overlap(positions, asked.wanted), asked.index.slot(positions)
        if np.isfinite(floor):
            chosen = (overlap > 0) | ((nearest + asked.key_similar[of]) / 2 >= floor)
            positions, overlap, of = positions[chosen], overlap[chosen], of[chosen]
        limit = asked.base[of] + asked.by_text[of] * nearest + asked.by_terms[of] * overlap
        return cls(positions, overlap, limit).only(np.argsort(-limit, kind="stable"))

    def only(self, chosen: np.ndarray | slice) -> _Likely:
        return _Likely(self.positions[chosen], self.overlap[chosen], self.limit[chosen])

    def after(self, count: int) -> _Likely:
        return self.only(slice(count, None))

    def joined(self, other: _Likely) -> _Likely:
        pairs = ((self.positions, other.positions), (self.overlap, other.overlap), (self.limit, other.limit))
        both = _Likely(*[np.concatenate(pair) for pair in pairs])
        return both.only(np.argsort(-both.limit, kind="stable"))

    def reaching(self, least: float) -> _Likely:
        """Those whose score can be ``least`` or more."""
        return self.only(slice(0, int(np.searchsorted(-self.limit, -least, side="right"))))


def _best(asked: Weighed, several: list[Scored], count: int, floor: float) -> tuple[Scored, float]:
    """The best of them, and what another one must score to be among them."""
    found = Scored.appended(several)
    of = asked.index.slot(found.positions)
    if np.isfinite(floor) and len(of):
        chosen = (found.overlap > 0) | ((found.similar + asked.key_similar[of]) / 2 >= floor)
        found, of = found.only(chosen), of[chosen]
    if len(of) < count:
        return found, -np.inf
    scores = asked.base[of] + asked.by_text[of] * found.similar + asked.by_terms[of] * found.overlap
    least = float(np.partition(scores, len(scores) - count)[len(scores) - count]) - TIE
    return found.only(scores >= least), least
