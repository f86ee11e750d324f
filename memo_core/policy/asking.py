"""Asking a language model: once, again with the reason when the answer is not what was asked for, and never past a
stop."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, TypeVar

import attrs

from memo_core.errors import MemoError
from memo_core.events import ModelCalled
from memo_core.interfaces.llm import Answer, LanguageModelError, Message, Request
from memo_core.policy import prompting
from memo_core.policy.readers import Unreadable
from memo_core.policy.session import Session
from memo_core.policy.stopping import abandonable
from memo_core.scene.graph import SceneGraph

T = TypeVar("T")
RETRIES = 2  # of a call that failed in a way that may pass

_STRINGS = {"type": "array", "items": {"type": "string"}}
SCHEMAS: dict[str, dict[str, Any]] = {
    "feedback": {
        "type": "object",
        "properties": {"corrections": _STRINGS, "general": _STRINGS, "unclear": {"type": "string"}},
        "required": ["corrections", "general", "unclear"],
        "additionalProperties": False,
    }
}


@attrs.frozen
class Asked:
    """How often a question was put and what the prompts' files are called; for events."""

    calls: int
    file: str


class Questions:
    """Asks the model of one session."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def ask(
        self, phase: str, scene: SceneGraph | str | None, read: Callable[[str], T], **context: Any
    ) -> tuple[T, Asked]:
        """The answer to one phase's prompt, as ``read`` reads it. Asked again with the reason when that raises
        ``Unreadable``, then that is raised. Raises ``LanguageModelError``, ``Stopped``."""
        prompts = self._session.prompts
        messages = prompting.messages(phase, self._session.stage.robot, scene, prompts, **context)
        calls = 0
        while True:
            calls += 1
            request = Request(phase, messages, SCHEMAS.get(phase), self._session.seed, prompts.stamp(phase))
            answer, file = self._call(request)
            try:
                return read(_complete(phase, answer)), Asked(calls, file)
            except Unreadable as error:
                if calls > self._session.settings.reasks:
                    raise
                messages = (
                    *messages,
                    Message("assistant", answer.text),
                    Message(
                        "user", f"This answer cannot be used: {error.problem}. Answer once more, in the form asked for."
                    ),
                )

    def _call(self, request: Request) -> tuple[Answer, str]:
        for attempt in range(RETRIES + 1):
            try:
                return self._call_once(request)
            except LanguageModelError as error:
                if not error.retryable or attempt == RETRIES:
                    raise
                self._pause(2.0**attempt)
        raise AssertionError("unreachable")

    def _call_once(self, request: Request) -> tuple[Answer, str]:
        session, started = self._session, time.monotonic()
        stopped = False

        def work() -> Answer:
            return session.llm.answer(request, cancelled=lambda: stopped)

        def late(result: Answer | BaseException) -> None:
            # Nobody waits for it any more, but it was paid for.
            answer = result if isinstance(result, Answer) else None
            problem = "" if answer else str(result)
            session.journal.model_call(request, answer, problem, abandoned=True)
            self._report(request, answer, time.monotonic() - started, abandoned=True)

        try:
            answer = abandonable(session.stop, request.phase, work, late)
        except MemoError as error:
            stopped = True
            if isinstance(error, LanguageModelError):
                session.journal.model_call(request, None, str(error), abandoned=False)
            raise
        file = session.journal.model_call(request, answer, "", abandoned=False)
        self._report(request, answer, time.monotonic() - started, abandoned=False)
        return answer, file

    def _report(self, request: Request, answer: Answer | None, took: float, abandoned: bool) -> None:
        if answer is None:
            return
        usage = answer.usage
        self._session.emit(
            ModelCalled(
                phase=request.phase,
                model=answer.model or self._session.llm.name,
                prompt_tokens=usage.prompt_tokens,
                completion_tokens=usage.completion_tokens,
                cost=usage.cost,
                latency_s=usage.latency_s or took,
                abandoned=abandoned,
                not_understood=answer.not_understood,
                note=answer.note,
            )
        )

    def _pause(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._session.stop.check("waiting to ask again")
            time.sleep(0.01)


def _complete(phase: str, answer: Answer) -> str:
    if answer.finish == "length":
        raise Unreadable(phase, "it was cut off at the model's length limit; answer more briefly", answer.text)
    if answer.finish == "refusal":
        raise Unreadable(
            phase, "it is a refusal; nothing here is dangerous, the robot's limits are checked elsewhere", answer.text
        )
    return answer.text
