"""Passing a run's events on to the pages, while they are shown."""

from __future__ import annotations

from collections.abc import Callable

from memo_core.plugin import Event

_LISTENERS: list[Callable[[Event], None]] = []


def pages_hear(event: Event) -> None:
    """Pass an event on.

    Args:
        event: an event of a run, in the thread that caused it.
    """
    for listener in tuple(_LISTENERS):
        listener(event)


def listen(listener: Callable[[Event], None]) -> Callable[[], None]:
    """Have a function called with every event.

    Args:
        listener: called in the thread that causes the event.

    Returns:
        Function that ends this.
    """
    _LISTENERS.append(listener)
    return lambda: _LISTENERS.remove(listener)
