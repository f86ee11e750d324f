"""The entries with the best scores of all, without scoring all of them.

The score of an entry under key v is ``base[v] + by_text[v] · cosine + by_terms[v] · overlap``. The vector store finds
the texts nearest to the subtask's words, so the cosine of every other text is bounded; the overlap is bounded by the
terms that occur under the key, and then known. Whatever cannot reach the worst of the best scores found so far is left
out. This is the threshold algorithm of Fagin, Lotem and Naor (2003): exact with an exact store; with an approximate
one an entry can only be missed if the store missed its text.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import attrs
import numpy as np

from memo_core.skillbook.entry_index import EntryIndex
from memo_core.skillbook.retrieval_score import TIE
from memo_core.skillbook.shared_terms import Wanted
from memo_core.skillbook.term_lists import nth_largest, within

_FIRST = 15  # times as many entries as are wanted are scored to learn which others cannot be among the best,
_KEYS_FIRST = 128  # of the most promising keys, of which
_AMONG = 4  # times as many as have so many entries are compared by their words


class Scored(NamedTuple):
    """Entries by position, int64 (n,), with the rows of their keys, their cosines and their overlaps."""

    positions: np.ndarray
    rows: np.ndarray
    similar: np.ndarray
    overlap: np.ndarray

    @classmethod
    def of(cls, index: EntryIndex, positions: np.ndarray, meant: np.ndarray, wanted: Wanted) -> Scored:
        """Compare entries with a subtask's words, a unit vector of shape (d,), and its terms."""
        similar = index.similar(positions, meant).astype(np.float64)
        return cls(positions, index.rows(positions), similar, index.overlap(positions, wanted))

    @classmethod
    def none(cls) -> Scored:
        whole, real = np.zeros(0, np.int64), np.zeros(0)
        return cls(whole, whole, real, real)

    def only(self, chosen: np.ndarray | slice) -> Scored:
        return Scored(*[column[chosen] for column in self])

    @classmethod
    def appended(cls, several: Sequence[Scored]) -> Scored:
        """All of them, one after the other."""
        return several[0] if len(several) == 1 else cls(*map(np.concatenate, zip(*several, strict=True)))

    @classmethod
    def joined(cls, several: Sequence[Scored]) -> Scored:
        """All of them, each once."""
        every = cls.appended(several)
        return every.only(np.unique(every.positions, return_index=True)[1])


@attrs.frozen(eq=False)
class KeyWeights:
    """A subtask as it is compared with keys. Arrays have one value a key, by row, float64. Until a key's words are
    compared with the subtask's they count as the same, so that what the key adds is the most that it can add."""

    meant: np.ndarray  # unit vector of the subtask's words
    words: np.ndarray  # unit vectors of the keys' words, float32 (keys, d)
    base: np.ndarray  # what the key adds to the score
    by_text: np.ndarray
    by_terms: np.ndarray
    similar: np.ndarray  # cosine of the key's words and the subtask's
    compared: np.ndarray  # bool

    @classmethod
    def of(
        cls, meant: np.ndarray, words: np.ndarray, base: np.ndarray, by_text: np.ndarray, by_terms: np.ndarray
    ) -> KeyWeights:
        """``base``: without what the key's words add."""
        unknown = np.ones(len(base))
        return cls(meant, words, base + by_text, by_text, by_terms, unknown, np.zeros(len(base), bool))

    def compare(self, rows: np.ndarray) -> None:
        """Compare the words of these keys."""
        rows = rows[~self.compared[rows]]
        if not len(rows):
            return
        similar = np.vecdot(self.words[rows], self.meant).astype(np.float64)
        self.base[rows] += self.by_text[rows] * (similar - self.similar[rows])
        self.similar[rows] = similar
        self.compared[rows] = True

    def scores(self, rows: np.ndarray | slice, similar: np.ndarray | float, overlap: np.ndarray) -> np.ndarray:
        """Of entries with these keys, cosines and overlaps, float64 (n,)."""
        return self.base[rows] + self.by_text[rows] * similar + self.by_terms[rows] * overlap


@attrs.frozen(eq=False)
class Weighed:
    """A subtask as it is compared with the entries of one index."""

    index: EntryIndex
    keys: KeyWeights
    wanted: Wanted
    near: Scored  # the entries that the store found, by ascending position
    nearest: float  # the largest cosine that any other may have
    every: tuple[np.ndarray, np.ndarray] | None = None  # positions and cosines of all entries, where all were compared

    def scored(self, positions: np.ndarray) -> Scored:
        found = Scored.of(self.index, positions, self.keys.meant, self.wanted)
        self.keys.compare(found.rows)
        return found


