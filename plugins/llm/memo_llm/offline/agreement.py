"""Whether what the rules read in a remark and what it comes down to (``gist.py``) go together."""

from __future__ import annotations

from collections.abc import Iterable

from memo_llm.offline.edits import GENTLE, Edit
from memo_llm.offline.vocabulary import Vocabulary

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
    "over-place": ("centre", ""),
}


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
    ends = {(kind, vocabulary.opposites[way]) for kind, way in wanted(some) if way in vocabulary.opposites}
    pairs = [
        (("force", "gently"), ("force", "firmly")),
        (("farther", ""), ("less-far", "")),
        (("arc", ""), ("straight", "")),
    ]
    ends |= {end for one in wanted(some) for a, b in pairs for here, end in ((a, b), (b, a)) if one == here}
    return any(one in ends for one in wanted(others))
