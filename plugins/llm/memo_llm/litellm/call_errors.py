"""Errors of a call, in words a person can act on, and whether a retry may help."""

from __future__ import annotations

import email.utils
import time

from memo_core.interfaces.llm import LanguageModelError, Usage
from memo_llm.litellm.connection import Line

_LONGEST = 400  # characters of what a server said


def problem_of(error: BaseException, line: Line, where: str, reached: bool, key: str) -> LanguageModelError:
    """The error of one call. ``where`` is its destination, ``reached`` whether the server responded at all, ``key`` the
    variable from which its key is read. Only transient errors are retryable: rate limits, server errors, lost
    connections."""
    said = _said(error)
    if line.status is None and (line.connected or line.failed is not None):
        return _without_an_answer(line, where, reached, error)
    status = line.status or getattr(error, "status_code", None)  # litellm's word where the connection was not seen
    if status is None or isinstance(error, TypeError):
        return _error(f"the question to {where} was not sent: {said}")
    if status == 429:
        if "insufficient_quota" in said or "billing" in said.lower():
            return _error(f"{where} refuses: the quota is used up: {said}")
        return _error(f"{where} asks to slow down (429): {said}", True, _seconds(line.retry_after))
    if status >= 500:
        return _error(f"{where} has an error of its own ({status}): {said}", True, _seconds(line.retry_after))
    if status in (401, 403):
        remedy = f"the key in {key}" if key else "no key (set llm.api_key_env to the variable that holds one)"
        return _error(f"{where} refuses {remedy} ({status}): {said}")
    if status >= 400:
        return _error(f"{where} refuses the question ({status}): {said}")
    if line.failed is not None:
        return _error(f"{where} cut the connection in the middle of the answer: {_said(line.failed)}", True)
    return _error(f"{where} sent an answer that cannot be read: {said}")


def _without_an_answer(line: Line, where: str, reached: bool, error: BaseException) -> LanguageModelError:
    if line.failed is not None and not line.connected:
        # A server that was there may come back; an address at which nobody ever answered is probably wrong.
        return _error(f"{where} cannot be reached: {_said(line.failed)}", retryable=reached)
    return _error(f"{where} cut the connection before it answered: {_said(line.failed or error)}", True)


def _error(
    problem: str, retryable: bool = False, retry_after_s: float | None = None, usage: Usage | None = None
) -> LanguageModelError:
    return LanguageModelError("litellm", problem, retryable, retry_after_s, usage)


def _said(error: BaseException) -> str:
    lines = str(error).partition("Traceback (most recent call last)")[0]
    text = " ".join(lines.split()) or type(error).__name__
    while text.startswith("litellm."):  # "litellm.RateLimitError: RateLimitError: OpenAIException - …"
        text = text.partition(":")[2].strip() or type(error).__name__
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def _seconds(header: str) -> float | None:
    """``Retry-After``: seconds, or a date."""
    try:
        return max(0.0, float(header))
    except ValueError:
        pass
    try:
        date = email.utils.parsedate_to_datetime(header)
    except ValueError:
        return None
    return max(0.0, date.timestamp() - time.time())
