"""The stop of a run: one switch that everything which takes time listens to (DESIGN 6)."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from memo_core.errors import Stopped

T = TypeVar("T")


class StopSwitch:
    """Latched until released. ``press`` is safe from any thread and from a signal handler: what it calls is quick."""

    def __init__(self) -> None:
        self._pressed = threading.Event()
        self._wakers: tuple[Callable[[], None], ...] = ()
        self._lock = threading.Lock()

    @property
    def pressed(self) -> bool:
        return self._pressed.is_set()

    def press(self) -> None:
        self._pressed.set()
        for waker in self._wakers:  # a tuple that is replaced, never changed: no lock that a handler could wait for
            waker()

    def release(self) -> None:
        self._pressed.clear()

    def check(self, where: str = "") -> None:
        """Raise ``Stopped`` if pressed."""
        if self._pressed.is_set():
            raise Stopped(where)

    @contextmanager
    def waking(self, waker: Callable[[], None]) -> Iterator[None]:
        """Call ``waker`` on a press while the block runs; at once when already pressed."""
        with self._lock:
            self._wakers = (*self._wakers, waker)
        if self.pressed:
            waker()
        try:
            yield
        finally:
            with self._lock:
                rest = list(self._wakers)
                rest.remove(waker)
                self._wakers = tuple(rest)


def abandonable(stop: StopSwitch, where: str, work: Callable[[], T], late: Callable[[T | BaseException], None]) -> T:
    """``work()`` in a thread of its own, given up when the stop is pressed: then ``Stopped`` is raised at once, and
    ``late`` gets the result (or the error) whenever it comes, in that thread."""
    stop.check(where)
    finished = threading.Event()  # set by the work or by the stop, whichever is first
    lock = threading.Lock()
    result: list[T | BaseException] = []
    abandoned = False

    def run() -> None:
        try:
            value: T | BaseException = work()
        except BaseException as error:
            value = error
        with lock:
            result.append(value)
            given_up = abandoned
        finished.set()
        if given_up:
            late(value)

    with stop.waking(finished.set):
        threading.Thread(target=run, name=f"memo-{where}", daemon=True).start()
        finished.wait()
    with lock:
        abandoned = not result
    if abandoned:
        raise Stopped(where)
    if isinstance(result[0], BaseException):
        raise result[0]
    return result[0]
