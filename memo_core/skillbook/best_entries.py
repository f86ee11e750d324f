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

_FEW = 2_000  # entries that are simply all scored
_FIRST = 300  # entries that are looked at first, under the most promising keys
_SCORED_FIRST = 256  # entries that are scored to learn which others cannot be among the best


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
        columns = [np.concatenate([getattr(one, f.name) for one in several]) for f in attrs.fields(cls)]
        _, first = np.unique(columns[0], return_index=True)
        return cls(*(column[first] for column in columns))


def scored(asked: Weighed, positions: np.ndarray, overlap: np.ndarray | None = None) -> Scored:
    """Entries with what their scores are made of."""
    index = asked.index
    known = index.overlap(positions, asked.wanted) if overlap is None else overlap
    return Scored(positions, index.similar(positions, asked.meant).astype(np.float64), known)


def scores_of(asked: Weighed, found: Scored) -> np.ndarray:
    slots = asked.index.slot(found.positions)
    return asked.base[slots] + asked.by_text[slots] * found.similar + asked.by_terms[slots] * found.overlap


def best_entries(asked: Weighed, count: int, near: np.ndarray, nearest: float, floor: float = -np.inf) -> Scored:
    """The ``count`` best entries and all that may tie with the last of them, in no order.

    ``near``: positions of the entries that the store found; ``nearest``: the largest cosine that any other may have.
    ``floor``: entries that share no term with the subtask are left out if the mean cosine of text and key is smaller.
    """
    slots = np.flatnonzero(np.isfinite(asked.base))
    index = asked.index
    if not len(slots) or count < 1:
        return scored(asked, np.zeros(0, np.int64))
    if len(index) <= _FEW:
        return _best(asked, scored(asked, *index.of_slots_with_overlap(slots, asked.wanted)), count, floor)[0]

    most = index.most_overlap(asked.wanted)
    limits = (asked.base + asked.by_text * nearest + asked.by_terms * most)[slots]
    promising = slots[np.argsort(-limits, kind="stable")[:_FIRST]]
    enough = int(np.searchsorted(np.cumsum(index.sizes[promising]), _FIRST)) + 1
    near = near[np.isfinite(asked.base[index.slot(near)])]
    likely = _likely(asked, promising[:enough], -np.inf, nearest, floor)
    found = Scored.joined([scored(asked, near), scored(asked, *(column[:_SCORED_FIRST] for column in likely[:2]))])
    found, least = _best(asked, found, count, floor)

    positions, overlap, limit = _likely(asked, slots[limits >= least], least, nearest, floor)
    for start, stop in ((0, _SCORED_FIRST), (_SCORED_FIRST, len(positions))):
        some = slice(start, int(np.searchsorted(-limit[start:stop], -least, side="right")) + start)
        more = scored(asked, positions[some], overlap[some])
        found, least = _best(asked, Scored.joined([found, more]), count, floor)
    return found


def _likely(
    asked: Weighed, slots: np.ndarray, least: float, nearest: float, floor: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions under these keys whose score can be ``least`` or more, their overlaps, and what their scores are at
    most, the largest first."""
    positions, overlap = asked.index.of_slots_with_overlap(slots, asked.wanted)
    of = asked.index.slot(positions)
    limit = (asked.base + asked.by_text * nearest)[of] + asked.by_terms[of] * overlap
    chosen = limit >= least
    if np.isfinite(floor):
        chosen &= (overlap > 0) | ((nearest + asked.key_similar[of]) / 2 >= floor)
    chosen = np.flatnonzero(chosen)
    chosen = chosen[np.argsort(-limit[chosen], kind="stable")]
    return positions[chosen], overlap[chosen], limit[chosen]


def _best(asked: Weighed, found: Scored, count: int, floor: float) -> tuple[Scored, float]:
    """The best of them, and what another one must score to be among them."""
    if np.isfinite(floor) and len(found.positions):
        key_similar = asked.key_similar[asked.index.slot(found.positions)]
        found = found.only((found.overlap > 0) | ((found.similar + key_similar) / 2 >= floor))
    if len(found.positions) < count:
        return found, -np.inf
    scores = scores_of(asked, found)
    least = float(np.partition(scores, len(scores) - count)[len(scores) - count]) - TIE
    return found.only(scores >= least), least
