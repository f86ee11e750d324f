"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from typing import Any

from memo_core.hooks import hookimpl
from memo_core.interfaces.backend import Backend, Needs
from memo_llm.replay.settings import ReplaySettings
from memo_llm.settings import LiteLLMSettings, OfflineSettings


def _offline(settings: Any) -> Any:
    from memo_llm.offline.model import OfflineModel

    return OfflineModel(settings)


def _replay(settings: Any) -> Any:
    from memo_llm.replay.model import replay

    return replay(settings)


def _litellm(settings: Any) -> Any:
    from memo_llm.litellm.model import LiteLLMModel

    return LiteLLMModel(settings)


@hookimpl
def memo_language_models() -> list[Backend]:
    return [
        Backend(
            kind="llm",
            name="offline",
            summary="rule-based reader of the prompts: no network, no cost; regression figures only",
            factory=_offline,
            config=OfflineSettings,
            measured="memo_llm/measured/offline.yaml",
            default=True,
        ),
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
            needs=Needs(
                modules={"litellm": "litellm"},
                optional_keys=("GEMINI_API_KEY", "OPENAI_API_KEY", "ANTHROPIC_API_KEY"),
            ),
        ),
    ]
