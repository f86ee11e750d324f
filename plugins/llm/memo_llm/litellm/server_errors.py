"""Reading from a response what litellm drops: the server's error (in a body of JSON, in an event of a stream, on a
page), why an answer ended, the words of a refusal, and whether tokens were counted."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterator
from typing import Any

import attrs

# HTTP status that an error's type stands for, where it comes with another one (200, since the stream had begun).
_STATUSES = {
    "authentication_error": 401,
    "billing_error": 402,
    "deadline_exceeded": 504,
    "insufficient_quota": 429,
    "internal": 500,
    "internal_error": 500,
    "internal_server_error": 500,
    "invalid_api_key": 401,
    "invalid_argument": 400,
    "invalid_request_error": 400,
    "api_error": 500,
    "model_not_found": 404,
    "not_found": 404,
    "not_found_error": 404,
    "overloaded_error": 529,
    "permission_denied": 403,
    "permission_error": 403,
    "rate_limit_error": 429,
    "rate_limit_exceeded": 429,
    "resource_exhausted": 429,
    "server_error": 500,
    "timeout_error": 504,
    "unauthenticated": 401,
    "unavailable": 503,
}
_OVERLOADED = re.compile(r"\b(overloaded|(over|at) capacity|temporarily unavailable|try again later)\b", re.IGNORECASE)
_ENDED = re.compile(rb'"(?:finish_?reason|block_?reason|stop_?reason|done_?reason)"\s*:\s*"([\w-]+)"', re.IGNORECASE)
_COUNT = re.compile(rb'"(?:(?:prompt|input)_?tokens?(?:_?count)?|prompt_eval_count)"\s*:\s*\d', re.IGNORECASE)
_REFUSAL = re.compile(rb'"refusal"\s*:\s*("(?:[^"\\]|\\.)*")')
_WAIT = re.compile(r"(\d+(?:\.\d+)?)s")


@attrs.frozen
class ServerError:
    """An error in a server's words. ``names`` are its type, code and reasons, as the provider calls them in lower case;
    ``status`` the HTTP status that they stand for, if any; ``retry_after_s`` the delay that the body asks for."""

    message: str
    names: frozenset[str] = frozenset()
    status: int | None = None
    retry_after_s: float | None = None


def error_in(body: bytes, end: bytes = b"") -> ServerError | None:
    """The error that a response reports. ``body`` is its beginning, ``end`` its end; a stream reports an error last."""
    for record in (_parsed(body), *_events(end)):
        if (found := _error(record)) is not None:
            return found
    return None


def page_in(body: bytes, may_be_plain: bool = False) -> str | None:
    """The title or the words of a page of HTML, or of text if it ``may_be_plain``; None for any other body."""
    text = body.decode("utf-8", "replace").strip()
    if not re.match(r"<(!doctype|html|head|body)\b", text, re.IGNORECASE):
        return text if may_be_plain and text and _parsed(body) is None else None
    title = re.search(r"<title[^>]*>(.*?)</title>", text, re.IGNORECASE | re.DOTALL)
    words = title.group(1) if title else re.sub(r"<(style|script)\b.*?</\1>|<[^>]*>", " ", text, flags=re.I | re.S)
    return " ".join(html.unescape(words).split()) or "a page without words"


def end_reason(end: bytes) -> str:
    """The reason why an answer ended, as the provider calls it, from the end of a response; "" if it names none."""
    reasons = _ENDED.findall(end)
    return reasons[-1].decode() if reasons else ""


def counts_tokens(begin: bytes, end: bytes) -> bool:
    """Whether a response says how many tokens the question had; if it does not, litellm estimates them."""
    return _COUNT.search(begin) is not None or _COUNT.search(end) is not None


def refusal_in(end: bytes) -> str:
    """The words of a refusal in the end of a stream of OpenAI's protocol."""
    return "".join(_parsed(piece) or "" for piece in _REFUSAL.findall(end))


def _parsed(text: bytes) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _events(end: bytes) -> Iterator[Any]:
    """The events of a stream, latest first: server-sent events, or one object a line."""
    for line in reversed(end.splitlines()):
        yield _parsed(line.removeprefix(b"data:").strip())


def _error(record: Any) -> ServerError | None:
    if isinstance(record, list):  # Gemini reports errors as a list of one
        record = record[0] if record else None
    if not isinstance(record, dict):
        return None
    found = record.get("error")
    if isinstance(found, str):
        return _made(found, record)
    if isinstance(found, dict):
        return _made(str(found.get("message") or found), found)
    for name in ("message", "detail"):  # of a record that is nothing but an error
        if "choices" not in record and isinstance(record.get(name), str):
            return _made(record[name], record)
    return None


def _made(message: str, record: dict[str, Any]) -> ServerError:
    details = _records(record.get("details"))
    said = [record.get(name) for name in ("type", "code", "status", "reason")]
    said += [detail.get("reason") for detail in details]
    said += [one.get("quotaId") for detail in details for one in _records(detail.get("violations"))]
    names = frozenset(one.lower() for one in said if isinstance(one, str))
    waits = [_WAIT.fullmatch(str(detail.get("retryDelay"))) for detail in details]
    metadata = record.get("metadata")  # OpenRouter: what the provider behind it said
    if isinstance(metadata, dict) and isinstance(metadata.get("raw"), str):
        message = f"{message}: {metadata['raw']}"
    return ServerError(message, names, _status(record, names, message), next((float(w[1]) for w in waits if w), None))


def _status(record: dict[str, Any], names: frozenset[str], message: str) -> int | None:
    for name in ("code", "status", "status_code"):
        value = record.get(name)
        if isinstance(value, int | str) and re.fullmatch(r"[45]\d\d", str(value)):
            return int(value)
    known = sorted(_STATUSES[name] for name in names & _STATUSES.keys())
    if known:
        return known[-1]
    return 503 if _OVERLOADED.search(message) else None


def _records(value: Any) -> list[dict[str, Any]]:
    return [one for one in value if isinstance(one, dict)] if isinstance(value, list) else []
