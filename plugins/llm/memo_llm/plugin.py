"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

import os
from typing import Any

from memo_core.plugin import Backend, Needs, hookimpl
from memo_llm.litellm.providers import KEYS
from memo_llm.replay.settings import ReplaySettings
from memo_llm.settings import LiteLLMSettings


def _replay(settings: Any) -> Any:
    from memo_llm.replay.model import replay

    return replay(settings)


def _litellm(settings: Any) -> Any:
    from memo_llm.litellm.model import LiteLLMModel

    return LiteLLMModel(settings)


def _key_of(settings: LiteLLMSettings) -> Needs:
    """The key that these settings need; a server of one's own needs none unless they name one."""
    provider = settings.model.partition("/")[0]
    may_hold = () if settings.api_base else KEYS.get(provider, ())
    may_hold = (settings.api_key_env,) if settings.api_key_env else may_hold
    held = [name for name in may_hold if os.environ.get(name)]
    return Needs(keys=(*held, *may_hold)[:1])


@hookimpl
def memo_language_models() -> list[Backend]:
    return [
        Backend(
            kind="llm",
            name="replay",
            summary="records any other backend, or plays a recording back: no network, no cost",
            factory=_replay,
            config=ReplaySettings,
            replays=True,
        ),
        Backend(
            kind="llm",
            name="litellm",
            summary="any provider: Gemini, OpenAI, Anthropic, Ollama, vLLM, OpenAI-compatible servers",
            factory=_litellm,
            config=LiteLLMSettings,
            needs_of=_key_of,
            needs=Needs(
                modules={"litellm": "litellm"},
                optional_keys=("GEMINI_API_KEY", "OPENAI_API_KEY", "ANTHROPIC_API_KEY"),
            ),
        ),
    ]
