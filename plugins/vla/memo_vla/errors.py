"""Errors of demonstrations."""

from __future__ import annotations

import attrs

from memo_core.plugin import MemoError


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
