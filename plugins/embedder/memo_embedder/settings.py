"""What a config section of this distribution's embedders may hold."""

from __future__ import annotations

from typing import Literal

import attrs


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
