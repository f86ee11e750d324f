"""What became of one run of generated code."""

from __future__ import annotations

from typing import Literal

import attrs

from memo_core.events import SkillCalled
from memo_core.sandbox.subset import Finding

Ended = Literal["done", "error", "stopped", "limit"]


@attrs.frozen
class Execution:
    """``error`` is empty or one line for the next attempt: where, which kind, what. ``findings`` are those of the check
    before anything moved; ``line`` (from 1) is where the error arose, None where that is unknown."""

    ended: Ended
    printed: str = ""
    error: str = ""
    kind: str = ""  # "MotionError", "ZeroDivisionError", "subset", "time limit", ...
    line: int | None = None
    calls: tuple[SkillCalled, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def succeeded(self) -> bool:
        """Whether the code ran to its end."""
        return self.ended == "done"
