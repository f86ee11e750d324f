"""Call a language model, retrying transient failures: the only place that does so.

Every call is an effect in the run's log, a file, an event and in the budget, including retries, abandoned calls, and
calls whose answer was lost."""

from __future__ import annotations

import random
import re
import threading
import time
from collections.abc import Callable
from typing import Any

import attrs

from memo_core.errors import WHILE, BackendUnavailable, Stopped
from memo_core.events import Event, ModelAsked, ModelCalled, Problem
from memo_core.interfaces.llm import Answer, LanguageModel, LanguageModelError, Request, Usage
from memo_core.llm.budget import Budget, BudgetExceeded
from memo_core.llm.kept_calls import ASK, answer_in, call_name, call_text, read_call, result_in, usage_of
from memo_core.process.signal_safe import Wake
from memo_core.process.stop_switch import StopSwitch, abandonable
from memo_core.runlog.run_log import Effect, RunLog
from memo_core.text.parsing import read_as
from memo_core.text.reading_limits import LONGEST_ANSWER
from memo_core.text.redaction import Redactor

LONGEST_WAIT_S = 120.0  # a server that wants to be left alone for longer is not asked again
_LONGEST_BACK_OFF_S = 30.0
_HALVES = re.compile("[\ud800-\udfff]")  # of surrogate pairs: no file, database or prompt takes them
KEPT = "kept from before the run was cut off: not asked, not paid again"
_BACK_OFF: Effect[float | None] = Effect("draw a back-off")
_PAUSE: Effect[None] = Effect("wait to ask again")


@attrs.frozen
class Retrying:
    """Retry at most ``times`` after a transient failure: after ``first_wait_s``, then after twice that time, and so on,
    with a random variation of a quarter, so that several runs do not retry at the same time."""

    times: int = 3
    first_wait_s: float = 1.0

    def wait_s(self, attempt: int, error: LanguageModelError) -> float | None:
        """Seconds before the attempt after ``attempt`` (from 0), no less than the server asked for; None: no more."""
        asked = error.retry_after_s or 0.0
        if not error.retryable or attempt >= self.times or asked > LONGEST_WAIT_S:
            return None
        back_off = min(_LONGEST_BACK_OFF_S, self.first_wait_s * 2.0**attempt) * random.uniform(0.75, 1.25)
        return max(asked, back_off)


@attrs.frozen
class _Answered:
    """An answer and its file in the run's folder."""

    answer: Answer
    file: str


