"""Text as people type it in a hurry, in full words: abbreviations, lost apostrophes, letters swapped or left out."""

from __future__ import annotations

import re
from collections.abc import Collection
from functools import lru_cache

_SHORT = {
    "til": "until",
    "u": "you",
    "ur": "your",
    "pls": "please",
    "plz": "please",
    "thx": "thanks",
    "lil": "little",
    "bc": "because",
    "cuz": "because",
    "cos": "because",
    "w/o": "without",
    "gonna": "going to",
    "gotta": "have to",
    "wanna": "want to",
    "gimme": "give me",
    "lemme": "let me",
    "kinda": "a bit",
    "tho": "though",
    "abit": "a bit",
    "alot": "a lot",
}
_CONTRACTIONS = (
    "don't can't won't isn't wasn't aren't weren't doesn't didn't hasn't haven't shouldn't couldn't wouldn't mustn't "
    "needn't that's you're you've it'll you'll there's they're what's"
)
_APOSTROPHES = {word.replace("'", ""): word for word in _CONTRACTIONS.split()}
_LETTERS = "abcdefghijklmnopqrstuvwxyz"
SHORTEST, _LONGEST = 5, 30  # letters of a word that is put right


def in_full(text: str, words: Collection[str]) -> str:
    """Lower-case text with abbreviations written out, and with slips of the keys put right where the word meant is one
    of ``words`` and the word typed is not."""

    text = re.sub(r"\b(counter|anti)[ -]?clock-?wise\b", r"\1clockwise", text)

    def full(match: re.Match[str]) -> str:
        word = match.group()
        word = _SHORT.get(word) or _APOSTROPHES.get(word) or word
        if not SHORTEST <= len(word) <= _LONGEST or word in words or not word.isalpha():
            return word
        meant = [one for one in _slips(word) if one in words]
        return meant[0] if len(set(meant)) == 1 else word

    return re.sub(r"w/o|[a-z']+", full, text)


@lru_cache(maxsize=500)
def _slips(word: str) -> tuple[str, ...]:
    """What may have been meant: one letter left out or doubled, or two swapped. The first letter is taken as it is, and
    no letter is exchanged for another: "flower" and "tower" are words of their own."""
    splits = [(word[:i], word[i:]) for i in range(1, len(word))]
    swapped = [a + b[1] + b[0] + b[2:] for a, b in splits if len(b) > 1]
    inserted = [a + letter + b for a, b in splits for letter in _LETTERS]
    undoubled = [a + b[1:] for a, b in splits if b and a[-1] == b[0]]
    return tuple(dict.fromkeys([*swapped, *inserted, *undoubled]))
