"""The backend: each call has a time limit, can be abandoned, and reports its cost."""

from __future__ import annotations

import os
import queue
import threading
import time
from collections.abc import Callable
from typing import Any

import attrs

from memo_core.plugin import (
    Answer,
    BackendUnavailable,
    Cause,
    InvalidArgument,
    LanguageModel,
    LanguageModelError,
    Redactor,
    Request,
    Usage,
)
from memo_llm.litellm.call_errors import problem_of
from memo_llm.litellm.connection import Line
from memo_llm.litellm.conversion import (
    Spoken,
    ending_note,
    messages_of,
    read_body,
    read_stream,
    read_whole,
    response_format,
)
from memo_llm.litellm.library import quiet_litellm, warm_up
from memo_llm.litellm.server_errors import counts_tokens, end_reason, error_in, refusal_in
from memo_llm.settings import LiteLLMSettings

_POLL_S = 0.02  # how soon a call that nobody wants any more is cut
_LOCAL = ("ollama", "ollama_chat", "hosted_vllm", "lm_studio", "llamafile", "xinference", "docker_model_runner")
# Providers of Claude, which caches marked messages only. For Gemini litellm would make a paid cache of them.
_MARKED = ("anthropic", "azure_ai", "bedrock", "databricks", "openrouter", "vertex_ai")
_REJECTED = (400, 415, 422, 501)  # what servers say to a field that they do not know
_UNSUPPORTED = {  # options that a server turned out not to have, for people
    "schema": "the server rejects it, so the form of an answer is described in words",
    "stream": "the server answers whole, or does not end its streams properly",
    "usage": "the server does not count tokens, so they are estimated",
}
_NO_KEY = "none"  # what a server of one's own is sent where no key is set; clients insist on one


@attrs.frozen
class _Manner:
    """The options of a request: schema for the server, streaming, token count at the end of the stream."""

    schema: bool
    stream: bool
    count: bool


