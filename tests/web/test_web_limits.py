"""Limits on the length and rate of texts hold for each visitor by itself."""

from __future__ import annotations

from memo_web.pages.limits import Limits

from memo_core.plugin import LONGEST_WORDS


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


def test_a_visitor_who_sends_too_fast_waits_and_others_do_not():
    clock = Clock()
    limits = Limits(clock)
    assert not any(limits.problem("one", "words") for _ in range(20))
    assert "too fast" in limits.problem("one", "words")
    assert limits.problem("another", "words") == ""
    clock.now = 31.0
    assert limits.problem("one", "words") == ""


def test_too_long_words_are_refused():
    limits = Limits(Clock())
    assert limits.problem("one", "x" * LONGEST_WORDS) == ""
    assert f"{LONGEST_WORDS + 1} characters" in limits.problem("one", "x" * (LONGEST_WORDS + 1))


def test_many_visitors_do_not_fill_the_memory():
    limits = Limits(Clock())
    for number in range(3000):
        limits.problem(str(number))
    assert len(limits._sent) <= 1000
