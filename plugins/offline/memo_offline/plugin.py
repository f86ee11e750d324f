"""The backend that this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from typing import Any

from memo_core.plugin import Backend, hookimpl
from memo_offline.settings import OfflineSettings


def _offline(settings: Any) -> Any:
    from memo_offline.model import OfflineModel

    return OfflineModel()


@hookimpl
def memo_language_models() -> list[Backend]:
    return [
        Backend(
            kind="llm",
            name="offline",
            summary="stand-in for a model, by keywords: no network, no cost; regression figures only",
            factory=_offline,
            config=OfflineSettings,
            measured="memo_offline/measured.yaml",
            default=True,
        ),
    ]
