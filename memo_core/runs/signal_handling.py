"""Ctrl-C and other signals of a run: the main thread owns the signals and the terminal, the policy runs in another
thread.

Ctrl-C latches the stop: the arm's last command is sent within one control period, generated code is killed, a pending
model call is abandoned, and the teacher is asked what was wrong. A second Ctrl-C within two seconds, SIGTERM, or SIGHUP
of a terminal that was closed ends the run with everything saved; a third Ctrl-C leaves at once.
"""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any, Generic, TypeVar

import attrs

from memo_core.errors import Stopped
from memo_core.interfaces.teacher import Episode, Noted, Program, Proposal, ReadBack, TaskEpisode, Teacher, Verdict
from memo_core.process.signal_safe import Flag
from memo_core.process.stop_switch import StopSwitch

T = TypeVar("T")
SECOND_PRESS_S = 2.0
LISTENING_S = 0.02
NOBODY_S = 0.2  # an answer that comes sooner is a program's: whoever pressed stop was not asked

_ENDING = (signal.SIGTERM, *((signal.SIGHUP,) if hasattr(signal, "SIGHUP") else ()))


class _PromptInterrupted(KeyboardInterrupt):
    """Raised by the signal handler in the main thread while a teacher waits for input."""


@attrs.frozen(eq=False)
class _Question:
    put: Callable[[Teacher], Any]
    after_a_stop: bool
    reply: queue.SimpleQueue[Any]  # the answer, or an exception to raise


@attrs.frozen(eq=False)
class _Ended(Generic[T]):
    value: T | None = None
    error: BaseException | None = None


