"""The error of a policy server that does not keep to its protocol."""

from __future__ import annotations

import attrs

from memo_core.plugin import MemoError


@attrs.define(auto_exc=True, eq=False)
class PolicyServerError(MemoError):
    """A policy server that was reached and then failed. The arm is at rest, and the run says nothing about the policy.
    ``problem`` is one sentence, ``remedy`` what a person can do."""

    url: str
    problem: str
    remedy: str

    def __str__(self) -> str:
        return f"policy server {self.url}: {self.problem} ({self.remedy})"
