"""Passing a run's events on to the pages, while they are shown."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

import attrs

from memo_core.plugin import Event, SessionEnded, SessionTask


@attrs.frozen
class Reworded(Event):
    """A person said in other words what notes were made of, or could not be made of. Only pages receive this event."""

    who: str
    words: str


_LISTENERS: list[Callable[[Event], None]] = []
_RECENT: deque[Event] = deque(maxlen=50)  # of the run that began last: a server may be started after its first events

_SESSION: list[tuple[float, SessionTask]] = []  # the last task of a study's session that goes on, and when it began


def pages_hear(event: Event) -> None:
    """Pass an event on.

    Args:
        event: an event of a run, in the thread that caused it.
    """
    if isinstance(event, SessionTask):
        _SESSION[:] = [(time.time(), event)]
    elif isinstance(event, SessionEnded):
        _SESSION.clear()
    if type(event).__name__ in ("RunStarted", "RunResumed"):
        _RECENT.clear()
    _RECENT.append(event)
    for listener in tuple(_LISTENERS):
        listener(event)


def listen(listener: Callable[[Event], None], recent: bool = False) -> Callable[[], None]:
    """Have a function called with every event.

    Args:
        listener: called in the thread that causes the event.
        recent: call it now with the events of the run that began last, the last 50 at most.

    Returns:
        Function that ends this.
    """
    for event in tuple(_RECENT) if recent else ():
        listener(event)
    _LISTENERS.append(listener)
    return lambda: _LISTENERS.remove(listener)


def session_task() -> tuple[float, SessionTask] | None:
    """The last task of a study's session that goes on: a resumed session announces it before there is any server.

    Returns:
        When it was announced (s since the epoch), and the event; None if no session goes on.
    """
    return _SESSION[0] if _SESSION else None
