"""Base class of the suite's tasks: a mechanism, the sentence that explains it, and the plain attempt made without
knowing it."""

from __future__ import annotations

from abc import abstractmethod

from memo_core.plugin import Task


class QuirkTask(Task):
    """``trick`` names the mechanism; a training and a held-out task share it. It is never shown to a model."""

    kind = "quirk"
    trick: str
    lesson: str

    @property
    @abstractmethod
    def plain_attempt(self) -> str:
        """As in ``Task``; here every task has one."""
