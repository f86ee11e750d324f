"""The stop switch of a run, polled by everything that takes time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from memo_core.errors import Stopped
from memo_core.process.signal_safe import Flag, Wake

T = TypeVar("T")


class StopSwitch:
    """Latched until released. ``press`` may be called from any thread and from a signal handler; its callbacks must be
    quick."""

    def __init__(self) -> None:
        self._pressed = Flag()
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
    """Run work in its own thread and abandon it when the stop is pressed.

    Args:
        stop: switch that ends the wait.
        where: activity that a stop interrupts, for the message.
        work: called in a thread of its own.
        late: called in that thread with the late result or error of abandoned work.

    Returns:
        The result of ``work``.

    Raises:
        Stopped: as soon as the stop is pressed, whatever the work does.
        BaseException: what ``work`` raises.
    """
    stop.check(where)
    finished = Wake()  # set by the work or by the stop, whichever is first
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


class Leaving:
    """Work that ends by itself after a stop, but perhaps not immediately, such as motion planning. After a short wait
    it is abandoned: it finishes in the background and its result is discarded. Call ``wait`` before anything may move
    again."""

    GRACE_S = 0.015

    def __init__(self, stop: StopSwitch) -> None:
        self._stop = stop
        self._left: threading.Thread | None = None

    def do(self, where: str, work: Callable[[], T]) -> T:
        """Run ``work()`` in its own thread; returns its result or raises its error. After a stop it has a short time to
        end, then ``Stopped`` is raised and its result is discarded."""
        self.wait()
        self._stop.check(where)
        news, ended = Wake(), threading.Event()
        result: list[T | BaseException] = []

        def run() -> None:
            try:
                result.append(work())
            except BaseException as error:
                result.append(error)
            ended.set()
            news.set()

        thread = threading.Thread(target=run, name=f"memo-{where}", daemon=True)
        with self._stop.waking(news.set):
            thread.start()
            news.wait()  # for its end, or for a stop
        if not ended.wait(self.GRACE_S):
            self._left = thread
            raise Stopped(where)
        if isinstance(result[0], BaseException):
            raise result[0]
        return result[0]

    @property
    def busy(self) -> bool:
        """Whether abandoned work is still running and using its resources."""
        return self._left is not None and self._left.is_alive()

    def wait(self) -> None:
        """Wait until abandoned work has ended."""
        left, self._left = self._left, None
        if left is not None:
            left.join()
