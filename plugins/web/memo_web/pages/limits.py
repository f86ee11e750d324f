"""Limits on what visitors send: length and rate. The stop has none."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from memo_core.plugin import LONGEST_WORDS

_MOST, _WITHIN_S = 20, 30.0  # texts of one visitor
_VISITORS = 1000  # whose times are remembered


class Limits:
    """Counts what each visitor sends."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Begin without any visitor.

        Args:
            clock: time, s.
        """
        self._clock = clock
        self._sent: dict[str, deque[float]] = {}

    def problem(self, visitor: str, words: str = "") -> str:
        """Why a visitor's text is not taken; counts it if it is.

        Args:
            visitor: identity of the visitor.
            words: the text.

        Returns:
            One sentence for the visitor; empty if the text is taken.
        """
        if len(words) > LONGEST_WORDS:
            return f"That is too long: {len(words)} characters, and {LONGEST_WORDS} are read. Please shorten it."
        now = self._clock()
        sent = self._sent.setdefault(visitor, deque())
        while sent and now - sent[0] > _WITHIN_S:
            sent.popleft()
        if len(sent) >= _MOST:
            return "That is too fast for the robot. Please wait a moment; STOP works at any time."
        sent.append(now)
        while len(self._sent) > _VISITORS:
            self._sent.pop(next(iter(self._sent)))
        return ""


LIMITS = Limits()