class LiteLLMModel(LanguageModel):
    """Asks a provider through litellm. Never retries: the caller decides about that. A call runs in its own thread, so
    that ``timeout_s`` bounds all of it; the connection of an abandoned call is closed.
    """

    def __init__(self, settings: LiteLLMSettings) -> None:
        self.name = settings.model
        self._settings = settings
        self._litellm: Any = None
        self._provider = ""
        self._key = ""
        self._key_variable = ""
        self._redact = Redactor()
        self._turns = threading.BoundedSemaphore(settings.max_concurrent)
        self._reached = False  # whether the server ever answered
        self._refused: set[str] = set()  # of a manner's fields: what this server does not take; and "usage"

    # -- opening -------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Imports litellm without network access. Raises ``InvalidArgument`` for a model of an unknown provider,
        ``BackendUnavailable``, which names the variable, if the key is missing."""
        if self._litellm is not None:
            return
        litellm = quiet_litellm()
        settings = self._settings
        try:
            _, self._provider, _, _ = litellm.get_llm_provider(settings.model, api_base=settings.api_base or None)
        except Exception:
            said = f"litellm does not know {settings.model!r}"
            raise InvalidArgument("llm.model", said, "provider/model as litellm calls them") from None
        self._find_key(litellm)
        self._redact = Redactor.of_environment([self._key_variable] if self._key_variable else [])
        warm_up(litellm, settings.model)
        self._litellm = litellm

    def close(self) -> None:
        self._litellm = None
        self._refused.clear()

    def _find_key(self, litellm: Any) -> None:
        settings = self._settings
        if settings.api_key_env:
            self._key, self._key_variable = os.environ.get(settings.api_key_env, ""), settings.api_key_env
            if not self._key:
                raise self._no_key(settings.api_key_env)
            return
        said = litellm.validate_environment(settings.model)
        missing = [name for name in said["missing_keys"] if name.endswith(("_KEY", "_TOKEN"))]
        if not missing:
            self._key_variable = f"{self._provider.upper()}_API_KEY"
            self._key_variable = self._key_variable if os.environ.get(self._key_variable) else ""
        elif settings.api_base or self._provider in _LOCAL:
            self._key = _NO_KEY
        else:
            usual = f"{self._provider.upper()}_API_KEY"
            raise self._no_key(usual if usual in missing else missing[0])

    def _no_key(self, variable: str) -> BackendUnavailable:
        return BackendUnavailable(
            "llm", "litellm", f"{self.name} needs a key and {variable} is not set", f"export {variable}=…"
        )

    # -- cost ----------------------------------------------------------------------------------------------------------
    def unpriced(self) -> str:
        if self._cost(Usage(1, 1), None) is not None:
            return ""
        return f"litellm's list has no price of {self.name}; set llm.prompt_price and llm.completion_price"

    def expected_cost(self, usage: Usage) -> float | None:
        return self._cost(usage, None)

    def _cost(self, usage: Usage, raw: Any) -> float | None:
        """US dollars; None if the price is unknown."""
        settings = self._settings
        if settings.prompt_price is not None and settings.completion_price is not None:
            cached_price = settings.prompt_price if settings.cached_price is None else settings.cached_price
            dollars = (usage.prompt_tokens - usage.cached_tokens) * settings.prompt_price
            dollars += usage.cached_tokens * cached_price + usage.completion_tokens * settings.completion_price
            return dollars / 1e6
        if self._provider in _LOCAL:
            return 0.0
        try:
            model, _, _, _ = self._litellm.get_llm_provider(self.name)
            prompt, completion = self._litellm.cost_per_token(
                model=model,
                custom_llm_provider=self._provider,
                prompt_tokens=usage.prompt_tokens,
                completion_tokens=usage.completion_tokens,
                usage_object=raw,
            )
        except Exception:  # litellm raises a plain Exception for a model that is not on its list
            return None
        if not prompt + completion and not self._listed_as_free(model):
            return None  # on the list, but without a price: litellm says 0 then
        return float(prompt + completion)

    def _listed_as_free(self, model: str) -> bool:
        prices = self._litellm.model_cost
        return "input_cost_per_token" in (prices.get(f"{self._provider}/{model}") or prices.get(model) or {})

    def _usage(self, request: Request, spoken: Spoken, took: float) -> Usage:
        raw = spoken.usage
        asked = getattr(raw, "prompt_tokens", 0) or _about(sum(len(message.text) for message in request.messages))
        said = getattr(raw, "completion_tokens", 0) or _about(len(spoken.words))
        cached = getattr(getattr(raw, "prompt_tokens_details", None), "cached_tokens", 0) or 0
        usage = Usage(max(1, asked), said, None, took, min(cached, max(1, asked)))
        return attrs.evolve(usage, cost=self._cost(usage, raw))

    # -- answering -----------------------------------------------------------------------------------------------------
    def answer(
        self,
        request: Request,
        on_text: Callable[[str], None] | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Answer:
        """See the interface. ``timeout_s`` starts when the call leaves the queue (``max_concurrent``)."""
        if self._litellm is None:
            raise LanguageModelError(self.name, "it has not been opened")
        if not request.messages:
            raise LanguageModelError(self.name, "nothing was asked")
        cancelled = cancelled or (lambda: False)
        while not self._turns.acquire(timeout=_POLL_S):
            if cancelled():
                raise LanguageModelError(self.name, "given up while it waited for its turn")
        return self._in_its_own_thread(request, on_text, cancelled)

    def _in_its_own_thread(
        self, request: Request, on_text: Callable[[str], None] | None, cancelled: Callable[[], bool]
    ) -> Answer:
        started = time.monotonic()
        end = started + self._settings.timeout_s
        line, spoken = Line(end), Spoken()
        news: queue.SimpleQueue[str | Answer | Exception] = queue.SimpleQueue()
        streaming = on_text is not None and self._settings.stream

        def work() -> None:
            try:
                with line:
                    news.put(self._put(request, line, spoken, news.put if streaming else None, started))
            except Exception as error:
                news.put(error)
            finally:
                self._turns.release()  # a call that was given up counts as long as its connection lives

        threading.Thread(target=work, name="memo-litellm", daemon=True).start()
        shown = self._redact.pieces(on_text or (lambda piece: None))
        while True:
            try:
                told = news.get(timeout=max(0.0, min(_POLL_S, end - time.monotonic())))
            except queue.Empty:
                told = ""
            if isinstance(told, Answer):
                shown.end()
                self._reached = True
                return told
            late = time.monotonic() >= end
            if isinstance(told, Exception):
                if not late:
                    raise self._problem(told, line, request, spoken, started) from None
            elif told:
                shown(told)
            if cancelled():
                line.cut()
                given_up = self._error("given up: its answer is not wanted any more")
                raise self._lost(given_up, line, request, spoken, started)
            if late:
                line.cut()
                raise self._lost(self._too_late(), line, request, spoken, started)

    def _put(
        self, request: Request, line: Line, spoken: Spoken, on_piece: Callable[[str], None] | None, started: float
    ) -> Answer:
        """In the worker thread: ask with the best options that the server accepts. Rejected options are remembered
        while this is open."""
        streaming = on_piece is not None and "stream" not in self._refused
        manners = self._manners(request, streaming)
        for manner in manners:
            line.reset()
            problem = self._ask(request, manner, line, spoken, on_piece)
            as_json = line.status == 200 and "json" in line.headers.get("content-type", "")
            if manner.stream and as_json and not spoken.words and error_in(line.begins) is None:
                self._refused.add("stream")  # it answered, but not as a stream
                if not read_body(line.begins, spoken):
                    return self._put(request, line, spoken, None, started)
                problem = None
            if problem is None:
                self._refused |= {
                    what for what in ("schema", "count") if getattr(manners[0], what) > getattr(manner, what)
                }
                break
            if manner == manners[-1] or line.status not in _REJECTED or spoken.words:
                raise problem
        took = time.monotonic() - started
        if not counts_tokens(line.begins, line.ends):
            self._refused.add("usage")
        text = self._redact(spoken.words)
        note = self._redact(ending_note(spoken, end_reason(line.ends), self._settings.max_answer_tokens))
        return Answer(text, spoken.ended, self._usage(request, spoken, took), spoken.model or self.name, note=note)

    def _manners(self, request: Request, streaming: bool) -> tuple[_Manner, ...]:
        """The options to try, best first; if the server rejects one, the next is tried."""
        schema = (
            request.response_schema is not None
            and self._settings.schema == "auto"
            and "schema" not in self._refused
            and self._may_take_schemas
        )
        count = streaming and "count" not in self._refused
        return tuple(
            _Manner(with_schema, streaming, with_count)
            for with_schema in ((True, False) if schema else (False,))
            for with_count in ((True, False) if count else (False,))
        )

    @property
    def _may_take_schemas(self) -> bool:
        """Whether litellm sends schemas to the provider."""
        return "response_format" in (self._litellm.get_supported_openai_params(self._model(), self._provider) or ())

    def unsupported(self) -> dict[str, str]:
        found = {name: reason for name, reason in _UNSUPPORTED.items() if name in self._refused}
        if self._settings.schema == "off":
            found["schema"] = "llm.schema is off"
        elif not self._may_take_schemas:
            found["schema"] = f"litellm sends none to {self._provider}"
        if not self._settings.stream:
            found["stream"] = "llm.stream is false"
        return found

    def _ask(
        self, request: Request, manner: _Manner, line: Line, spoken: Spoken, on_piece: Callable[[str], None] | None
    ) -> Exception | None:
        """Ask once; the answer goes into ``spoken``, an error is returned."""
        settings = self._settings
        given: dict[str, Any] = {
            "model": settings.model,
            "messages": messages_of(request, not manner.schema, self._needs_cache_marks),
            "stream": manner.stream,
            "timeout": settings.timeout_s,
            "num_retries": 0,
            "max_retries": 0,
            **settings.options,
        }
        for name, value in (
            ("api_base", settings.api_base or None),
            ("api_key", self._key or None),
            ("temperature", settings.temperature),
            ("max_tokens", settings.max_answer_tokens),
            ("seed", request.seed),
            ("response_format", response_format(request) if manner.schema else None),
            ("stream_options", {"include_usage": True} if manner.count else None),
        ):
            if value is not None:
                given[name] = value
        try:
            response = self._litellm.completion(**given)
            if manner.stream:
                gave_reason = read_stream(response, spoken, on_piece or (lambda piece: None))
                spoken.refusal = spoken.refusal or refusal_in(line.ends)
                if not gave_reason and not end_reason(line.ends):  # litellm misses one that comes with text
                    self._check_whole(spoken, line)
            else:
                read_whole(response, spoken)
        except Exception as error:
            if isinstance(error, ConnectionError):
                line.failed = error
            return error
        return None

    def _check_whole(self, spoken: Spoken, line: Line) -> None:
        """Raise ``ConnectionError`` if a stream that gave no reason for its end may have been cut. Some servers never
        give any, so this one is asked for whole answers from then on."""
        if not line.done:
            self._refused.add("stream")
            raise ConnectionError("the stream ended without saying that the answer is complete")
        if not spoken.words:
            raise ValueError("it holds no choices")

    # -- what went wrong -----------------------------------------------------------------------------------------------
    def _model(self) -> str:
        return self.name.partition("/")[2]

    @property
    def _needs_cache_marks(self) -> bool:
        """Whether the provider caches only what is marked."""
        claude = self._provider in _MARKED and "claude" in self._model()
        return claude and bool(self._litellm.utils.supports_prompt_caching(self._model(), self._provider))

    def _where(self) -> str:
        return f"{self._provider} at {self._settings.api_base}" if self._settings.api_base else self._provider

    def _problem(
        self, error: Exception, line: Line, request: Request, spoken: Spoken, started: float
    ) -> LanguageModelError:
        if isinstance(error, LanguageModelError):
            return error
        problem = problem_of(error, line, self.name, self._where(), self._reached, self._key_variable)
        self._reached = self._reached or line.status is not None
        return self._lost(problem, line, request, spoken, started)

    def _lost(
        self, error: LanguageModelError, line: Line, request: Request, spoken: Spoken, started: float
    ) -> LanguageModelError:
        """The error for an incomplete answer, with the probable cost of what was sent and received."""
        if line.sent and (line.status is None or line.status < 300):
            error.usage = self._usage(request, spoken, time.monotonic() - started)
        error.problem = self._redact(error.problem)
        return error

    def _too_late(self) -> LanguageModelError:
        limit = self._settings.timeout_s
        said = f"{self._where()} did not finish within llm.timeout_s ({limit:g} s); raise it for a slow model"
        return self._error(said, "timeout")

    def _error(self, problem: str, cause: Cause = "") -> LanguageModelError:
        return LanguageModelError(self.name, problem, cause=cause)


def _about(characters: int) -> int:
    """Estimated tokens if the server reports none: about four characters each."""
    return characters // 4
