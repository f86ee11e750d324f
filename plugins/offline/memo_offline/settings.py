"""Settings of the offline backend: none but those that the configs of earlier versions hold."""

from __future__ import annotations

from typing import Any

import attrs

from memo_core.plugin import InvalidArgument


def _empty(_: Any, attribute: Any, value: str) -> None:
    if value:
        raise InvalidArgument(attribute.name, "the offline backend reads no file of one's own any more", "no value")


def _gone() -> Any:
    return attrs.field(default="", validator=_empty, metadata={"help": "no longer used; kept for earlier configs"})


@attrs.frozen
class OfflineSettings:
    """Keys that runs and studies of earlier versions keep in their config, so that those go on."""

    vocabulary: str = _gone()
    habits: str = _gone()