class Supervisor:
    """Runs work in a worker thread, and handles questions to people and signals in this thread. ``attended``: the run
    is one of a study. It ends when the teacher has left, and with a simulated teacher, whom a stop says nothing, at the
    first Ctrl-C. Any run ends at the first Ctrl-C if there is no person to say what was wrong."""

    def __init__(self, stop: StopSwitch, teacher: Teacher | None = None, attended: bool = False) -> None:
        self.stop = stop
        self.teacher = teacher
        self.attended = attended
        self._ending = Flag()
        # SimpleQueue may be used from a signal handler, which a Queue with its lock may not.
        self._inbox: queue.SimpleQueue[_Question | _Ended[Any]] = queue.SimpleQueue()
        self._asking = False
        self._last_press = -1e9
        self.presses = 0
        self.ended_by_signal = False  # rather than by the teacher, such as a button on a page
        self.ending_signal = ""  # name of the one, other than Ctrl-C, that ended the run
        self.prompt_ready: list[float] = []  # monotonic times at which somebody could begin to answer after a stop

    @property
    def ending(self) -> bool:
        """Whether the run is to end rather than continue after the stop."""
        return self._ending.is_set()

    def run(self, work: Callable[[], T]) -> T:
        """Run ``work()`` in a worker thread and return its result or raise its error. In the meantime this thread asks
        the teacher and handles signals."""

        def worker() -> None:
            try:
                self._inbox.put(_Ended(work()))
            except BaseException as error:
                self._inbox.put(_Ended(error=error))

        with self.signals():
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
        if interrupted:
            return self._asked(lambda teacher: teacher.interrupted(episode), after_a_stop=True)
        return self._asked(lambda teacher: teacher.judge(episode))

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        """The teacher's verdict on the whole task. Raises ``Stopped`` as ``ask``."""
        return self._asked(lambda teacher: teacher.judge_task(episode))

    def judge_plan(self, proposal: Proposal) -> Verdict:
        """The teacher's verdict on the planned subtask. Raises ``Stopped`` as ``ask``."""
        return self._asked(lambda teacher: teacher.judge_plan(proposal))

    def read_back(self, noted: Noted) -> ReadBack:
        """The teacher's reaction to the notes made of their words. Raises ``Stopped`` as ``ask``."""
        return self._asked(lambda teacher: teacher.read_back(noted))

    def permit(self, program: Program) -> Verdict:
        """Whether the teacher permits a program to move a real robot. Raises ``Stopped`` as ``ask``."""
        return self._asked(lambda teacher: teacher.permit(program))

    def put_back(self, episode: Episode) -> bool:
        """Ask the teacher to put the scene back; called by the worker. Raises ``Stopped`` as ``ask``."""
        return self.teacher is not None and self._asked(lambda teacher: teacher.put_back(episode))

    def confirm(self, episode: Episode) -> bool:
        """Ask the teacher to confirm the present scene; called by the worker. Raises ``Stopped`` as ``ask``."""
        return self.teacher is not None and self._asked(lambda teacher: teacher.confirm(episode))

    def _asked(self, put: Callable[[Teacher], T], after_a_stop: bool = False) -> T:
        reply: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._inbox.put(_Question(put, after_a_stop, reply))
        answer = reply.get()
        if isinstance(answer, BaseException):
            raise answer
        return answer  # type: ignore[no-any-return]

    def press(self) -> None:
        """The effect of Ctrl-C, for tests and other buttons."""
        now = time.monotonic()
        self.presses += 1
        nobody = self.attended and self.teacher is not None and self.teacher.simulated
        if nobody or now - self._last_press < SECOND_PRESS_S:
            self._ending.set()
        self._last_press = now
        self.stop.press()

    def end(self) -> None:
        """Stop and end the run."""
        self._ending.set()
        self.stop.press()

    # -- in the main thread ----------------------------------------------------------------------------------------
    def _put(self, question: _Question) -> Any:
        answer: Any = None
        try:
            self._asking = True
            answer = self._answer(question)
            self._asking = False
        except _PromptInterrupted:
            pass
        except Exception as error:
            self._asking = False
            return error
        if self.attended and self.teacher is not None and self.teacher.left:
            self.end()
            return Stopped("waiting for the person, who has left")
        # Words said just before the signal came are not lost.
        return Stopped("waiting for the person") if answer is None else answer

    def _answer(self, question: _Question) -> Any:
        assert self.teacher is not None
        if self.ending:
            return Stopped("ending the run")
        if not question.after_a_stop:
            return Stopped("before the person was asked") if self.stop.pressed else question.put(self.teacher)
        ready = time.monotonic()
        self.prompt_ready.append(ready)
        verdict = question.put(self.teacher)
        if time.monotonic() - ready > NOBODY_S:
            self._last_press = -1e9  # a person answered: the next press is a new stop, not a second one
        if self.teacher.simulated and verdict.kind == "silent":
            self.end()
            return Stopped("ending the run: there is nobody to say what was wrong")
        return verdict

    @contextlib.contextmanager
    def signals(self) -> Iterator[None]:
        """Handle signals in this block, also while the summary is written, which no signal may interrupt."""
        if threading.current_thread() is not threading.main_thread():
            yield  # signals belong to the main thread; whoever calls from elsewhere keeps their own
            return
        before = {number: signal.getsignal(number) for number in (signal.SIGINT, *_ENDING)}
        # A thread deep in its sums gives way to the one that answers a signal this often: Python's 5 ms add up.
        interval = sys.getswitchinterval()
        sys.setswitchinterval(0.001)
        signal.signal(signal.SIGINT, self._on_interrupt)
        for number in _ENDING:
            signal.signal(number, self._on_terminate)
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
            _say_from_handler("left at once")
            os._exit(130)
        if not self.ending:
            ends = "pauses the study" if self.attended else "ends the run"
            _say_from_handler(f"stopped; Ctrl-C again within {SECOND_PRESS_S:g} seconds {ends}")
        self.ended_by_signal = self.ending
        self._leave_the_prompt()

    def _on_terminate(self, number: int, frame: FrameType | None) -> None:
        self.end()
        self.ended_by_signal = True
        self.ending_signal = signal.Signals(number).name
        self._leave_the_prompt()

    def _leave_the_prompt(self) -> None:
        if self._asking:
            self._asking = False  # once is enough: a second signal must not strike outside of the prompt
            raise _PromptInterrupted


def _say_from_handler(words: str) -> None:
    """Write a line on the real stderr without its buffer, which the interrupted code may be writing to."""
    with contextlib.suppress(OSError):  # nobody reads it any more
        os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, f"\n{words}\n".encode())
