"""Spending on language models: the single account that budgets, ledgers, summaries and reports share."""

from __future__ import annotations

import attrs

from memo_core.interfaces.llm import Usage


@attrs.frozen
class Spent:
    """Sums over calls. ``cost`` (US dollars) covers calls with a known price; ``unpriced`` counts the others, and
    ``unfinished`` those without a recorded end (whose prompt tokens are estimates). ``cached_tokens`` are part of
    ``prompt_tokens``."""

    calls: int = 0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost: float = 0.0
    unpriced: int = 0
    unfinished: int = 0
    cached_tokens: int = 0

    @property
    def tokens(self) -> int:
        return self.prompt_tokens + self.completion_tokens

    @property
    def known_cost(self) -> float | None:
        """US dollars; None if no call has a known price."""
        return None if not self.cost and (self.unpriced or not self.calls) else self.cost

    def plus(self, usage: Usage | None) -> Spent:
        """The sums with one more call of cost ``usage``; None: the call was refused and cost nothing."""
        if usage is None:
            return attrs.evolve(self, calls=self.calls + 1)
        return attrs.evolve(
            self,
            calls=self.calls + 1,
            prompt_tokens=self.prompt_tokens + usage.prompt_tokens,
            completion_tokens=self.completion_tokens + usage.completion_tokens,
            cost=self.cost + (usage.cost or 0.0),
            unpriced=self.unpriced + (usage.cost is None and usage.prompt_tokens > 0),
            cached_tokens=self.cached_tokens + usage.cached_tokens,
        )

    def said(self) -> str:
        """In words."""
        words = f"{self.tokens} tokens and ${self.cost:.4f} in {self.calls} call{'s' * (self.calls != 1)}"
        words += f", {self.unpriced} of unknown price" if self.unpriced else ""
        return words + (f", {self.unfinished} unfinished" if self.unfinished else "")


def prompt_words(prompt_tokens: int, cached_tokens: int) -> str:
    """Prompt tokens for people, with those read from a cache, if any: ``867 (600 cached)``."""
    return f"{prompt_tokens} ({cached_tokens} cached)" if cached_tokens else str(prompt_tokens)
