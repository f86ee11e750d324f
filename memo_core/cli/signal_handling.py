"""Stops of a command: Ctrl-C, SIGTERM, and SIGHUP of a terminal that was closed.

Imported before anything else, because signals are handled from then on; so it imports little itself.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from memo_core.process.stop_switch import StopSwitch

STOPS = (signal.SIGINT, signal.SIGTERM, *((signal.SIGHUP,) if hasattr(signal, "SIGHUP") else ()))
_MOMENT_S = 0.01
INTERRUPTED = 130  # exit code, as of a shell's commands that Ctrl-C ended


@contextmanager
def stopping() -> Iterator[StopSwitch]:
    """A switch that a signal presses, so that a write in progress is finished first. A second signal raises
    ``Interrupt``."""
    from memo_core.process.stop_switch import StopSwitch

    stop, interrupt = StopSwitch(), Interrupt()

    def press(*_: Any) -> None:
        if stop.pressed:
            interrupt()
        stop.press()

    with handling(press):
        yield stop


class Interrupt:
    """A signal handler: the first signal unwinds the command through all its clean-up, which a second one does not
    interrupt; a third exits at once."""

    raised_last: Interrupt | None = None  # whose ``KeyboardInterrupt`` was the last

    def __init__(self) -> None:
        self._signals = 0
        self._over = False
        self.raised = False  # whether it took the command back

    def __call__(self, *_: Any) -> None:
        self._signals += 1
        if self._signals == 1 and not self._over:
            self.raised = True
            Interrupt.raised_last = self
            raise KeyboardInterrupt
        if self._signals > 2:
            os._exit(INTERRUPTED)

    def raise_again(self) -> None:
        """A moment later, as from a signal: the exception was dropped."""
        self._signals -= 1
        threading.Timer(_MOMENT_S, os.kill, (os.getpid(), signal.SIGINT)).start()

    def over(self) -> None:
        """The command has ended, so a signal has nothing left to interrupt."""
        self._over = True


@contextmanager
def never_lost() -> Iterator[None]:
    """Within the block, an ``Interrupt`` that came in a finalizer or in the callback of a weak reference, where Python
    drops exceptions with a traceback, is raised again instead. Imports have such callbacks."""
    before = sys.unraisablehook

    def dropped(what: sys.UnraisableHookArgs) -> None:
        interrupt, Interrupt.raised_last = Interrupt.raised_last, None
        if isinstance(what.exc_value, KeyboardInterrupt) and interrupt is not None:
            interrupt.raise_again()
        else:
            Interrupt.raised_last = interrupt
            before(what)

    sys.unraisablehook = dropped
    try:
        yield
    finally:
        sys.unraisablehook = before


def ignore() -> None:
    """Ignore all signals from here on; Python's shutdown would restore their default action."""
    for number in STOPS:
        signal.signal(number, signal.SIG_IGN)


class handling:
    """Install ``handler`` for all signals that stop a command, until the block ends; outside the main thread nothing is
    changed. A class, because a generator restores the handlers also when it is only forgotten: a process that ends by
    ``sys.exit`` would get the default actions back before its shutdown is over, and be killed by a late signal."""

    def __init__(self, handler: Callable[..., None]) -> None:
        self._handler = handler
        self._before: dict[signal.Signals, Any] = {}

    def __enter__(self) -> None:
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._handler) for number in STOPS}

    def __exit__(self, *_: object) -> None:
        for number, one in self._before.items():
            signal.signal(number, one)
