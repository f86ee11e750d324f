"""Converting a request to litellm's arguments, and its response to an answer."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Iterable
from typing import Any, Literal

import attrs

from memo_core.plugin import Message, Request

Finish = Literal["stop", "length", "refusal"]
_FINISHES: dict[str, Finish] = {"length": "length", "max_tokens": "length", "content_filter": "refusal"}


def messages_of(request: Request, schema_in_words: bool, cache_marks: bool = False) -> list[dict[str, Any]]:
    """Messages in OpenAI's format, with inline images. ``schema_in_words`` describes the required form of the answer in
    the last message, if the server does not get the schema. ``cache_marks`` asks the provider to cache the system
    message, which is the same in all questions of a phase."""
    given: list[dict[str, Any]] = [
        {"role": message.role, "content": _content(message, cache_marks and message.role == "system")}
        for message in request.messages
    ]
    if schema_in_words and request.response_schema is not None:
        words = (
            "Answer with one JSON object and nothing else. It must fit this JSON Schema:\n"
            f"{json.dumps(request.response_schema)}"
        )
        given.append({"role": "user", "content": words})
    return given


def response_format(request: Request) -> dict[str, Any]:
    """The request's schema as ``response_format``."""
    schema = {"name": request.phase or "answer", "schema": request.response_schema, "strict": True}
    return {"type": "json_schema", "json_schema": schema}


def _content(message: Message, marked: bool) -> str | list[dict[str, Any]]:
    if not message.images and not marked:
        return message.text
    parts: list[dict[str, Any]] = [{"type": "text", "text": message.text}]
    if marked:
        parts[0]["cache_control"] = {"type": "ephemeral"}
    for image in message.images:
        data = base64.b64encode(image.data).decode("ascii")
        parts.append({"type": "image_url", "image_url": {"url": f"data:{image.media_type};base64,{data}"}})
    return parts


@attrs.define
class Spoken:
    """The model's output as it arrives."""

    text: str = ""
    refusal: str = ""
    finish: str = ""
    usage: Any = None
    model: str = ""

    @property
    def ended(self) -> Finish:
        return "refusal" if self.refusal else _FINISHES.get(self.finish, "stop")

    @property
    def words(self) -> str:
        return self.text or self.refusal


def ending_note(spoken: Spoken, reason: str, max_tokens: int | None) -> str:
    """Why an answer is not complete and what would help; "" if it is. ``reason`` is in the provider's words,
    ``max_tokens`` as set."""
    if spoken.ended == "length":
        before = "" if spoken.text else ", before its first word"
        remedy = f"raise llm.max_answer_tokens ({max_tokens})" if max_tokens else "set a higher llm.max_answer_tokens"
        return f"the answer was cut off at the limit of tokens{before}; {remedy}"
    if spoken.refusal:
        return "the model refuses to answer; other words or another llm.model may help"
    if spoken.ended == "refusal":
        called = f" ({reason})" if reason else ""
        return f"the provider's content filter withheld the answer{called}; other words or another llm.model may help"
    return ""


def read_whole(response: Any, spoken: Spoken) -> None:
    """An answer that arrived in one piece. Raises ``ValueError`` if it contains none."""
    if not getattr(response, "choices", None):
        raise ValueError("it holds no choices")
    choice = response.choices[0]
    spoken.text = choice.message.content or ""
    spoken.refusal = _refusal(choice.message)
    spoken.finish = choice.finish_reason or ""
    spoken.usage = getattr(response, "usage", None)
    spoken.model = response.model or ""


def read_body(body: bytes, spoken: Spoken) -> bool:
    """A whole answer of OpenAI's protocol that came in place of a stream. Returns whether ``body`` is one: it may have
    been recorded in part, or belong to another protocol."""
    from litellm import APIError, ModelResponse
    from litellm.utils import convert_to_model_response_object

    try:
        given = json.loads(body)
    except (ValueError, RecursionError):
        return False
    if not isinstance(given, dict):
        return False
    try:
        response = convert_to_model_response_object(given, ModelResponse())
    except APIError:
        return False
    except Exception as error:
        if type(error) is not Exception:  # a plain one is litellm's word for what it cannot convert
            raise
        return False
    try:
        read_whole(response, spoken)
    except ValueError:
        return False
    return True


def _refusal(said: Any) -> str:
    kept = getattr(said, "provider_specific_fields", None) or {}
    return getattr(said, "refusal", None) or kept.get("refusal") or ""


def read_stream(chunks: Iterable[Any], spoken: Spoken, on_piece: Callable[[str], None]) -> bool:
    """A streamed answer; ``spoken`` always contains what has arrived so far. Returns whether litellm saw a reason for
    the end; without one it reports "stop"."""
    for chunk in chunks:
        spoken.model = getattr(chunk, "model", None) or spoken.model
        spoken.usage = getattr(chunk, "usage", None) or spoken.usage
        if not getattr(chunk, "choices", None):
            continue
        choice = chunk.choices[0]
        spoken.finish = choice.finish_reason or spoken.finish
        spoken.refusal += _refusal(choice.delta)
        piece = choice.delta.content or ""
        if piece:
            spoken.text += piece
            on_piece(piece)
    return getattr(chunks, "received_finish_reason", spoken.finish) is not None