class ModelCalls:
    """Sends requests to one model."""

    def __init__(
        self,
        llm: LanguageModel,
        stop: StopSwitch,
        log: RunLog,
        emit: Callable[[Event], None],
        budget: Budget,
        retrying: Retrying = Retrying(),
        on_text: Callable[[str, str], None] | None = None,
    ) -> None:
        """``on_text`` receives the phase and pieces of its answer while it is written; called from other threads."""
        self._llm = llm
        self._stop = stop
        self._log = log
        self._emit = emit
        self._budget = budget
        self._retrying = retrying
        self._on_text = on_text
        self._redact = Redactor.of_environment()

    @property
    def model(self) -> str:
        return self._llm.name

    def to(self, llm: LanguageModel) -> ModelCalls:
        """Calls to another model with the same log and budget."""
        return ModelCalls(llm, self._stop, self._log, self._emit, self._budget, self._retrying, self._on_text)

    def answer(self, request: Request, read: Callable[[Answer], str] = lambda _: "") -> tuple[Answer, str]:
        """The answer and its file in the run folder. ``read`` is called with it while a stop can still abandon the
        call, so that a caller that remembers its result need not take time for it afterwards, and once more; it returns
        why the answer cannot be used, or "". Raises ``LanguageModelError`` when asking again does not help,
        ``BudgetExceeded``, ``Stopped``."""
        attempt, said = 0, ""
        while True:
            try:
                return self._once(request, read)
            except LanguageModelError as error:
                failed = error
            attempt += 1
            said = self._back_off(request, attempt, failed, said)

    def _back_off(self, request: Request, attempt: int, failed: LanguageModelError, said: str) -> str:
        """Wait before asking again, and return the message of ``failed``; ``said``: that of the attempt before. Raises
        ``failed`` if a retry cannot help, ``Stopped``."""
        wait = self._log.effect(_BACK_OFF, str(attempt), lambda _: self._retrying.wait_s(attempt - 1, failed))
        if wait is None:
            raise failed
        problem = "the same again" if str(failed) == said else str(failed)
        words = f"{problem}; asked again in {wait:.1f} s ({attempt} of {self._retrying.times})"
        self._emit(Problem(f"asking for the {request.phase}", words))
        self._log.effect(_PAUSE, str(attempt), lambda _: self._pause(wait))
        return str(failed)

    def _once(self, request: Request, read: Callable[[Answer], str]) -> tuple[Answer, str]:
        started = time.monotonic()
        about = f"{request.phase} {request.digest}"
        kind = Effect(ASK, self._keep, self._read, outside=True, errors=(LanguageModelError, BudgetExceeded))  # type: Effect[_Answered]
        try:
            answered = self._log.effect(
                kind,
                about,
                lambda number: (
                    self._answered_before(about) or self._ask(request, call_name(number, request.phase), number, read)
                ),
                lambda number: self._found(call_name(number, request.phase)),
                lambda number, logged: self._with_other_prompts(request, number, logged),
            )
        except LanguageModelError as error:
            self._emit(self._called(request, error, time.monotonic() - started, False))
            raise
        took, unusable = time.monotonic() - started, self._redact(read(answered.answer))
        self._emit(attrs.evolve(self._called(request, answered.answer, took, False), unusable=unusable))
        return answered.answer, answered.file

    def _with_other_prompts(self, request: Request, number: int, logged: str) -> bool:
        """Whether a logged call is this question, made from other prompt files: a run outlives an update of MEMO."""
        name, folder = call_name(number, request.phase), self._log.folder
        if folder is None or logged.split()[0] != request.phase:
            return False
        return not (folder / name).exists() or read_call(folder, name).get("prompt") != request.prompt

    def _answered_before(self, about: str) -> _Answered | None:
        """A paid, unused answer to exactly this question: from a call that was abandoned or that a resumed run
        repeats."""
        folder = self._log.folder
        while folder is not None and (value := self._log.kept(about)) is not None:
            if read_call(folder, value["file"])["answer"] is not None:
                answer = answer_in(folder, value["file"])
                return _Answered(attrs.evolve(answer, usage=Usage(cost=0.0), note=KEPT), value["file"])
        return None

    def _found(self, file: str) -> _Answered | None:
        """The result of a call that has no end in the log, from its file, which is written first."""
        folder = self._log.folder
        result = result_in(folder, file, self._llm.name) if folder is not None else None
        if isinstance(result, LanguageModelError):
            raise result
        return None if result is None else _Answered(result, file)

    def _ask(self, request: Request, file: str, number: int, read: Callable[[Answer], str]) -> _Answered:
        begun: list[int] = []
        unusable = [""]
        started = time.monotonic()
        given_up = threading.Event()
        shown = self._redact.pieces(self._shower(request.phase, given_up)) if self._on_text else None
        self._emit(ModelAsked(request.phase, self._llm.name))

        def work() -> Answer:
            begun.append(self._budget.begin(request, self._llm.name, number if self._log.folder is not None else None))
            try:
                answer = self._llm.answer(request, shown, given_up.is_set)
            except Exception as error:  # whose plugin it is must be said, whatever it raises
                error.add_note(f"{WHILE} llm {self._llm.name!r} answered")
                raise
            if not isinstance(answer, Answer):
                said = f"its answer() returned {type(answer).__name__}, not an Answer(text, …)"
                raise BackendUnavailable("llm", self._llm.name, said, "a bug in its plugin")
            if shown is not None:
                shown.end()
            answer = _shortened(attrs.evolve(answer, text=_HALVES.sub("\ufffd", self._redact(answer.text))))
            unusable.append(self._redact(read(answer)))
            return answer

        def over(result: Answer | BaseException, abandoned: bool) -> str:
            """Register the end of a call: write its file, then update the budget."""
            if not begun:
                return ""  # it was never made
            try:
                return self._log.write(file, call_text(request, result, self._problem(result), abandoned, unusable[-1]))
            finally:
                self._budget.end(begun[0], usage_of(result))

        def late(result: Answer | BaseException) -> None:
            if not begun:
                return
            name = over(result, True)
            spent = usage_of(result)
            self._log.late(number, {"file": name, "usage": None if spent is None else attrs.asdict(spent)})
            self._emit(self._called(request, result, time.monotonic() - started, True))

        try:
            answer = abandonable(self._stop, request.phase, work, late)
        except LanguageModelError as error:
            error.problem = self._redact(error.problem)
            over(error, False)
            raise
        except Stopped:
            given_up.set()  # what was spent comes late, and is kept then
            raise
        except BaseException as error:
            if over(error, False) or begun:
                self._emit(self._called(request, error, time.monotonic() - started, False))
            raise
        return _Answered(answer, over(answer, False))

    def _keep(self, answered: _Answered) -> dict[str, Any]:
        kept = {"kept": True} if answered.answer.note == KEPT else {}
        return {"file": answered.file, "usage": attrs.asdict(answered.answer.usage), **kept}

    def _read(self, value: dict[str, Any]) -> _Answered:
        assert self._log.folder is not None
        answer = answer_in(self._log.folder, value["file"])
        if value.get("kept"):
            answer = attrs.evolve(answer, usage=read_as(Usage, value["usage"]), note=KEPT)
        return _Answered(answer, value["file"])

    def _shower(self, phase: str, given_up: threading.Event) -> Callable[[str], None]:
        def show(piece: str) -> None:
            if self._on_text is not None and not given_up.is_set():
                self._on_text(phase, piece)

        return show

    def _problem(self, result: Answer | BaseException) -> str:
        return "" if isinstance(result, Answer) else self._redact(str(result))

    def _called(self, request: Request, result: Answer | BaseException, took: float, abandoned: bool) -> ModelCalled:
        answer = result if isinstance(result, Answer) else None
        spent = usage_of(result) or Usage()
        return ModelCalled(
            phase=request.phase,
            model=(answer.model if answer else "") or self._llm.name,
            prompt_tokens=spent.prompt_tokens,
            completion_tokens=spent.completion_tokens,
            cost=spent.cost,
            latency_s=spent.latency_s or took,
            abandoned=abandoned,
            not_understood=answer.not_understood if answer else (),
            note=answer.note if answer else "",
            problem=self._problem(result),
            cached_tokens=spent.cached_tokens,
        )

    def _pause(self, seconds: float) -> None:
        news = Wake()
        with self._stop.waking(news.set):
            news.wait(seconds)
        self._stop.check("waiting to ask again")


def _shortened(answer: Answer) -> Answer:
    """An answer that is too long to be read ends as at the model's own limit."""
    if len(answer.text) <= LONGEST_ANSWER:
        return answer
    return attrs.evolve(answer, text=answer.text[:LONGEST_ANSWER], finish="length")
