"""What a config section of this distribution's vector stores may hold."""

from __future__ import annotations

import attrs


@attrs.frozen
class FaissSettings:
    """A flat index: exact, one thread, in memory."""

    file: str = attrs.field(
        default="", metadata={"help": "keep the index in this file between runs; default: memory only"}
    )
