"""One call of a language model, and again where that may help: the only place that does so.

Every call, whatever becomes of it, is in the journal, an event and the budget: retries, calls that were given up, and
calls whose answer was lost on the way.
"""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable
from typing import Protocol

import attrs

from memo_core.errors import Stopped
from memo_core.events import Event, ModelCalled, Problem
from memo_core.interfaces.llm import Answer, LanguageModel, LanguageModelError, Request, Usage
from memo_core.policy.budget import Budget
from memo_core.policy.stopping import StopSwitch, abandonable
from memo_core.redaction import Redactor

LONGEST_WAIT_S = 120.0  # a server that wants to be left alone for longer is not asked again
_LONGEST_BACK_OFF_S = 30.0


class CallJournal(Protocol):
    """Where calls are kept."""

    def model_call(
        self, request: Request, answer: Answer | None, problem: str, abandoned: bool, usage: Usage | None = None
    ) -> str: ...


@attrs.frozen
class Retrying:
    """``times`` at most after a failure that may pass; before the first, ``first_wait_s`` pass, twice that before the
    second, and so on, give or take a quarter, so that several runs do not come back together."""

    times: int = 3
    first_wait_s: float = 1.0

    def wait_s(self, attempt: int, error: LanguageModelError) -> float | None:
        """Seconds before the attempt after ``attempt`` (from 0), no less than the server asked for; None: no more."""
        asked = error.retry_after_s or 0.0
        if not error.retryable or attempt >= self.times or asked > LONGEST_WAIT_S:
            return None
        back_off = min(_LONGEST_BACK_OFF_S, self.first_wait_s * 2.0**attempt) * random.uniform(0.75, 1.25)
        return max(asked, back_off)


class ModelCalls:
    """Puts requests to one model."""

    def __init__(
        self,
        llm: LanguageModel,
        stop: StopSwitch,
        journal: CallJournal,
        emit: Callable[[Event], None],
        budget: Budget,
        retrying: Retrying = Retrying(),
        on_text: Callable[[str, str], None] | None = None,
    ) -> None:
        """``on_text`` receives the phase and pieces of its answer while it is written; called from other threads."""
        self._llm = llm
        self._stop = stop
        self._journal = journal
        self._emit = emit
        self._budget = budget
        self._retrying = retrying
        self._on_text = on_text
        self._redact = Redactor.of_environment()

    @property
    def model(self) -> str:
        return self._llm.name

    def to(self, llm: LanguageModel) -> ModelCalls:
        """Calls of another model, in the same journal and budget."""
        return ModelCalls(llm, self._stop, self._journal, self._emit, self._budget, self._retrying, self._on_text)

    def answer(self, request: Request) -> tuple[Answer, str]:
        """The answer and its file in the run folder. Raises ``LanguageModelError`` when asking again does not help,
        ``BudgetExceeded``, ``Stopped``."""
        attempt = 0
        while True:
            try:
                return self._once(request)
            except LanguageModelError as error:
                wait = self._retrying.wait_s(attempt, error)
                if wait is None:
                    raise
                attempt += 1
                words = f"{error}; asked again in {wait:.1f} s ({attempt} of {self._retrying.times})"
                self._emit(Problem(f"asking for the {request.phase}", words))
                self._pause(wait)

    def _once(self, request: Request) -> tuple[Answer, str]:
        begun: list[int] = []
        started = time.monotonic()
        given_up = threading.Event()
        shown = self._redact.pieces(self._shower(request.phase, given_up)) if self._on_text else None

        def work() -> Answer:
            begun.append(self._budget.begin(request, self._llm.name))
            answer = self._llm.answer(request, shown, given_up.is_set)
            if shown is not None:
                shown.end()
            return attrs.evolve(answer, text=self._redact(answer.text))

        def kept(result: Answer | BaseException, abandoned: bool) -> str:
            if not begun:
                return ""  # it was never made
            try:
                return self._keep(request, result, time.monotonic() - started, abandoned)
            finally:
                self._budget.end(begun[0], _usage(result))

        def late(result: Answer | BaseException) -> None:
            kept(result, True)

        try:
            answer = abandonable(self._stop, request.phase, work, late)
        except LanguageModelError as error:
            error.problem = self._redact(error.problem)
            kept(error, False)
            raise
        except Stopped:
            given_up.set()  # what was spent comes late, and is kept then
            raise
        except BaseException as error:
            kept(error, False)
            raise
        return answer, kept(answer, False)

    def _shower(self, phase: str, given_up: threading.Event) -> Callable[[str], None]:
        def show(piece: str) -> None:
            if self._on_text is not None and not given_up.is_set():
                self._on_text(phase, piece)

        return show

    def _keep(self, request: Request, result: Answer | BaseException, took: float, abandoned: bool) -> str:
        answer = result if isinstance(result, Answer) else None
        problem = "" if answer else self._redact(str(result))
        usage = _usage(result)
        file = self._journal.model_call(request, answer, problem, abandoned, None if answer else usage)
        spent = usage or Usage()
        self._emit(
            ModelCalled(
                phase=request.phase,
                model=(answer.model if answer else "") or self._llm.name,
                prompt_tokens=spent.prompt_tokens,
                completion_tokens=spent.completion_tokens,
                cost=spent.cost,
                latency_s=spent.latency_s or took,
                abandoned=abandoned,
                not_understood=answer.not_understood if answer else (),
                note=answer.note if answer else "",
                problem=problem,
            )
        )
        return file

    def _pause(self, seconds: float) -> None:
        news = threading.Event()
        with self._stop.waking(news.set):
            news.wait(seconds)
        self._stop.check("waiting to ask again")


def _usage(result: Answer | BaseException) -> Usage | None:
    return getattr(result, "usage", None)
