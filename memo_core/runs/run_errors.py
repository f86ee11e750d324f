"""Errors by which a run could not be carried out: they say nothing about the method that was tried.

Such a run is in no rate, and the same command does it again. Everything else that ends a run is its result: an answer
of the model that cannot be read, code that fails, a limit on attempts or time.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import attrs

from memo_core.errors import (
    BackendLost,
    BackendUnavailable,
    MemoError,
    MethodCodeError,
    RobotFault,
    Stopped,
    TaskCodeError,
)
from memo_core.interfaces.llm import LanguageModelError
from memo_core.llm.budget import BudgetExceeded
from memo_core.llm.readers import Unreadable

_CAUSES: dict[type, str] = {TaskCodeError: "task", MethodCodeError: "method"}
MOST_IN_A_ROW = 3  # errors of one cause, with nothing carried out between them, after which a command stops
UNEXPECTED = "unexpected"  # cause of an error that no code raised deliberately


@attrs.frozen
class RunError:
    """Why a run could not be carried out.

    ``cause`` is that of a language model (``LanguageModelError.cause``, or ``llm``), the kind of a backend that cannot
    be used or was lost (``simulator``, ``embedder``, …), ``robot``, ``task``, ``method`` or ``error``.
    ``persistent``: every other run would fail as well, until a person mends the cause.
    """

    cause: str
    problem: str
    persistent: bool = False


@attrs.define(auto_exc=True, eq=False)
class NotCarriedOut(MemoError):
    """A run, one of several, that could not be carried out."""

    folder: str
    error: RunError

    def __str__(self) -> str:
        return f"{self.error.problem} ({self.folder})"


@attrs.define(auto_exc=True, eq=False)
class Halted(MemoError):
    """A command over several runs that does no more of them. ``what``: the runs, in the plural."""

    what: str
    error: RunError

    def __str__(self) -> str:
        return f"{self.error.problem}; no more {self.what} were begun: mend the cause, and the same command goes on"


def run_error(error: MemoError) -> RunError | None:
    """The error that a run which could not be carried out has; None for a limit or a person that ended it."""
    if isinstance(error, (Stopped, BudgetExceeded)):
        return None
    if isinstance(error, Unreadable):  # the model failed if it gave an answer, not if one was withheld or cut off
        return RunError(error.cause, error.told) if error.cause else None
    if isinstance(error, LanguageModelError):
        return RunError(error.cause or "llm", str(error), error.persistent)
    if isinstance(error, BackendUnavailable):
        return RunError(error.kind, str(error), persistent=True)
    if isinstance(error, BackendLost):
        return RunError(error.kind, str(error))
    if isinstance(error, RobotFault):
        return RunError("robot", str(error), persistent=True)
    return RunError(_CAUSES.get(type(error), "error"), str(error))


def told(errors: Iterable[RunError]) -> str:
    """Errors by cause with how often each occurred and the first problem, such as ``2 x timeout (no answer …)``."""
    by_cause: dict[str, list[RunError]] = {}
    for error in errors:
        by_cause.setdefault(error.cause, []).append(error)
    return "; ".join(f"{len(some)} x {cause} ({some[0].problem})" for cause, some in by_cause.items())


def reason_to_stop(errors: Iterable[RunError | None]) -> RunError | None:
    """The error after which a command does no more runs: one that persists, or the last of ``MOST_IN_A_ROW`` of one
    cause. ``errors``: of the runs so far, in order; None for one that was carried out."""
    row: list[RunError] = []
    for error, several in itertools.groupby(errors, key=lambda one: one and one.cause):
        row = [one for one in several if one is not None] if error else []
        if stops := [one for one in row if one.persistent] or row[MOST_IN_A_ROW - 1 :]:
            return stops[0]
    return None
