"""The interface of methods, which decide what the robot does and what is stored, and the language methods."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from memo_core.interfaces.backend import Memory
from memo_core.policy.results import RunResult

if (
    TYPE_CHECKING
):  # a session knows the sandbox and the book, and a plugin that declares a method should not wait for them
    from memo_core.policy.run_context import Session


class Method(ABC):
    """A way of doing tasks: by writing code, by sending targets at a fixed rate, or otherwise. The session gives access
    to the environment, the teacher, the book and the stop switch."""

    name: str

    @abstractmethod
    def run(self, session: Session) -> RunResult:
        """Do the task, in a worker thread; returns when the task is done or given up.

        Args:
            session: access to the environment, the teacher, the book and the stop switch.

        Returns:
            The outcome of the task and of its subtasks.

        Raises:
            Stopped: only if the run is to end.
            MemoError: for an error that a person can act on.
        """


class LanguageMethod(Method):
    """Plan, retrieve, write code, execute, learn from what people say; see ``memo_core.policy.loop``."""

    def __init__(self, name: str, memory: Memory) -> None:
        self.name = name
        self.memory = memory

    def run(self, session: Session) -> RunResult:
        from memo_core.policy.loop import Loop

        return Loop(session, self.memory).run()
