"""What a config may set of this distribution's backends."""

from __future__ import annotations

import attrs


@attrs.frozen
class OfflineSettings:
    """Settings of the ``offline`` backend. Both files are documented in docs/offline-backend.md."""

    vocabulary: str = attrs.field(
        default="", metadata={"help": "YAML file of words and phrases; default: the built-in"}
    )
    habits: str = attrs.field(default="", metadata={"help": "YAML file of naive habits; default: the built-in one"})
