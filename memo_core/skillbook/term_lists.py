"""The terms of many texts as numbers, so that the overlap of a subtask with thousands of texts is a table lookup.

Texts are appended and never changed. A text has the terms that ``Terms.of_text`` gives it, and ``RELEASE`` if it says
how a thing is held and let go of; ``TermLists.overlap`` is ``Terms.overlap``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from memo_core.skillbook.shared_terms import GRIP, RELEASE, WORD, Terms, Wanted

_NO_TERM = 0  # number of a term that no subtask has: a text without terms has it
_BETWEEN = "\0"  # between texts that are read together
_WORDS = re.compile(f"{WORD.pattern}|{_BETWEEN}")
_KEPT = frozenset(b"abcdefghijklmnopqrstuvwxyz'\0")
_LETTERS = bytes(one if one in _KEPT else ord(" ") for one in range(256))
_ROOM = 1024  # numbers that a growing array has room for at first


class Growing:
    """An array that grows at its end."""

    def __init__(self, dtype: type[np.generic]) -> None:
        self._held = np.zeros(_ROOM, dtype)
        self._count = 0

    @property
    def values(self) -> np.ndarray:
        return self._held[: self._count]

    def add(self, values: np.ndarray) -> None:
        count = self._count + len(values)
        if count > len(self._held):
            held = np.empty(count + count // 4, self._held.dtype)
            held[: self._count] = self.values
            self._held = held
        self._held[self._count : count] = values
        self._count = count


class Numbered(dict[str, int]):
    """Numbers of words or names, 0, 1, 2 …, given when one is first met."""

    def __missing__(self, name: str) -> int:
        self[name] = number = len(self)
        return number


class TermLists:
    """Of texts 0, 1, 2 … in the order in which they were added."""

    def __init__(self, terms: Terms) -> None:
        self._terms = terms
        self._words = Numbered({_BETWEEN: 0})
        self._numbers = {"": _NO_TERM, GRIP: 1, RELEASE: 2}  # of terms
        self._of_words = np.zeros(0, np.int32)  # terms of word 0, of word 1, …
        self._first = np.zeros(1, np.int64)  # where those of each word begin, and the end
        self._flat = Growing(np.int32)  # terms of text 0, of text 1, …, each once a text; of a text without, no term
        self._starts = Growing(np.int64)  # where those of each text begin, and the end
        self._starts.add(np.zeros(1, np.int64))
        self._weighed: tuple[Wanted | None, np.ndarray] = (None, np.zeros(0))  # what was asked last, weights by number

    def __len__(self) -> int:
        return len(self._starts.values) - 1

    @property
    def nbytes(self) -> int:
        return sum(one.values.nbytes for one in (self._flat, self._starts))

    def add(self, texts: Sequence[str]) -> np.ndarray:
        """Append texts. Returns which of them, counted from 0, has which term: int64 (2, n)."""
        if not texts:
            return np.zeros((2, 0), np.int64)
        joined = f" {_BETWEEN} ".join(texts)
        if joined.count(_BETWEEN) >= len(texts):
            joined = f" {_BETWEEN} ".join(text.replace(_BETWEEN, " ") for text in texts)
        found = _words_of(joined.lower())
        words = np.fromiter(map(self._words.__getitem__, found), np.int64, len(found))
        self._learn()
        text_of = np.cumsum(words == 0)
        counts = self._first[words + 1] - self._first[words]
        some = counts > 0
        words, text_of, counts = words[some], text_of[some], counts[some]
        numbers, text_of = self._of_words[ranges(self._first[words], counts)], np.repeat(text_of, counts)
        nothing = np.flatnonzero(np.bincount(text_of, minlength=len(texts)) == 0) << 32 | _NO_TERM
        gripping = sorted_unique(text_of[numbers == self._numbers[GRIP]])
        releasing = [place for place in gripping.tolist() if self._terms.releases(texts[place])]
        more = np.array(releasing, np.int64) << 32 | self._numbers[RELEASE]
        pairs = sorted_unique(np.concatenate([(text_of << 32) | numbers, nothing, more]))
        text_of, numbers = pairs >> 32, pairs & 0xFFFFFFFF
        lengths = np.bincount(text_of, minlength=len(texts))
        self._starts.add(len(self._flat.values) + np.cumsum(lengths))
        self._flat.add(numbers)
        self._weighed = (None, self._weighed[1])
        return np.stack([text_of, numbers])

    def numbers_of(self, wanted: Wanted) -> dict[int, float]:
        """Terms of a subtask that occur here, by number, with their weights."""
        return {self._numbers[term]: weight for term, weight in wanted[0].items() if term in self._numbers}

    def overlap(self, positions: np.ndarray, wanted: Wanted) -> np.ndarray:
        """The share of a subtask's terms that each of some texts has, 0 to 1, float64 (n,)."""
        if not len(positions):
            return np.zeros(0)
        numbers, firsts = self._of(positions)
        return np.minimum(np.add.reduceat(self._weights(wanted)[numbers], firsts) / wanted[1], 1.0)

    def have(self, positions: np.ndarray, term: str) -> np.ndarray:
        """Which of some texts have a term, bool (n,)."""
        if not len(positions):
            return np.zeros(0, bool)
        numbers, firsts = self._of(positions)
        return np.logical_or.reduceat(numbers == self._numbers.get(term, -1), firsts)

    def _of(self, positions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers of the terms of texts, one text after the other, and where those of each begin."""
        starts = self._starts.values[positions]
        lengths = self._starts.values[positions + 1] - starts
        return self._flat.values[ranges(starts, lengths)], lengths.cumsum() - lengths

    def _weights(self, wanted: Wanted) -> np.ndarray:
        """By number of a term, float64; a question asks several times."""
        if self._weighed[0] is not wanted:
            table = np.zeros(len(self._numbers))
            for number, weight in self.numbers_of(wanted).items():
                table[number] = weight
            self._weighed = (wanted, table)
        return self._weighed[1]

    def _learn(self) -> None:
        """The terms of words that were met for the first time."""
        known = len(self._first) - 1
        new = list(self._words)[known:] if len(self._words) > known else []
        if not new:
            return
        each = [
            [self._numbers.setdefault(term, len(self._numbers)) for term in sorted(self._terms.of_text(word))]
            for word in new
        ]
        self._of_words = np.concatenate([self._of_words, np.array([n for some in each for n in some], np.int32)])
        self._first = np.concatenate([self._first, self._first[-1] + np.cumsum([len(some) for some in each])])


def _words_of(text: str) -> list[str]:
    """What a text in lower case consists of. In ASCII, where a table finds them much faster, with all apostrophes: the
    terms of ``"it's"`` are those of its words."""
    if not text.isascii():
        return _WORDS.findall(text)
    return text.encode("ascii").translate(_LETTERS).decode("ascii").split()


def sorted_unique(values: np.ndarray) -> np.ndarray:
    """``numpy.unique`` by sorting: of a million integers several times as fast as by hashing, which numpy does."""
    ordered = np.sort(values)
    new = np.ones(len(ordered), bool)
    np.not_equal(ordered[1:], ordered[:-1], out=new[1:])
    return ordered[new]


def within(values: np.ndarray, ascending: np.ndarray) -> np.ndarray:
    """Which of some numbers occur in an ascending array, bool."""
    if not len(ascending):
        return np.zeros(len(values), bool)
    return np.asarray(ascending.take(ascending.searchsorted(values), mode="clip") == values)


def nth_largest(values: np.ndarray, count: int) -> float:
    """The ``count``-th largest of at least so many numbers. The ``count``-th of the largest ones of more groups than
    that is a lower bound, which leaves few numbers to be looked at: with 5 000 that takes a third of the time."""
    groups = 4 * count
    if len(values) >= 4 * groups:
        tops = values[: len(values) // groups * groups].reshape(-1, groups).max(axis=0)
        values = values[values >= np.partition(tops, groups - count)[groups - count]]
    return float(np.partition(values, len(values) - count)[len(values) - count])


def ranges(starts: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """starts[0], starts[0] + 1, … for lengths[0] numbers, then from starts[1], int64."""
    ends = lengths.cumsum()
    return (starts - ends + lengths).repeat(lengths) + np.arange(ends[-1] if len(ends) else 0)