def best_entries(asked: Weighed, among: np.ndarray, count: int, floor: float = -np.inf) -> Scored:
    """The ``count`` best entries and all that may tie with the last of them, in no order.

    ``among``: of each key whether its entries may be, bool.
    ``floor``: entries that share no term with the subtask are left out if the mean cosine of text and key is smaller.
    """
    if count < 1 or not among.any():
        return asked.near.only(slice(0))
    if asked.every is not None:
        return _best_of_compared(asked, *asked.every, among, count, floor)
    near = asked.near.only(among[asked.near.rows])
    most = asked.index.most_overlap(asked.wanted)
    limits = np.where(among, asked.keys.scores(slice(None), asked.nearest, most), -np.inf)
    few = _FIRST * count
    first = _likeliest(asked, limits, most, few)
    begun = _Likely.under(asked, first, floor).by_limit()
    asked.keys.compare(near.rows)
    found, least = _best(asked, [near, begun.only(slice(few)).scored(asked)], count, floor)
    limits[first] = -np.inf
    others = np.flatnonzero((limits >= least) & (limits > -np.inf))
    asked.keys.compare(others)
    others = others[asked.keys.scores(others, asked.nearest, most[others]) >= least]
    left = begun.only(slice(few, None)).reaching(least)
    if len(others):
        left = left.joined(_Likely.under(asked, others, floor).reaching(least)).by_limit()
    for start, stop in ((0, few), (few, None)):
        some = left.reaching(least).only(slice(start, stop))
        if len(some.positions):
            found, least = _best(asked, [found, some.scored(asked)], count, floor)
    return found


def _best_of_compared(
    asked: Weighed, positions: np.ndarray, similar: np.ndarray, among: np.ndarray, count: int, floor: float
) -> Scored:
    """``best_entries`` where all texts were compared: words in common and keys' words are compared where they can
    matter."""
    index = asked.index
    rows = index.rows(positions)
    there = among[rows]
    positions, rows, similar = positions[there], rows[there], similar[there].astype(np.float64)
    limits = asked.keys.scores(rows, similar, index.most_overlap(asked.wanted)[rows])

    def scored(chosen: np.ndarray) -> Scored:
        asked.keys.compare(rows[chosen])
        some = positions[chosen]
        return Scored(some, rows[chosen], similar[chosen], index.overlap(some, asked.wanted))

    few = _AMONG * count
    likely = limits >= nth_largest(limits, few) if len(limits) > few else np.ones(len(limits), bool)
    found, least = _best(asked, [scored(likely)], count, floor)
    left = ~likely & (limits >= least)
    return _best(asked, [found, scored(left)], count, floor)[0] if left.any() else found


def _likeliest(asked: Weighed, limits: np.ndarray, most: np.ndarray, few: int) -> np.ndarray:
    """The rows of the most promising keys, best first, until ``few`` entries are under them. ``limits``: by row, what
    an entry there can score as far as is known, -inf: there is none."""
    least = nth_largest(limits, _KEYS_FIRST) if len(limits) > _KEYS_FIRST else -np.inf
    rows = np.flatnonzero((limits >= least) & (limits > -np.inf))
    rows = rows[(-limits[rows]).argsort(kind="stable")]
    rows = rows[: _AMONG * _enough(asked, rows, few)]
    asked.keys.compare(rows)
    rows = rows[(-asked.keys.scores(rows, asked.nearest, most[rows])).argsort(kind="stable")]
    return rows[: _enough(asked, rows, few)]


def _enough(asked: Weighed, rows: np.ndarray, few: int) -> int:
    """How many of these keys have ``few`` entries under them."""
    return 1 + int(asked.index.sizes[rows].cumsum().searchsorted(few))


class _Likely(NamedTuple):
    """Entries that the store did not find, with the rows of their keys, their overlaps and what their scores are at
    most."""

    positions: np.ndarray
    rows: np.ndarray
    overlap: np.ndarray
    limit: np.ndarray

    @classmethod
    def under(cls, asked: Weighed, rows: np.ndarray, floor: float) -> _Likely:
        """Those under some keys that may be served."""
        positions = asked.index.under(rows)
        positions = positions[~within(positions, asked.near.positions)]
        overlap, of = asked.index.overlap(positions, asked.wanted), asked.index.rows(positions)
        found = cls(positions, of, overlap, asked.keys.scores(of, asked.nearest, overlap))
        if floor == -np.inf:
            return found
        return found.only((overlap > 0) | ((asked.nearest + asked.keys.similar[of]) / 2 >= floor))

    def only(self, chosen: np.ndarray | slice) -> _Likely:
        return _Likely(*[column[chosen] for column in self])

    def by_limit(self) -> _Likely:
        """The largest limit first."""
        return self.only((-self.limit).argsort(kind="stable"))

    def joined(self, other: _Likely) -> _Likely:
        return _Likely(*map(np.concatenate, zip(self, other, strict=True)))

    def reaching(self, least: float) -> _Likely:
        """Those whose score can be ``least`` or more."""
        return self.only(self.limit >= least)

    def scored(self, asked: Weighed) -> Scored:
        similar = asked.index.similar(self.positions, asked.keys.meant).astype(np.float64)
        return Scored(self.positions, self.rows, similar, self.overlap)


def _best(asked: Weighed, several: Sequence[Scored], count: int, floor: float) -> tuple[Scored, float]:
    """The best of them, and what another one must score to be among them."""
    found = Scored.appended(several)
    if floor > -np.inf:
        found = found.only((found.overlap > 0) | ((found.similar + asked.keys.similar[found.rows]) / 2 >= floor))
    if len(found.positions) < count:
        return found, -np.inf
    scores = asked.keys.scores(found.rows, found.similar, found.overlap)
    least = nth_largest(scores, count) - TIE
    return found.only(scores >= least), least
