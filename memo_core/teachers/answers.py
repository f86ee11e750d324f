"""Classifying a typed answer: approval, silence, a correction, or unclear."""

from __future__ import annotations

import re
from typing import Literal

Meaning = Literal["approve", "silent", "correct", "unsure", "explain", "empty"]

SILENCES = {"s", "skip", "nothing", "no comment"}
YES = {"y", "yes", "yep", "yeah", "ok", "okay", "correct", "exactly"}
NO = {"n", "no", "nope"}
PRAISE = {
    "good", "great", "fine", "nice", "perfect", "excellent", "awesome", "brilliant", "wonderful", "lovely", "super",
    "fantastic", "amazing", "cool", "thanks", "thank", "bravo", "works", "worked", "done", "finally", "success", "wow",
} | YES  # fmt: skip
# Words that take nothing back of the praise they stand beside, and send nobody anywhere.
FILLING = {
    "a", "absolutely", "all", "and", "did", "do", "does", "for", "going", "had", "has", "have", "i", "indeed", "is",
    "it", "its", "it's", "job", "just", "like", "looks", "lot", "love", "me", "much", "my", "now", "of", "one",
    "pretty", "quite", "really", "robot", "s", "so", "that", "thats", "that's", "the", "this", "time", "very", "was",
    "well", "went", "were", "what", "work", "you", "your", "you've",
}  # fmt: skip


def meaning_of(words: str) -> Meaning:
    """The meaning of a typed answer. ``unsure``: it begins with praise and says more than that ("good, but lower")."""
    plain = " ".join(words.lower().replace("’", "'").split())
    if not plain:
        return "empty"
    if plain in ("?", "help", "??"):
        return "explain"
    if plain in SILENCES:
        return "silent"
    # "right" is a side unless somebody says that something is right.
    plain = re.sub(r"\b(that's|thats|that is|is|it's|all|was|you're) right\b", r"\1 correct", plain)
    tokens = re.findall(r"[^\W\d_]+(?:'[^\W\d_]+)?|\d+", plain)
    if tokens == ["right"]:
        return "unsure"
    if not any(token in PRAISE for token in tokens):
        return "correct"
    if all(token in PRAISE | FILLING for token in tokens) and "?" not in plain:
        return "approve"
    begins = tokens[0] in PRAISE | {"that", "thats", "that's", "it", "it's"} or tokens[:2] == ["well", "done"]
    return "unsure" if begins and any(token in PRAISE for token in tokens[:4]) else "correct"
