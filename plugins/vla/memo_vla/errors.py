"""Errors: a policy server that does not keep to its protocol, demonstrations that do not succeed."""

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


@attrs.define(auto_exc=True, eq=False)
class TooFewDemonstrations(MemoError):
    """A task whose reference solution did not succeed in enough scenes. ``last``: what the last check said."""

    task: str
    made: int
    wanted: int
    last: str

    def __str__(self) -> str:
        made = f"{self.task}: {self.made} of {self.wanted} demonstrations succeeded"
        return f"{made}; the last one that did not: {self.last} (memo tasks verify {self.task}; other scenes: --seed)"
