"""Ctrl-C in a command that asks models and writes to a book, but moves nothing."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from memo_core.policy.stopping import StopSwitch

INTERRUPTED = 130  # exit code, as of a shell's commands that Ctrl-C ended


@contextmanager
def stopping() -> Iterator[StopSwitch]:
    """A switch that Ctrl-C and SIGTERM press: what is being written is finished first. A second one ends it at once."""
    from memo_core.policy.stopping import StopSwitch

    stop = StopSwitch()

    def press(*_: Any) -> None:
        if stop.pressed:
            raise KeyboardInterrupt
        stop.press()

    before = {number: signal.signal(number, press) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
