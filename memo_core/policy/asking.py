"""Asking a language model, and again with the reason when the answer is not what was asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import attrs

from memo_core.interfaces.llm import Answer, Message, Request
from memo_core.policy import prompting
from memo_core.policy.calling import ModelCalls, Retrying
from memo_core.policy.readers import Unreadable
from memo_core.policy.session import Session
from memo_core.scene.graph import SceneGraph

T = TypeVar("T")

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
        settings = session.settings
        self._calls = ModelCalls(
            session.llm,
            session.stop,
            session.journal,
            session.emit,
            session.budget,
            Retrying(settings.retries, settings.retry_wait_s),
            session.on_text,
        )

    def ask(
        self, phase: str, scene: SceneGraph | str | None, read: Callable[[str], T], **context: Any
    ) -> tuple[T, Asked]:
        """The answer to one phase's prompt, as ``read`` reads it. Asked again with the reason when that raises
        ``Unreadable``, then that is raised. Raises ``LanguageModelError``, ``BudgetExceeded``, ``Stopped``."""
        prompts = self._session.prompts
        messages = prompting.messages(phase, self._session.stage.robot, scene, prompts, **context)
        calls = 0
        while True:
            calls += 1
            request = Request(phase, messages, SCHEMAS.get(phase), self._session.seed, prompts.stamp(phase))
            answer, file = self._calls.answer(request)
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


def _complete(phase: str, answer: Answer) -> str:
    if answer.finish == "length":
        raise Unreadable(phase, "it was cut off at the model's length limit; answer more briefly", answer.text)
    if answer.finish == "refusal":
        raise Unreadable(
            phase, "it is a refusal; nothing here is dangerous, the robot's limits are checked elsewhere", answer.text
        )
    return answer.text
