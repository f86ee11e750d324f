"""Classifying a typed answer: approval, silence, a correction, or unclear."""

from __future__ import annotations

import re
from typing import Literal

from memo_core.text.reading_limits import too_long

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
# Yes and no as they are said elsewhere or in a hurry. They are asked back: a guess could become a correction.
YES_ELSEWHERE = {
    "ja", "jo", "jawohl", "genau", "gut", "klar", "richtig", "sicher", "oui", "ouais", "bien", "bon", "parfait",
    "d'accord", "si", "sí", "vale", "bueno", "perfecto", "sim", "bom", "certo", "bene", "va", "tak", "dobrze", "да",
    "хорошо", "hai", "はい", "是", "对", "好", "네", "نعم", "evet", "ye", "yea", "yess", "yup", "ya", "yah", "aye",
    "sure", "yas", "k", "kk", "okey", "👍", "👌", "✅", "✔", "🙂", "😀", "🎉",
}  # fmt: skip
NO_ELSEWHERE = {
    "nein", "nee", "nej", "nie", "nö", "non", "não", "нет", "falsch", "faux", "iie", "いいえ", "不", "아니요", "لا",
    "nah", "nay", "noo", "nooo", "👎", "❌", "✗", "🙁",
}  # fmt: skip
ASKED_BACK_WORDS = 3  # no more of them are asked back for being in other words
# Single words that are corrections by themselves, beside comparatives and adverbs ("lower", "gently").
_CORRECTING = NO | {
    "wrong", "bad", "stop", "up", "down", "left", "back", "forward", "forwards", "backward", "backwards", "straight",
    "in", "out", "on", "off", "again", "more", "less", "open", "close", "push", "pull", "lift", "turn", "twist", "grip",
    "grasp", "hold", "wait", "clockwise", "anticlockwise", "counterclockwise", "upright", "upside", "sideways",
    "failed", "missed", "dropped", "fell", "stuck", "slipped",
}  # fmt: skip
_COMPARATIVE = re.compile(r"[a-z]{2,}(?:er|ly)")
_WORD = re.compile(r"[^\W\d_]+(?:'[^\W\d_]+)?|\d+")


def bare(typed: str) -> str:
    """A typed answer in lower case, without the blanks, quotation marks and full stops or exclamation marks around it:
    what a short answer is compared with. Empty for one that is too long to be read."""
    if too_long(typed):
        return ""
    return " ".join(typed.lower().replace("’", "'").split()).strip("'\"“”„‘.!¡ ")


def meaning_of(words: str) -> Meaning:
    """Classify a typed answer.

    Args:
        words: the answer as typed.

    Returns:
        ``approve``, ``silent``, ``correct``, ``explain`` or ``empty``; ``unsure`` if the answer begins with praise and
            says more than that ("good, but lower"), or is a word or two that may be a yes or no in other words ("ja",
            "👍"). Words that are too long to be read are a correction.
    """
    if too_long(words):
        return "correct"
    plain = " ".join(words.lower().replace("’", "'").split())
    if not plain:
        return "empty"
    if bare(words) in ("?", "help", "??"):
        return "explain"
    if bare(words) in SILENCES:
        return "silent"
    # "right" is a side unless somebody says that something is right.
    plain = re.sub(r"\b(that's|thats|that is|is|it's|all|was|you're) right\b", r"\1 correct", plain)
    tokens = _WORD.findall(plain)
    if tokens == ["right"]:
        return "unsure"
    if not any(token in PRAISE for token in tokens):
        return "unsure" if in_other_words(plain) else "correct"
    if all(token in PRAISE | FILLING for token in tokens) and "?" not in plain:
        return "approve"
    begins = tokens[0] in PRAISE | {"that", "thats", "that's", "it", "it's"} or tokens[:2] == ["well", "done"]
    return "unsure" if begins and any(token in PRAISE for token in tokens[:4]) else "correct"


def teaches_nothing(words: str) -> bool:
    """Whether an answer is a bare yes, no or praise, which says nothing that could be done differently.

    Args:
        words: the answer as typed.
    """
    return meaning_of(words) == "approve" or bare(words) in YES_ELSEWHERE | NO | NO_ELSEWHERE


def in_other_words(words: str) -> bool:
    """Whether an answer without English praise is so short that it may be a yes or no all the same."""
    if too_long(words):
        return False
    plain = words.lower().replace("’", "'")
    tokens = _WORD.findall(plain)
    if len(tokens) > ASKED_BACK_WORDS:
        return False
    if not {*tokens, *plain.split()}.isdisjoint(YES_ELSEWHERE | NO_ELSEWHERE):
        return True
    if len(tokens) == 1 and tokens[0].isascii():
        return tokens[0] not in _CORRECTING and _COMPARATIVE.fullmatch(tokens[0]) is None
    return not any(token.isascii() for token in tokens)
