"""The result of one run of generated code."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import attrs

from memo_core.events import SkillCalled
from memo_core.sandbox.subset import Finding

Ended = Literal["done", "error", "stopped", "limit"]


@attrs.frozen
class Execution:
    """``error`` is empty or one line for the next attempt: line, type and message. ``findings`` are those of the check
    before anything moved; ``line`` (from 1) is where the error occurred, None if unknown."""

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


def refused(findings: Sequence[Finding]) -> Execution:
    """The result for code that was not run because of findings (at least one)."""
    shown = "; ".join(str(finding) for finding in findings[:5])
    more = f"; and {len(findings) - 5} more" if len(findings) > 5 else ""
    error = f"not run: {shown}{more}"[:2000]
    return Execution("error", error=error, kind="subset", line=findings[0].line, findings=tuple(findings))
