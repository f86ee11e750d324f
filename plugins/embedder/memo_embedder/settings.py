"""Settings of this distribution's embedders."""

from __future__ import annotations

from typing import Literal

import attrs

from memo_core.plugin import api_base, api_key_env, provider_model


@attrs.frozen
class SentenceTransformersSettings:
    """A sentence-transformers model on the CPU. Nothing is ever downloaded."""

    model: str = attrs.field(
        default="all-MiniLM-L6-v2", metadata={"help": "the packaged model's name, or the folder of another model"}
    )
    runtime: Literal["auto", "onnxruntime", "torch"] = attrs.field(
        default="auto", metadata={"help": "auto: onnxruntime, and torch where the export does not work"}
    )
    cache_dir: str = attrs.field(default="", metadata={"help": "where the export is kept; default: the user's cache"})
    threads: int = attrs.field(default=1, validator=attrs.validators.ge(1), metadata={"help": "threads for one text"})


@attrs.frozen
class LiteLLMEmbedderSettings:
    """Embeddings of a provider, or of a server of one's own. docs/language-models.md shows some."""

    model: str = attrs.field(
        validator=provider_model("provider/model, such as openai/text-embedding-3-small or ollama/nomic-embed-text"),
        metadata={
            "help": "provider/model, as litellm calls them: openai/text-embedding-3-small, ollama/nomic-embed-text"
        },
    )
    api_base: str = api_base()
    api_key_env: str = api_key_env()
    dimensions: int | None = attrs.field(
        default=None,
        validator=attrs.validators.optional(attrs.validators.ge(1)),
        metadata={"help": "length of the vectors, where the model lets one choose; default: the model's own"},
    )
    batch: int = attrs.field(default=64, validator=attrs.validators.ge(1), metadata={"help": "texts in one request"})
    timeout_s: float = attrs.field(
        default=60.0, validator=attrs.validators.gt(0.0), metadata={"help": "seconds after which a request is given up"}
    )
    retries: int = attrs.field(
        default=3,
        validator=attrs.validators.ge(0),
        metadata={"help": "times a request is made again after a rate limit, a server error or a cut connection"},
    )
