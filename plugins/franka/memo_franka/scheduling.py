"""The scheduling policy of threads. ``franky.Robot`` gives the thread that connects real-time priority, and whatever is
started from that thread inherits it. The thread that controls the arm needs it; MEMO's others, and the processes that
run generated code, must not have it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

import attrs


@attrs.frozen
class Scheduling:
    """Linux's policy and priority of one thread (``sched(7)``)."""

    policy: int
    priority: int

    @classmethod
    def current(cls) -> Scheduling:
        """That of the calling thread."""
        return cls(os.sched_getscheduler(0), os.sched_getparam(0).sched_priority)

    def take(self) -> None:
        """Give it to the calling thread. Raises ``PermissionError`` where a limit forbids it."""
        os.sched_setscheduler(0, self.policy, os.sched_param(self.priority))

    def raised(self) -> Scheduling:
        """One priority above it, where it is real-time: for what must not wait for threads that have it."""
        return attrs.evolve(self, priority=self.priority + 1) if self.priority else self

    @contextmanager
    def inherited(self) -> Iterator[None]:
        """Threads that are started in the block have it; afterwards the calling thread has its own again."""
        own = self.current()
        if own == self:
            yield
            return
        self.take()
        try:
            yield
        finally:
            own.take()
