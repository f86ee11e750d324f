"""The terms of many texts as numbers, so that the overlap of a subtask with thousands of texts is a table lookup.

Texts are appended and never changed. A text has the terms that ``Terms.of_text`` gives it; ``TermLists.overlap`` is
``Terms.overlap``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from memo_core.skillbook.shared_terms import WORD, Terms, Wanted

_BETWEEN = "\0"  # between texts that are read together
_WORDS = re.compile(f"{WORD.pattern}|{_BETWEEN}")
_ROOM = 1024  # numbers that a growing array has room for at first


class _Numbers:
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


class _Words(dict[str, int]):
    """Numbers of words, given when a word is first met."""

    def __missing__(self, word: str) -> int:
        self[word] = number = len(self)
        return number


class TermLists:
    """Of texts 0, 1, 2 … in the order in which they were added."""

    def __init__(self, terms: Terms) -> None:
        self._terms = terms
        self._words = _Words({_BETWEEN: 0})
        self._numbers: dict[str, int] = {}  # of terms
        self._of_words = np.zeros(0, np.int32)  # terms of word 0, of word 1, …
        self._first = np.zeros(1, np.int64)  # where those of each word begin, and the end
        self._flat = _Numbers(np.int32)  # terms of text 0, of text 1, …, each once a text
        self._lengths = _Numbers(np.int32)
        self._ends = _Numbers(np.int64)

    def __len__(self) -> int:
        return len(self._lengths.values)

    @property
    def nbytes(self) -> int:
        return sum(one.values.nbytes for one in (self._flat, self._lengths, self._ends))

    def add(self, texts: Sequence[str]) -> np.ndarray:
        """Append texts. Returns which of them, counted from 0, has which term: int64 (2, n)."""
        if not texts:
            return np.zeros((2, 0), np.int64)
        joined = _BETWEEN.join(texts)
        if joined.count(_BETWEEN) >= len(texts):
            joined = _BETWEEN.join(text.replace(_BETWEEN, " ") for text in texts)
        found = _WORDS.findall(joined.lower())
        words = np.fromiter(map(self._words.__getitem__, found), np.int64, len(found))
        self._learn()
        text_of = np.cumsum(words == 0)
        counts = self._first[words + 1] - self._first[words]
        some = counts > 0
        words, text_of, counts = words[some], text_of[some], counts[some]
        numbers = self._of_words[ranges(self._first[words], counts)]
        pairs = np.unique((np.repeat(text_of, counts) << 32) | numbers)
        text_of, numbers = pairs >> 32, pairs & 0xFFFFFFFF
        lengths = np.bincount(text_of, minlength=len(texts))
        self._ends.add(len(self._flat.values) + np.cumsum(lengths))
        self._flat.add(numbers)
        self._lengths.add(lengths)
        return np.stack([text_of, numbers])

    def numbers_of(self, wanted: Wanted) -> dict[int, float]:
        """Terms of a subtask that occur here, by number, with their weights."""
        return {self._numbers[term]: weight for term, weight in wanted[0].items() if term in self._numbers}

    def overlap(self, positions: np.ndarray, wanted: Wanted) -> np.ndarray:
        """The share of a subtask's terms that each of some texts has, 0 to 1, float64 (n,)."""
        lengths = self._lengths.values[positions]
        numbers = self._flat.values[ranges(self._ends.values[positions] - lengths, lengths)]
        return self._sums(numbers, lengths, wanted)

    def overlap_between(self, spans: Sequence[tuple[int, int]], wanted: Wanted) -> np.ndarray:
        """The same of all texts from each start up to its stop, one span after the other."""
        flat, lengths, ends = self._flat.values, self._lengths.values, self._ends.values
        spans = [(start, stop) for start, stop in spans if stop > start]
        if not spans:
            return np.zeros(0)
        numbers = [flat[ends[start] - lengths[start] : ends[stop - 1]] for start, stop in spans]
        return self._sums(
            np.concatenate(numbers), np.concatenate([lengths[start:stop] for start, stop in spans]), wanted
        )

    def _sums(self, numbers: np.ndarray, lengths: np.ndarray, wanted: Wanted) -> np.ndarray:
        weights = self.numbers_of(wanted)
        if not weights or not len(lengths):
            return np.zeros(len(lengths))
        table = np.zeros(len(self._numbers) + 1, np.float32)
        table[list(weights)] = list(weights.values())
        sums, some = np.zeros(len(lengths)), lengths > 0
        if len(numbers):
            sums[some] = np.add.reduceat(table[numbers], (np.cumsum(lengths) - lengths)[some])
        return np.minimum(sums / wanted[1], 1.0)

    def _learn(self) -> None:
        """The terms of words that were met for the first time."""
        known = len(self._first) - 1
        new = list(self._words)[known:] if len(self._words) > known else []
        if not new:
            return
        each = [
            [self._numbers.setdefault(term, len(self._numbers)) for term in sorted(self._terms.of_word(word))]
            for word in new
        ]
        self._of_words = np.concatenate([self._of_words, np.array([n for some in each for n in some], np.int32)])
        self._first = np.concatenate([self._first, self._first[-1] + np.cumsum([len(some) for some in each])])


def ranges(starts: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """starts[0], starts[0] + 1, … for lengths[0] numbers, then from starts[1], int64."""
    before = np.cumsum(lengths) - lengths
    return np.repeat(starts - before, lengths) + np.arange(int(lengths.sum()))
