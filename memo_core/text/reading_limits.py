"""Limits on how much text of people and of language models is read.

A regular expression holds Python's interpreter lock until it returns, and no signal is handled meanwhile. Bounded input
keeps that short whatever the text holds. A person's words are stored in full; what exceeds the limit is set aside.
"""

from __future__ import annotations

LONGEST_WORDS = 4_000  # characters of what a person says at a time
LONGEST_ANSWER = 200_000  # characters of one answer of a language model
LONGEST_CODE = 40_000  # characters of one program
_SHOWN = 200  # characters of words that are too long


def too_long(words: str) -> str:
    """Why a person's words are not read; empty if they are."""
    if len(words) <= LONGEST_WORDS:
        return ""
    return f"it has {len(words)} characters, and at most {LONGEST_WORDS} are read"


def excerpt(words: str) -> str:
    """A person's words as prompts, events, lists and pages repeat them: only their beginning if they are too long."""
    if not too_long(words):
        return words
    return f"{words[:_SHOWN].rstrip()} … ({len(words)} characters, stored in full)"
