"""The backend that this distribution offers to MEMO. Only declares: nothing heavy is imported here."""

from __future__ import annotations

from typing import Any

from memo_core.plugin import Backend, Needs, hookimpl
from memo_vla.settings import VlaSettings


def _vla(settings: VlaSettings) -> Any:
    from memo_vla.method import Vla

    return Vla(settings)


def _key_of(settings: VlaSettings) -> Needs:
    return Needs(keys=(settings.api_key_env,) if settings.api_key_env else ())


@hookimpl
def memo_methods() -> list[Backend]:
    return [
        Backend(
            kind="method",
            name="vla",
            summary="a vision-language-action policy behind openpi's websocket protocol",
            factory=_vla,
            config=VlaSettings,
            needs=Needs(modules={"websockets": "websockets", "msgpack": "msgpack", "PIL": "pillow"}),
            needs_of=_key_of,
        )
    ]
