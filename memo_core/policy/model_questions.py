"""Asking a language model, and asking again with the reason if its answer cannot be read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, TypeVar, cast

import attrs

from memo_core.interfaces.llm import Answer, Cause, LanguageModelError, Message, Request
from memo_core.llm.calls import ModelCalls, Retrying
from memo_core.llm.readers import Unreadable
from memo_core.policy import prompting
from memo_core.policy.pictures import Picture, with_pictures
from memo_core.policy.run_context import Session
from memo_core.scene.graph import SceneGraph

T = TypeVar("T")

# Why an answer is not complete, by its cause: in words for the model, and for people where the backend says no more.
_INCOMPLETE: dict[Cause, str] = {
    "length": "it was cut off at the model's length limit; answer more briefly",
    "refusal": "it is a refusal; nothing here is dangerous, the robot's limits are checked elsewhere",
}
_ENDED: dict[Cause, str] = {
    "length": "the answer was cut off at the limit of tokens; raise that limit",
    "refusal": "the model or a content filter refuses to answer; other words or another model may help",
}

_STRING = {"type": "string"}
_NUMBER = {"type": "integer"}
_STRINGS = {"type": "array", "items": _STRING}


def schema_of(phase: str, context: Mapping[str, Any]) -> dict[str, Any] | None:
    """The JSON Schema of the expected answer; None if the answer is not JSON, or has too many shapes for a schema."""
    if phase == "feedback":
        return _feedback_schema(context)
    return _cluster_schema(context) if phase == "cluster" else None


def _feedback_schema(context: Mapping[str, Any]) -> dict[str, Any]:
    lists = {"corrections": _STRINGS, "general": _STRINGS}
    lists |= {"plan": _STRINGS} if context.get("plans") else {}
    return _object(**lists, elsewhere=_list_of(subtask=_STRING, note=_STRING), unclear=_STRING)


def _cluster_schema(context: Mapping[str, Any]) -> dict[str, Any]:
    covered = {"covered": {"type": "boolean"}} if context.get("covered") else {}
    return _object(
        entries=_list_of(text=_STRING, **{"from": {"type": "array", "items": _NUMBER}}),
        dropped=_list_of(number=_NUMBER, template=_NUMBER, reason=_STRING, **covered),
    )


def _list_of(**properties: Any) -> dict[str, Any]:
    return {"type": "array", "items": _object(**properties)}


def _object(**properties: Any) -> dict[str, Any]:
    """The schema of an object with exactly these keys; strict modes of providers demand that all are required."""
    return {
        "type": "object",
        "properties": properties,
        "required": list(properties),
        "additionalProperties": False,
    }


@attrs.frozen
class Asked:
    """How often a question was asked, and the names of the prompt files; for events."""

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
            session.log,
            session.emit,
            session.budget,
            Retrying(settings.retries, settings.retry_wait_s),
            session.on_text,
        )

    def ask(
        self,
        phase: str,
        scene: SceneGraph | str | None,
        read: Callable[[str], T],
        pictures: Sequence[Picture] = (),
        **context: Any,
    ) -> tuple[T, Asked]:
        """The answer to one phase's prompt with these pictures, parsed by ``read``. While ``read`` raises
        ``Unreadable``, or the answer is withheld or cut off, the question is asked again with the reason, at most a set
        number of times; then ``Unreadable`` is raised. Raises ``LanguageModelError``, ``BudgetExceeded``,
        ``Stopped``."""
        session = self._session
        messages = prompting.messages(phase, session.environment.robot, scene, session.prompts, **context)
        messages = with_pictures(messages, pictures)
        stamp = session.prompts.stamp(phase)
        schema = schema_of(phase, context)
        return put(self._calls, phase, messages, read, session.settings.reasks, session.seed, stamp, schema)


def put(
    calls: ModelCalls,
    phase: str,
    messages: tuple[Message, ...],
    read: Callable[[str], T],
    reasks: int,
    seed: int = 0,
    stamp: str = "",
    schema: dict[str, Any] | None = None,
) -> tuple[T, Asked]:
    """Ask a question, and up to ``reasks`` times again with the reason while ``read`` raises ``Unreadable`` or the
    answer is withheld or cut off. Raises as ``Questions.ask``."""
    asked, reader = 0, _Reader(lambda answer: read(_complete(phase, answer, calls.model)))
    while True:
        asked += 1
        request = Request(phase, messages, schema, seed, stamp)
        try:
            answer, file = calls.answer(request, reader.prepare)
        except LanguageModelError as error:
            if error.cause not in _INCOMPLETE:
                raise
            # The provider withheld its answer to this question; it would answer others.
            raise Unreadable(phase, f"{calls.model}: {error.problem}", cause=error.cause) from error
        try:
            return reader(answer), Asked(asked, file)
        except Unreadable as error:
            if asked > reasks:
                raise
            if answer.text.strip():  # several providers reject a message without text
                messages = (*messages, Message("assistant", answer.text))
            again = f"This answer cannot be used: {_for_the_model(error)}. Answer once more, in the form asked for."
            messages = (*messages, Message("user", again))


class _Reader(Generic[T]):
    """Reads an answer ahead of time, where a stop can abandon it, and remembers the result."""

    def __init__(self, read: Callable[[Answer], T]) -> None:
        self._read = read
        self._ready: tuple[Answer, T | None, Unreadable | None] | None = None

    def prepare(self, answer: Answer) -> str:
        """Read an answer, once. Returns why it cannot be used, in words for the model; "" if it can."""
        if self._ready is None or self._ready[0] is not answer:
            try:
                self._ready = (answer, self._read(answer), None)
            except Unreadable as error:
                self._ready = (answer, None, error)
        unread = self._ready[2]
        return "" if unread is None else _for_the_model(unread)

    def __call__(self, answer: Answer) -> T:
        """Raises ``Unreadable``."""
        self.prepare(answer)
        assert self._ready is not None
        _, value, error = self._ready
        if error is not None:
            raise error
        return cast(T, value)


def _for_the_model(error: Unreadable) -> str:
    return _INCOMPLETE.get(error.cause, error.problem)


def _complete(phase: str, answer: Answer, model: str) -> str:
    """The text of an answer. Raises ``Unreadable``, in words for people, if it is withheld or cut off."""
    if answer.finish == "stop":
        return answer.text
    raise Unreadable(phase, f"{model}: {answer.note or _ENDED[answer.finish]}", answer.text, cause=answer.finish)
