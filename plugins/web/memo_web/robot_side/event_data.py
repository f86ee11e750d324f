"""Events as JSON values."""

from __future__ import annotations

from typing import Any

import attrs

from memo_core.plugin import Event

_LEFT_OUT = ("config",)  # of RunStarted: long, and no page shows it
_LONGEST = 20_000  # characters of one text


def event_data(event: Event) -> dict[str, Any]:
    """An event as pages are sent it.

    Args:
        event: an event of a run.

    Returns:
        ``event``: name of its class, and ``data``: its fields; values that are no JSON as text.
    """
    fields = {one.name: getattr(event, one.name) for one in attrs.fields(type(event)) if one.name not in _LEFT_OUT}
    return {"event": type(event).__name__, "data": {name: _plain(value) for name, value in fields.items()}}


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, str):
        return value[:_LONGEST]
    if attrs.has(type(value)):
        return {one.name: _plain(getattr(value, one.name)) for one in attrs.fields(type(value))}
    if isinstance(value, dict):
        return {str(key): _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(one) for one in value]
    return str(value)[:_LONGEST]
