"""Whether what the rules read in a remark and what it comes down to (``gist.py``) go together."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache

from memo_llm.offline.edits import GENTLE, Edit
from memo_llm.offline.gist import plain_requests
from memo_llm.offline.learnt import Learnt
from memo_llm.offline.reading import read_sentence
from memo_llm.offline.vocabulary import Vocabulary

UNLIKELY = 0.15  # the probability of a request below which one asks whether it was meant
Wanted = tuple[str, str]
_WAYS = frozenset(["speed", "force", "offset", "way", "turn-thing", "hold-at"])
# Edits that come to the same as others.
_ALIKE: dict[str, Wanted] = {
    "all-the-way": ("farther", ""),
    "extent": ("less-far", ""),
    "slow-end": ("force", "gently"),
    "pivot": ("arc", ""),
    "follow-hand": ("arc", ""),
    "set-down": ("release", ""),
    "hold-for": ("release", ""),
}
# What remarks ask for in the words of other requests, or by a fault to the other side.
_SAID_OTHERWISE = frozenset([("arc", ""), ("release", ""), ("beside", ""), ("offset", "left"), ("offset", "right")])


def wanted(edits: Iterable[Edit]) -> set[Wanted]:
    """Which edits, and which way where they are about one: "all the way" is "further" here, "slower" is "gently"."""
    found = set()
    for edit in edits:
        careful = (edit.kind == "speed" and edit.value.startswith("slow")) or edit.value in GENTLE
        way = edit.value if edit.kind in _WAYS else ""
        found.add(("force", "gently") if careful else _ALIKE.get(edit.kind, (edit.kind, way)))
    return found


def opposed(some: Iterable[Edit], others: Iterable[Edit], vocabulary: Vocabulary) -> bool:
    """Whether an edit of the one asks for the opposite of one of the other."""
    others = list(others)
    return any(
        one.kind == other.kind and vocabulary.opposites.get(one.value) == other.value != ""
        for one in some
        for other in others
    )


def unlikely(edits: Sequence[Edit], words: str, objects: Sequence[str], kind: str, vocabulary: Vocabulary) -> bool:
    """Whether the classifier thinks that something was read that the words hardly ask for."""
    likely = Learnt.load().likelihoods(words, objects, kind)
    names = _names(kind, vocabulary)
    return any(
        one in names.keys() - _SAID_OTHERWISE and max(likely.get(name, 0.0) for name in names[one]) < UNLIKELY
        for one in wanted(edit for edit in edits if not edit.negated)
    )


@cache
def _names(kind: str, vocabulary: Vocabulary) -> Mapping[Wanted, frozenset[str]]:
    """The names of the requests that an edit may come from."""
    found: dict[Wanted, frozenset[str]] = {}
    for name, text in plain_requests(kind).items():
        for one in wanted(read_sentence(text, vocabulary, (), kind).edits):
            found[one] = found.get(one, frozenset()) | {name}
    return found
