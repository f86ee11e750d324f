"""Who owns the signals and the terminal: the main thread. The policy works in a thread of its own (DESIGN 6).

Ctrl-C latches the stop: the arm's last command is sent within one control period, generated code is killed, a pending
model call is given up, and whoever watches is asked what was wrong. A second Ctrl-C within two seconds, or SIGTERM,
ends the run with everything saved; a third leaves at once.
"""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, Generic, Literal, TypeVar

import attrs

from memo_core.errors import Stopped
from memo_core.interfaces.teacher import Episode, Teacher, Verdict
from memo_core.policy.stopping import StopSwitch

T = TypeVar("T")
SECOND_PRESS_S = 2.0
LISTENING_S = 0.02
NOBODY_S = 0.2  # an answer that comes sooner is a program's: whoever pressed stop was not asked


class _PromptInterrupted(BaseException):
    """Thrown out of a teacher's waiting in the main thread by the signal handler."""


@attrs.frozen(eq=False)
class _Question:
    episode: Episode
    kind: Literal["judge", "interrupted", "put back"]
    reply: queue.SimpleQueue[Verdict | bool | BaseException]


@attrs.frozen(eq=False)
class _Ended(Generic[T]):
    value: T | None = None
    error: BaseException | None = None


class Supervisor:
    """Runs work in a worker thread, and in this thread what people are asked and the signals they send."""

    def __init__(self, stop: StopSwitch, teacher: Teacher | None = None) -> None:
        self.stop = stop
        self.teacher = teacher
        self._ending = threading.Event()
        # SimpleQueue may be used from a signal handler, which a Queue with its lock may not.
        self._inbox: queue.SimpleQueue[_Question | _Ended[Any]] = queue.SimpleQueue()
        self._asking = False
        self._last_press = -1e9
        self.presses = 0
        self.prompt_ready: list[float] = []  # monotonic times at which somebody could begin to answer after a stop

    @property
    def ending(self) -> bool:
        """Whether the run is to end rather than go on after the stop."""
        return self._ending.is_set()

    def run(self, work: Callable[[], T]) -> T:
        """``work()`` in a worker thread; its result, or what it raised. Meanwhile questions to the teacher are put and
        signals are answered in this thread."""

        def worker() -> None:
            try:
                self._inbox.put(_Ended(work()))
            except BaseException as error:
                self._inbox.put(_Ended(error=error))

        with self._signals():
            thread = threading.Thread(target=worker, name="memo-policy", daemon=True)
            thread.start()
            while True:
                try:
                    # The system may hand a signal to any thread; this one runs its handler, and must wake for it.
                    message = self._inbox.get(timeout=LISTENING_S)
                except queue.Empty:
                    continue
                if isinstance(message, _Ended):
                    break
                message.reply.put(self._put(message))
            thread.join()
        if message.error is not None:
            raise message.error
        return message.value  # type: ignore[return-value]

    def ask(self, episode: Episode, interrupted: bool) -> Verdict:
        """Put an episode to the teacher; called by the worker. Raises ``Stopped`` when stop is pressed meanwhile."""
        if self.teacher is None:
            return Verdict("silent")
        verdict = self._asked(episode, "interrupted" if interrupted else "judge")
        assert isinstance(verdict, Verdict)
        return verdict

    def put_back(self, episode: Episode) -> bool:
        """Have the teacher put the world back; called by the worker. Raises ``Stopped`` as ``ask``."""
        return self.teacher is not None and bool(self._asked(episode, "put back"))

    def _asked(self, episode: Episode, kind: Literal["judge", "interrupted", "put back"]) -> Verdict | bool:
        reply: queue.SimpleQueue[Verdict | bool | BaseException] = queue.SimpleQueue()
        self._inbox.put(_Question(episode, kind, reply))
        answer = reply.get()
        if isinstance(answer, BaseException):
            raise answer
        return answer

    def press(self) -> None:
        """What Ctrl-C does, for tests and other buttons."""
        now = time.monotonic()
        self.presses += 1
        if now - self._last_press < SECOND_PRESS_S:
            self._ending.set()
        self._last_press = now
        self.stop.press()

    def end(self) -> None:
        """Stop and end the run."""
        self._ending.set()
        self.stop.press()

    # -- in the main thread ----------------------------------------------------------------------------------------
    def _put(self, question: _Question) -> Verdict | bool | BaseException:
        answer: Verdict | bool | BaseException | None = None
        try:
            self._asking = True
            answer = self._answer(question)
            self._asking = False
        except _PromptInterrupted:
            pass
        except Exception as error:
            self._asking = False
            return error
        # Words said just before the signal came are not lost.
        return Stopped("waiting for the person") if answer is None else answer

    def _answer(self, question: _Question) -> Verdict | bool | BaseException:
        assert self.teacher is not None
        if self.ending:
            return Stopped("ending the run")
        if self.stop.pressed and question.kind != "interrupted":
            return Stopped("before the person was asked")
        if question.kind == "put back":
            return self.teacher.put_back(question.episode)
        if question.kind == "judge":
            return self.teacher.judge(question.episode)
        ready = time.monotonic()
        self.prompt_ready.append(ready)
        verdict = self.teacher.interrupted(question.episode)
        if time.monotonic() - ready > NOBODY_S:
            self._last_press = -1e9  # a person answered: the next press is a new stop, not a second one
        return verdict

    @contextmanager
    def _signals(self) -> Iterator[None]:
        if threading.current_thread() is not threading.main_thread():
            yield  # signals belong to the main thread; whoever calls from elsewhere keeps their own
            return
        before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
        # A thread deep in its sums gives way to the one that answers a signal this often: Python's 5 ms add up.
        interval = sys.getswitchinterval()
        sys.setswitchinterval(0.001)
        signal.signal(signal.SIGINT, self._on_interrupt)
        signal.signal(signal.SIGTERM, self._on_terminate)
        try:
            yield
        finally:
            sys.setswitchinterval(interval)
            for number, handler in before.items():
                signal.signal(number, handler)

    def _on_interrupt(self, number: int, frame: FrameType | None) -> None:
        ended_before = self.ending
        self.press()
        if ended_before and self.presses > 2:
            os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, b"\nleft at once\n")
            os._exit(130)
        self._leave_the_prompt()

    def _on_terminate(self, number: int, frame: FrameType | None) -> None:
        self.end()
        self._leave_the_prompt()

    def _leave_the_prompt(self) -> None:
        if self._asking:
            self._asking = False  # once is enough: a second signal must not strike outside of the prompt
            raise _PromptInterrupted
