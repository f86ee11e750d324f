"""What a language backend must provide: an answer to messages."""

from __future__ import annotations

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Literal

import attrs

from memo_core.errors import MemoError


@attrs.frozen
class Image:
    """An image in a message: encoded bytes and their media type."""

    data: bytes = attrs.field(repr=False)
    media_type: str = "image/png"

    @property
    def digest(self) -> str:
        """SHA-256 of the encoded bytes, in hex: the name of the image in records."""
        return hashlib.sha256(self.data).hexdigest()


@attrs.frozen
class Message:
    role: Literal["system", "user", "assistant"]
    text: str
    images: tuple[Image, ...] = ()


@attrs.frozen
class Usage:
    """Cost of a call. ``cost`` in US dollars, None when unknown; ``cached_tokens``: how many of the prompt tokens the
    provider read from its cache."""

    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost: float | None = None
    latency_s: float = 0.0
    cached_tokens: int = 0


@attrs.frozen
class Request:
    """One question. ``phase`` names the prompt from which it was rendered (plan, code, feedback, template, …), for
    logs and recordings only; backends use ``messages`` alone."""

    phase: str
    messages: tuple[Message, ...]
    response_schema: dict[str, Any] | None = None  # JSON Schema of the answer, where it is JSON
    seed: int | None = None
    prompt: str = ""  # versions and digests of the prompt files that the messages were made from

    @property
    def digest(self) -> str:
        """SHA-256 in hex of everything that a backend may use: messages with their images, schema and seed, but not the
        phase. Two requests with the same digest are the same question."""
        messages = [[m.role, m.text, [image.digest for image in m.images]] for m in self.messages]
        asked = json.dumps([messages, self.response_schema, self.seed], sort_keys=True, ensure_ascii=False)
        return hashlib.sha256(asked.encode("utf-8", "surrogatepass")).hexdigest()


@attrs.frozen
class Answer:
    """The text as the model wrote it, why it ended, and what it cost.

    ``not_understood`` lists words of the prompt that the backend reports as not understood (offline backend).
    """

    text: str
    finish: Literal["stop", "length", "refusal"] = "stop"
    usage: Usage = Usage()
    model: str = ""
    not_understood: tuple[str, ...] = ()
    note: str = ""  # what a user should know about how this answer came about: kept from before, matched loosely


class LanguageModel(ABC):
    """Answers requests. Constructors touch no network; ``open`` may import."""

    name: str
    deterministic: bool = False  # the same request always has the same answer, in every process
    calls_functions: bool = True  # whether its programs call functions of the skillbook that a prompt offers
    sees: bool = True  # whether it may use pictures; for one that reads text only none are taken

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
        """Answer one request without retrying: the caller retries. It may be called from several threads at once.

        Args:
            request: the question; only its messages, schema and seed may affect the answer.
            on_text: called with each piece of the text as it arrives; joined, the pieces are the answer's text.
            cancelled: True once the caller no longer wants the answer; backends that can give up early poll it.

        Returns:
            The answer with its usage.

        Raises:
            LanguageModelError: if there is no answer; says why, and whether asking again may help.
        """

    def unpriced(self) -> str:
        """Why the cost of calls will not be known, and the remedy; empty if it will be known. Called after ``open`` by
        runs with a limit in dollars."""
        return ""

    def expected_cost(self, usage: Usage) -> float | None:
        """US dollars that a call with these tokens would cost; None if unknown. Called after ``open``."""
        return None

    def unsupported(self) -> dict[str, str]:
        """Name what turned out not to be used, with reasons: ``schema`` (the form of an answer is described in
        words), ``stream`` (answers arrive whole), ``usage`` (tokens are estimated). For reports only."""
        return {}


Cause = Literal["", "access", "quota", "unreachable", "busy", "timeout", "refusal", "length"]


@attrs.define(auto_exc=True, eq=False)
class LanguageModelError(MemoError):
    """A language backend could not answer: ``problem`` says why, ``retryable`` whether asking again may help, and
    ``retry_after_s`` the delay that the server asks for. ``usage`` is the probable cost of a call whose question was
    sent and whose answer was lost; None if nothing was spent. ``cause`` is the kind of failure, as far as it is known:

    - ``access``: the key is missing or refused, or the model's name is unknown to the provider
    - ``quota``: the paid quota or the credit is used up
    - ``unreachable``: nobody listens at the address, or a page of something else answers there
    - ``busy``: a rate limit, or an overloaded server
    - ``timeout``: no complete answer within the time limit
    - ``refusal``: a content filter withheld the answer to this question
    - ``length``: the answer was cut off at the limit of tokens
    """

    backend: str
    problem: str
    retryable: bool = False
    retry_after_s: float | None = None
    usage: Usage | None = None
    cause: Cause = ""

    @property
    def persistent(self) -> bool:
        """Whether every other question would fail as well, until a person mends the cause."""
        return self.cause in ("access", "quota", "unreachable")

    def __str__(self) -> str:
        return f"language model {self.backend!r}: {self.problem}"
