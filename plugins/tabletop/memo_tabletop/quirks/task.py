"""What all tasks of this suite have: a mechanism, the sentence that teaches it, and what one would try without it."""

from __future__ import annotations

from abc import abstractmethod

from memo_core.interfaces.task import Task


class QuirkTask(Task):
    """``quirk`` names the mechanism; a training and a held-out task share it. It is never shown to a model."""

    kind = "quirk"
    quirk: str
    lesson: str

    @property
    @abstractmethod
    def plain_attempt(self) -> str:
        """As in ``Task``; here every task has one."""
