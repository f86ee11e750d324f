"""Passing a run's events on to the pages, while they are shown."""

from __future__ import annotations

from collections.abc import Callable

from memo_core.plugin import Event, SessionEnded, SessionTask

_LISTENERS: list[Callable[[Event], None]] = []
_SESSION: list[Event] = []  # the last task of a study's session that goes on


def pages_hear(event: Event) -> None:
    """Pass an event on.

    Args:
        event: an event of a run, in the thread that caused it.
    """
    if isinstance(event, SessionTask | SessionEnded):
        _SESSION[:] = [event] if isinstance(event, SessionTask) else []
    for listener in tuple(_LISTENERS):
        listener(event)


def listen(listener: Callable[[Event], None]) -> Callable[[], None]:
    """Have a function called with every event, and first with the last task of a study's session that goes on.

    Args:
        listener: called in the thread that causes the event.

    Returns:
        Function that ends this.
    """
    for event in tuple(_SESSION):  # a session that was resumed says so before any page is there
        listener(event)
    _LISTENERS.append(listener)
    return lambda: _LISTENERS.remove(listener)
