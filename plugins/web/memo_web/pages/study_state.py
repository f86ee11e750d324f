"""A study as the pages see it: which visitor is who, and what each may see."""

from __future__ import annotations

import time
from typing import Any

import attrs

from memo_web.pages.run_view import RunView

OPERATOR = "operator"
_NOBODY = "nobody"  # no visitor's identity


@attrs.define(eq=False)
class StudyState:
    """State of the study, kept in the event loop; empty while none is held.

    Attributes:
        phase: ``waiting``, ``consent``, ``about``, ``task``, ``over``, or ``ended``: the command ends.
        participant: whose session is at hand; "" before the first.
        shown: everything that the run's process said of the study.
    """

    view: RunView
    shown: dict[str, Any] = attrs.field(factory=dict)

    def take(self, message: dict[str, Any], blob: bytes) -> None:
        """Take in what the run's process says.

        Args:
            message: the message, with its ``study``.
            blob: not used.
        """
        self.shown = message["study"]
        owner = self.shown["owner"] or _NOBODY
        if self.view.owner not in (None, owner):
            self.view.clear()  # no participant sees what another one did
        self.view.owner = owner

    @property
    def held(self) -> bool:
        """Whether a study is held."""
        return bool(self.shown)

    @property
    def phase(self) -> str:
        return str(self.shown.get("phase", "waiting"))

    @property
    def left_s(self) -> float | None:
        """Seconds until the session is over, below 0 if it is; None before its first task."""
        ends_at = self.shown.get("ends_at")
        return None if ends_at is None or self.phase != "task" else float(ends_at) - time.time()

    @property
    def participant(self) -> str:
        return str(self.shown.get("participant", ""))

    def role(self, visitor: str) -> str:
        """Role of a visitor.

        Args:
            visitor: identity of the visitor.

        Returns:
            ``operator``, a participant's id, or "" for anybody else.
        """
        return str(self.shown.get("roles", {}).get(visitor, ""))

    def sees_all(self, visitor: str) -> bool:
        """Whether a visitor may see what all people said: anybody while no study is held, then its operator only.

        Args:
            visitor: identity of the visitor.

        Returns:
            Whether the visitor may.
        """
        return not self.held or self.role(visitor) == OPERATOR

    def start_page(self, visitor: str) -> str:
        """First page of a visitor.

        Args:
            visitor: identity of the visitor.

        Returns:
            Path of a page.
        """
        if not self.held:
            return "/teach"
        return "/operator" if self.role(visitor) == OPERATOR else "/study"


def study_of(view: RunView) -> StudyState:
    """The study that a run belongs to, the same for all pages.

    Args:
        view: the run.

    Returns:
        Its state.
    """
    if "study" not in view.more:
        state = view.more["study"] = StudyState(view)
        view.on("study", state.take)
    known: StudyState = view.more["study"]
    return known
