"""Errors of a call: their cause, in words a person can act on, and whether a retry may help."""

from __future__ import annotations

import email.utils
import re
import time

import attrs

from memo_core.plugin import Cause, LanguageModelError
from memo_llm.litellm.connection import Line
from memo_llm.litellm.server_errors import ServerError, error_in, page_in

_LONGEST = 400  # characters of what a server said
_BUSY = (408, 429)  # besides every 5xx

_FILTER = re.compile(r"content[_ ](management|policy|filter)|responsible_?ai|\bsafety system", re.IGNORECASE)
_KEY = re.compile(
    r"api[_ ]?key[_ ](not valid|invalid|expired)|(invalid|incorrect|missing|no|expired) api[_ ]?key|invalid_api_key",
    re.IGNORECASE,
)
_MODEL = re.compile(
    r"model_not_found|\bmodels?\b.{0,200}\b(not exist|not found|not available|not supported)|"
    r"(no such|unknown|invalid|unsupported|not a valid) model|no endpoints found",
    re.IGNORECASE | re.DOTALL,
)
_MONEY = re.compile(
    r"\b(quota|billing|credits?|balance|funds|payment|prepaid|spend(ing)? (limit|cap))\b", re.IGNORECASE
)
_SPENT = re.compile(
    r"insufficient_quota|billing_(error|not_active|hard_limit_reached)|perday|\blimit: 0(?![\d.])", re.IGNORECASE
)
_WAIT = re.compile(r"\b(retry|try again) (in|after) \d", re.IGNORECASE)


@attrs.frozen
class _Response:
    """A response without a usable answer. ``status`` is that of the error if it came with another one; ``page`` the
    words of a page of something else; ``words`` what is shown to people."""

    status: int
    error: ServerError | None
    page: str | None
    words: str
    retry_after_s: float | None

    @property
    def knows_no_model(self) -> bool:
        """Whether a server of models says that it has none of this name."""
        reported = self.status == 404 and self.error is not None and bool(self.error.names)
        return reported or self.says(_MODEL)

    def says(self, pattern: re.Pattern[str]) -> bool:
        return any(pattern.search(text) for text in (self.words, *(self.error.names if self.error else ())))


def problem_of(
    error: BaseException, line: Line, backend: str, where: str, reached: bool, key: str
) -> LanguageModelError:
    """The error of one call to ``backend``. ``where`` is its destination, ``reached`` whether the server responded at
    all, ``key`` the variable from which its key is read. Only transient errors are retryable: rate limits, server
    errors, lost connections."""
    if line.status is None and (line.connected or line.failed is not None):
        return _without_an_answer(error, line, backend, where, reached)
    response = _response(error, line)
    if response is None or isinstance(error, TypeError):
        return LanguageModelError(backend, f"the question to {where} was not sent: {_said(error)}")
    if response.status < 400 and response.page is None and response.error is None and line.failed is not None:
        lost = f"{where} cut the connection in the middle of the answer: {_said(line.failed)}"
        return LanguageModelError(backend, lost, retryable=True)
    cause = _cause(response)
    problem = f"{where} {_words(cause, response, key)}: {_bounded(response.words)}"
    return LanguageModelError(backend, problem, cause == "busy", response.retry_after_s, cause=cause)


def _without_an_answer(error: BaseException, line: Line, backend: str, where: str, reached: bool) -> LanguageModelError:
    if line.failed is not None and not line.connected:
        # A server that was there may come back; an address at which nobody ever answered is probably wrong.
        problem = f"{where} cannot be reached: {_said(line.failed)}; check llm.api_base, the network and the server"
        return LanguageModelError(backend, problem, retryable=reached, cause="unreachable")
    problem = f"{where} cut the connection before it answered: {_said(line.failed or error)}"
    return LanguageModelError(backend, problem, retryable=True)


def _response(error: BaseException, line: Line) -> _Response | None:
    """None if nothing was sent, and so nothing came back."""
    if line.status is None:
        status = getattr(error, "status_code", None)  # litellm's word where the connection was not seen
        return None if status is None else _Response(status, None, None, _said(error), None)
    plain = line.status < 400 and line.headers.get("content-type", "").startswith("text/plain")
    said, page = error_in(line.begins, line.ends), page_in(line.begins, plain)
    status = line.status if line.status >= 400 or said is None else said.status or line.status
    after = _seconds(line.retry_after)
    after = said.retry_after_s if said is not None and after is None else after
    return _Response(status, said, page, _server_words(line, said, page) or _said(error), after)


def _server_words(line: Line, said: ServerError | None, page: str | None) -> str:
    if page is not None:
        return repr(page)
    if said is not None:
        return said.message
    return line.begins.decode("utf-8", "replace").strip() if line.status is not None and line.status >= 400 else ""


def _cause(response: _Response) -> Cause:
    status = response.status
    if status == 501 and response.page is not None:  # a web server without this method answers alike next time
        return "unreachable"
    if status >= 500 or (status in _BUSY and not _is_spent(response)):
        return "busy"
    if response.page is not None:
        return "unreachable"
    if status < 400:
        return ""
    if response.says(_FILTER):
        return "refusal"
    if status in (402, 429) or (status in (400, 403) and response.says(_MONEY)):
        return "quota"
    if status in (401, 403) or response.says(_KEY) or response.knows_no_model:
        return "access"
    return "unreachable" if status in (404, 405, 407) else ""


def _is_spent(response: _Response) -> bool:
    """Whether a rate limit is a quota that waiting does not refill. Limits per minute are called quotas too, and then
    come with a time to wait."""
    if response.says(_SPENT):
        return True
    waits = response.retry_after_s is not None or response.says(_WAIT)
    return response.status == 429 and response.says(_MONEY) and not waits


def _words(cause: Cause, response: _Response, key: str) -> str:
    """The sentence before the server's own words: the kind of error and what to do about it."""
    status, page = response.status, response.page is not None
    if cause == "busy":
        return f"asks to slow down ({status})" if status == 429 else f"has an error of its own ({status})"
    if cause == "quota":
        return f"refuses, since the quota or the credit is used up ({status}; see the provider's billing page)"
    if cause == "refusal":
        return f"refuses the question: its content filter withheld an answer ({status})"
    if cause == "access" and response.knows_no_model:
        return f"has no such model ({status}; see llm.model)"
    if cause == "access" and key:
        return f"refuses the key in {key} ({status}; export another)"
    if cause == "access":
        return f"refuses a question without a key ({status}; set llm.api_key_env to the variable that holds one)"
    if cause == "unreachable":
        what = "sent a page that cannot be read as an answer" if page else "has no model at this address"
        what += " and does not look like an OpenAI-compatible server" if page else ""
        return f"{what} ({status}; is llm.api_base right, and is no proxy in between?)"
    if status >= 400:
        return f"refuses the question ({status})"
    return "sent an error in place of an answer" if response.error is not None else "sent an answer that cannot be read"


def _said(error: BaseException) -> str:
    lines = str(error).partition("Traceback (most recent call last)")[0]
    text = " ".join(lines.split())
    while text.startswith("litellm."):  # "litellm.RateLimitError: RateLimitError: OpenAIException - …"
        text = text.partition(":")[2].strip()
    return _bounded(text or type(error).__name__)


def _bounded(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST else text[: _LONGEST - 1] + "…"


def _seconds(header: str) -> float | None:
    """``Retry-After``: seconds, or a date."""
    if re.fullmatch(r"\s*\d+(\.\d+)?\s*", header):
        return float(header)
    try:
        date = email.utils.parsedate_to_datetime(header)
    except ValueError:
        return None
    return max(0.0, date.timestamp() - time.time())
