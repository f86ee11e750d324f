"""What a run, and a study of many runs, may spend on language models."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping

import attrs

from memo_core.errors import MemoError
from memo_core.interfaces.llm import LanguageModel, Request, Usage
from memo_core.llm.ledger import Ledger
from memo_core.llm.spending import Spent

CHARACTERS_A_TOKEN = 4  # the usual rule of thumb, for calls whose tokens nobody counted yet


@attrs.define(auto_exc=True, eq=False)
class BudgetExceeded(MemoError):
    """A limit is reached, so no further request may be sent. ``whose``: "this run", or the study with its ledger."""

    whose: str
    setting: str
    limit: float
    spent: Spent

    def __str__(self) -> str:
        return f"{self.whose} may spend no more: {self.setting} is {self.limit:g}, spent are {self.spent.said()}"


@attrs.define(auto_exc=True, eq=False)
class UnknownPrice(MemoError):
    """A limit in dollars cannot be enforced for a model whose price is unknown."""

    setting: str
    why: str

    exit_code = 2

    def __str__(self) -> str:
        return f"{self.setting} cannot be kept: {self.why}"


@attrs.frozen
class Limit:
    """``max_cost`` in US dollars, ``max_tokens`` of questions and answers together; None is no limit."""

    max_cost: float | None = None
    max_tokens: int | None = None

    def check(self, spent: Spent, whose: str, prefix: str) -> None:
        """Raises ``BudgetExceeded`` where ``spent`` has reached a limit."""
        if self.max_tokens is not None and spent.tokens >= self.max_tokens:
            raise BudgetExceeded(whose, f"{prefix}max_tokens", self.max_tokens, spent)
        if self.max_cost is not None and spent.cost >= self.max_cost:
            raise BudgetExceeded(whose, f"{prefix}max_cost", self.max_cost, spent)


class Budget:
    """Checked before every call and updated after it; safe from several threads.

    A limit is checked before each call, so a run exceeds it by at most the call that reached it; several runs that
    share a ledger exceed it by at most one call each.
    """

    def __init__(
        self,
        limit: Limit = Limit(),
        ledger: Ledger | None = None,
        study: Limit = Limit(),
        run: str = "",
        already: Spent = Spent(),
        known: Mapping[int, Usage | None] | None = None,
    ) -> None:
        """``already``: spending of earlier parts of a resumed run; ``known``: the calls it was spent on, by their entry
        in the log. Calls whose process was killed before it could complete their line in the ledger are completed
        there."""
        self._limit = limit
        self._ledger = ledger
        self._study = study
        self._run = run
        self._spent = already
        self._known = known or {}
        self._open: dict[int, int | None] = {}  # calls under way: number -> line in the ledger
        self._next = 0
        self._change = threading.Condition()

    def open(self, llm: LanguageModel) -> None:
        """Call before the first request, with the opened model. Raises ``UnknownPrice``, ``LedgerError``,
        ``BudgetExceeded``."""
        if self._dollars and (why := llm.unpriced()):
            raise UnknownPrice(self._dollars, why)
        if self._ledger is not None:
            self._ledger.open()
            if self._known:
                self._ledger.recover(self._run, self._known)
            self._study.check(self._ledger.spent(), f"the study of {self._ledger.path}", "run.study_")
        self._limit.check(self._spent, "this run", "run.")

    def close(self) -> None:
        """Idempotent. Calls that are still under way stay in the ledger as begun."""
        if self._ledger is not None:
            self._ledger.close()

    @property
    def _dollars(self) -> str:
        """The setting that limits dollars, if one does."""
        if self._limit.max_cost is not None:
            return "run.max_cost"
        return "run.study_max_cost" if self._study.max_cost is not None else ""

    @property
    def spent(self) -> Spent:
        """By this run, earlier parts included."""
        with self._change:
            return self._spent

    @property
    def under_way(self) -> int:
        """Calls that have begun and not ended."""
        with self._change:
            return len(self._open)

    def begin(self, request: Request, model: str, entry: int | None = None) -> int:
        """Register a call that is about to be made, with its entry in the run's log. Returns its number for ``end``.
        Raises ``BudgetExceeded``, ``UnknownPrice``."""
        with self._change:
            if self._dollars and self._spent.unpriced:
                raise UnknownPrice(self._dollars, f"a call of {model} came back without a cost")
            self._limit.check(self._spent, "this run", "run.")
            line = None
            if self._ledger is not None:
                expected = sum(len(message.text) for message in request.messages) // CHARACTERS_A_TOKEN
                line = self._ledger.begin(self._run, request.phase, model, expected, self._check_study, entry)
            self._next += 1
            self._open[self._next] = line
            return self._next

    def _check_study(self, spent: Spent) -> None:
        assert self._ledger is not None
        self._study.check(spent, f"the study of {self._ledger.path}", "run.study_")

    def end(self, number: int, usage: Usage | None) -> None:
        """Register the end of a call; ``usage`` None if nothing was spent."""
        with self._change:
            line = self._open.pop(number, None)
            self._spent = self._spent.plus(usage)
            if self._ledger is not None and line is not None:
                self._ledger.end(line, usage)
            self._change.notify_all()

    def wait(self, seconds: float) -> None:
        """Wait, for a limited time, until abandoned calls have ended, so that they are counted."""
        end = time.monotonic() + seconds
        with self._change:
            while self._open and (left := end - time.monotonic()) > 0:
                self._change.wait(left)
