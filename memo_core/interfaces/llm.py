"""What a language backend must provide: an answer to messages."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Literal

import attrs

from memo_core.errors import MemoError


@attrs.frozen
class Image:
    """A picture in a message: encoded bytes and their media type."""

    data: bytes = attrs.field(repr=False)
    media_type: str = "image/png"


@attrs.frozen
class Message:
    role: Literal["system", "user", "assistant"]
    text: str
    images: tuple[Image, ...] = ()


@attrs.frozen
class Usage:
    """What a call cost. ``cost`` in US dollars, None when unknown."""

    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost: float | None = None
    latency_s: float = 0.0


@attrs.frozen
class Request:
    """One question. ``phase`` names the prompt it was made from (plan, code, feedback, template, cluster), for logs and
    recordings only; backends answer from ``messages`` alone."""

    phase: str
    messages: tuple[Message, ...]
    response_schema: dict[str, Any] | None = None  # JSON Schema of the answer, where it is JSON
    seed: int | None = None


@attrs.frozen
class Answer:
    """The text as the model wrote it, why it ended, and what it cost.

    ``not_understood`` lists words of the prompt that the backend says it could not make sense of (offline backend).
    """

    text: str
    finish: Literal["stop", "length", "refusal"] = "stop"
    usage: Usage = Usage()
    model: str = ""
    not_understood: tuple[str, ...] = ()


class LanguageModel(ABC):
    """Answers requests. Constructors touch no network; ``open`` may import."""

    name: str

    @abstractmethod
    def open(self) -> None: ...

    @abstractmethod
    def close(self) -> None: ...

    @abstractmethod
    def answer(
        self,
        request: Request,
        on_text: Callable[[str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Answer:
        """Answer one request. ``on_text`` receives pieces while they stream; ``cancelled`` is polled by backends that
        can give up early. Raises ``LanguageModelError``."""


@attrs.define(auto_exc=True, eq=False)
class LanguageModelError(MemoError):
    """A language backend could not answer: ``problem`` says why, ``retryable`` whether asking again may help."""

    backend: str
    problem: str
    retryable: bool = False

    def __str__(self) -> str:
        return f"language model {self.backend!r}: {self.problem}"
