"""Settings of this distribution's backends."""

from __future__ import annotations

from typing import Any, Literal

import attrs

from memo_core.plugin import InvalidArgument, api_base, api_key_env, close_match, provider_model
from memo_llm.litellm.providers import known_providers

# Said elsewhere in the section, or decided by MEMO, or secret.
_NOT_OPTIONS = {
    "api_base": "llm.api_base",
    "api_key": "the environment variable named by llm.api_key_env",
    "base_url": "llm.api_base",
    "max_retries": "run.retries",
    "max_tokens": "llm.max_answer_tokens",
    "messages": "",
    "model": "llm.model",
    "n": "",
    "num_retries": "run.retries",
    "response_format": "llm.schema",
    "seed": "the experiment's seed",
    "stream": "llm.stream",
    "temperature": "llm.temperature",
    "timeout": "llm.timeout_s",
}


def _free_options(_: Any, __: Any, options: dict[str, Any]) -> None:
    for name in options:
        if name in _NOT_OPTIONS:
            place = _NOT_OPTIONS[name]
            raise InvalidArgument("options", f"{name!r} may not be given here", place or "other options")


_MODEL = (
    "provider/model, such as gemini/gemini-3-flash-preview or openai/gpt-5; for any server that speaks OpenAI's "
    "protocol openai/MODEL with its address in api_base"
)


_MAKERS = {"claude": "anthropic", "google": "gemini", "gpt": "openai", "grok": "xai"}  # of models called like that


def _known_provider(_: Any, field: attrs.Attribute[str], model: str) -> None:
    provider, known = model.partition("/")[0], known_providers()
    if known and provider not in known:
        meant = close_match(_MAKERS.get(provider.lower(), provider), known)
        raise InvalidArgument(field.name, f"litellm knows no provider {provider!r}{meant}", _MODEL)


_not_negative = attrs.validators.optional(attrs.validators.ge(0.0))


@attrs.frozen
class LiteLLMSettings:
    """Settings of the ``litellm`` backend. docs/language-models.md shows the providers."""

    model: str = attrs.field(
        validator=[provider_model(_MODEL), _known_provider],
        metadata={
            "help": "provider/model, as litellm calls them: gemini/gemini-3-flash-preview, openai/…, ollama_chat/…"
        },
    )
    api_base: str = api_base()
    api_key_env: str = api_key_env()
    timeout_s: float = attrs.field(
        default=120.0,
        validator=attrs.validators.gt(0.0),
        metadata={"help": "seconds after which a call is given up, all of it: connecting, waiting and receiving"},
    )
    max_concurrent: int = attrs.field(
        default=4, validator=attrs.validators.ge(1), metadata={"help": "calls under way at a time; others wait"}
    )
    temperature: float | None = attrs.field(
        default=None, validator=_not_negative, metadata={"help": "default: the provider's own"}
    )
    max_answer_tokens: int | None = attrs.field(
        default=None,
        validator=attrs.validators.optional(attrs.validators.ge(1)),
        metadata={"help": "most tokens of an answer; default: the provider's own"},
    )
    schema: Literal["auto", "off"] = attrs.field(
        default="auto",
        metadata={
            "help": "auto: send the answer's JSON Schema, in words where the server does not take it; off: in words"
        },
    )
    stream: bool = attrs.field(default=True, metadata={"help": "show answers as they are written, on a terminal"})
    prompt_price: float | None = attrs.field(
        default=None, validator=_not_negative, metadata={"help": "US dollars a million tokens; default: litellm's list"}
    )
    completion_price: float | None = attrs.field(
        default=None, validator=_not_negative, metadata={"help": "US dollars a million tokens; default: litellm's list"}
    )
    cached_price: float | None = attrs.field(
        default=None,
        validator=_not_negative,
        metadata={
            "help": "US dollars a million prompt tokens read from the provider's cache; default: litellm's list, or "
            "prompt_price where that is set"
        },
    )
    options: dict[str, Any] = attrs.field(
        factory=dict,
        validator=_free_options,
        metadata={"help": "further arguments of litellm.completion, such as reasoning_effort or api_version"},
    )

    def __attrs_post_init__(self) -> None:
        if (self.prompt_price is None) != (self.completion_price is None):
            raise InvalidArgument("prompt_price", "one price without the other", "prompt_price and completion_price")
        if self.cached_price is not None and self.prompt_price is None:
            expected = "cached_price with prompt_price and completion_price"
            raise InvalidArgument("cached_price", "a price of cached tokens without the other prices", expected)
