"""Real signals to a run: the person is heard, the run goes on or ends with everything saved, and never a traceback."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import pytest

from memo_core.errors import Stopped
from memo_core.interfaces.teacher import Episode, Teacher, Verdict
from memo_core.process.stop_switch import StopSwitch, abandonable
from memo_core.runs.signal_handling import Supervisor
from memo_core.teachers.silent import SilentTeacher
from memo_core.testing.fake_environment import FakeEnvironment
from tests.support.timing import shortest

PROMISE_S = 0.1  # last command within 50 ms of the signal, prompt ready within another 50 ms


def an_episode() -> Episode:
    scene = FakeEnvironment().glance()
    return Episode("task", "OPEN(jar)", 1, scene, scene)


class Patient(Teacher):
    """Waits for ever unless it is asked after a stop."""

    def __init__(self) -> None:
        self.interrupted_at: list[float] = []

    def judge(self, episode: Episode) -> Verdict:
        read, _write = os.pipe()
        os.read(read, 1)
        raise AssertionError("nobody writes")

    def interrupted(self, episode: Episode) -> Verdict:
        self.interrupted_at.append(time.monotonic())
        return Verdict("correct", "slower")


def send_after(seconds: float, number: int = signal.SIGINT) -> list[float]:
    sent: list[float] = []

    def send() -> None:
        sent.append(time.monotonic())
        os.kill(os.getpid(), number)

    threading.Timer(seconds, send).start()
    return sent


def press_again_after(supervisor: Supervisor, seconds: float) -> None:
    """A second signal once the first was heard: two that are pending at once are one."""
    while supervisor.presses < 1:
        time.sleep(0.005)
    time.sleep(seconds)
    os.kill(os.getpid(), signal.SIGINT)


def test_a_signal_while_a_person_is_waited_for_asks_what_was_wrong_at_once():
    def seconds() -> float:
        teacher, stop = Patient(), StopSwitch()
        supervisor = Supervisor(stop, teacher)
        sent = send_after(0.1)

        def work() -> Verdict:
            with pytest.raises(Stopped):
                supervisor.ask(an_episode(), False)
            verdict = supervisor.ask(an_episode(), True)
            stop.release()
            return verdict

        assert supervisor.run(work) == Verdict("correct", "slower")
        assert not supervisor.ending
        return teacher.interrupted_at[0] - sent[0]

    assert shortest(seconds, PROMISE_S) < PROMISE_S


def test_a_signal_while_a_model_is_waited_for_gives_it_up_and_counts_its_late_answer():
    def seconds() -> float:
        stop = StopSwitch()
        supervisor = Supervisor(stop, Patient())
        late: list[object] = []
        given_up, came = threading.Event(), threading.Event()

        def slow() -> str:
            assert given_up.wait(30)
            return "an answer"

        def note(result) -> None:
            late.append(result)
            came.set()

        sent = send_after(0.1)

        def work() -> float:
            with pytest.raises(Stopped):
                abandonable(stop, "plan", slow, note)
            return time.monotonic()

        at = supervisor.run(work)
        given_up.set()
        assert came.wait(30) and late == ["an answer"]
        return at - sent[0]

    assert shortest(seconds, PROMISE_S) < PROMISE_S


def test_a_second_signal_within_two_seconds_ends_the_run():
    stop = StopSwitch()
    supervisor = Supervisor(stop, Patient())
    send_after(0.05)

    def work() -> str:
        press_again_after(supervisor, 0.1)
        while not supervisor.ending:
            time.sleep(0.005)
        with pytest.raises(Stopped):
            supervisor.ask(an_episode(), True)
        return "saved"

    assert supervisor.run(work) == "saved"


class TwoAtOnce(Teacher):
    """Interrupted by two signals that the process finds pending at the same moment."""

    def judge(self, episode: Episode) -> Verdict:
        both = {signal.SIGINT, signal.SIGTERM}
        signal.pthread_sigmask(signal.SIG_BLOCK, both)
        try:
            for number in both:
                signal.pthread_kill(threading.get_ident(), number)  # to this thread: another would take it at once
        finally:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, both)
        time.sleep(5)
        raise AssertionError("the signals should have come")


def test_two_signals_at_once_end_the_run_and_nothing_escapes():
    supervisor = Supervisor(StopSwitch(), TwoAtOnce())

    def work() -> str:
        with pytest.raises(Stopped):
            supervisor.ask(an_episode(), False)
        return "saved"

    assert supervisor.run(work) == "saved"
    assert supervisor.ending


def test_two_signals_far_apart_are_two_stops(monkeypatch):
    monkeypatch.setattr("memo_core.runs.signal_handling.SECOND_PRESS_S", 0.05)
    supervisor = Supervisor(StopSwitch(), Patient())
    send_after(0.05)

    def work() -> None:
        press_again_after(supervisor, 0.2)
        while supervisor.presses < 2:
            time.sleep(0.005)

    supervisor.run(work)
    assert not supervisor.ending


def test_the_handlers_of_before_are_back_after_a_run_however_it_ends():
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)

    def broken() -> None:
        raise ValueError("broken")

    with pytest.raises(ValueError, match="broken"):
        Supervisor(StopSwitch()).run(broken)
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_a_stop_already_pressed_is_not_slept_through():
    stop = StopSwitch()
    stop.press()
    with pytest.raises(Stopped):
        abandonable(stop, "plan", lambda: time.sleep(5), lambda _: None)
    heard: list[int] = []
    with stop.waking(lambda: heard.append(1)):
        assert heard == [1]
    stop.release()
    with stop.waking(lambda: heard.append(2)):
        stop.press()
    assert heard == [1, 2]


PROGRAM = textwrap.dedent(
    """
    import sys, time
    from memo_core.runs.signal_handling import Supervisor
    from memo_core.process.stop_switch import StopSwitch

    supervisor = Supervisor(StopSwitch())

    def work():
        print("working", flush=True)
        while not (supervisor.presses or supervisor.ending):
            time.sleep(0.01)
        print("heard", flush=True)
        while not supervisor.ending:
            time.sleep(0.01)
        print("saved", flush=True)

    supervisor.run(work)
    """
)


@pytest.mark.process
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_no_signal_ever_shows_a_traceback(number):
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stderr is not None
    try:
        assert process.stdout.readline() == "working\n"
        process.send_signal(number)
        assert process.stdout.readline() == "heard\n"  # two that are pending at once are one
        if number == signal.SIGINT:
            process.send_signal(number)
        out, errors = process.stdout.read(), process.stderr.read()
        assert out == "saved\n" and "Traceback" not in errors and process.wait(30) == 0
    finally:
        process.kill()


BUSY = textwrap.dedent(
    """
    import time
    from memo_core.runs.signal_handling import Supervisor
    from memo_core.sandbox import Sandbox
    from memo_core.skills.contract import BUILTIN_SKILLS
    from memo_core.skills.skill import skill_library
    from memo_core.process.stop_switch import StopSwitch
    from memo_core.testing.fake_control import FakeControl

    supervisor = Supervisor(StopSwitch())

    def work():
        with Sandbox(skill_library(BUILTIN_SKILLS)) as sandbox:
            told = lambda text: print(text, end="", flush=True)
            sandbox.run("print('working')", FakeControl(), stopped=lambda: False, on_print=told)
            while not supervisor.presses:
                time.sleep(0.01)
            print("once", flush=True)
            while not supervisor.ending:
                time.sleep(0.01)
            print("twice", flush=True)
            time.sleep(60)

    supervisor.run(work)
    """
)


@pytest.mark.process
def test_a_third_ctrl_c_leaves_at_once_and_leaves_nothing_in_the_temporary_directory(tmp_path):
    """Although no clean-up runs then: the starter of the sandbox's workers is a file without a name."""
    process = subprocess.Popen(
        [sys.executable, "-c", BUSY],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"TMPDIR": str(tmp_path)},
    )
    assert process.stdout is not None and process.stderr is not None
    try:
        for said in ("working\n", "once\n", "twice\n"):
            assert process.stdout.readline() == said
            process.send_signal(signal.SIGINT)
        errors = process.stderr.read()
        hint = "stopped; Ctrl-C again within 2 seconds ends the run"
        assert process.wait(30) == 130 and errors == f"\n{hint}\n\nleft at once\n"
    finally:
        process.kill()
        process.stdout.close()
        process.stderr.close()
    assert list(tmp_path.iterdir()) == []


KILLED = textwrap.dedent(
    """
    import json, os, signal, sys
    from memo_core.testing.fake_llm import ScriptedModel
    from memo_core.sandbox import Sandbox
    from memo_core.skillbook.book import Skillbook
    from memo_core.testing.fake_embedder import FakeEmbedder
    from memo_core.testing.fake_store import FakeStore
    from tests.support.loop_setup import Bench, BESIDE
    from memo_core.interfaces.teacher import Verdict
    from memo_core.skills.contract import BUILTIN_SKILLS
    from memo_core.skills.skill import skill_library

    def die(request):
        os.kill(os.getpid(), signal.SIGKILL)

    with Sandbox(skill_library(BUILTIN_SKILLS)) as sandbox:
        book = Skillbook(sys.argv[1], FakeEmbedder(), FakeStore()).open()
        script = {"plan": ["PICK_UP(red cube)"], "code": [BESIDE], "feedback": [die]}
        Bench(sandbox, book, script, [Verdict("correct", json.loads(sys.argv[2]))]).run()
    """
)


@pytest.mark.process
def test_feedback_survives_kill_9_right_after_it_was_given(tmp_path: Path):
    from memo_core.skillbook.book import Skillbook

    url, words = f"sqlite:///{tmp_path / 'book.db'}", 'no!\n  höher — 3 cm, "please"'
    ended = subprocess.run(
        [sys.executable, "-c", KILLED, url, json.dumps(words)],
        cwd=Path(__file__).parents[2],
        env=os.environ | {"PYTHONPATH": "."},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert ended.returncode == -signal.SIGKILL, ended.stderr
    with Skillbook(url) as book:
        [pending] = book.pending_feedback()
    assert (pending.words, pending.who, pending.status) == (words, "ana", "pending")


def test_a_signal_that_another_thread_receives_is_heard_all_the_same():
    """The system picks the thread; here the main one does not take signals at all."""

    def seconds() -> float:
        supervisor = Supervisor(StopSwitch(), Patient())

        def work() -> float:
            signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
            time.sleep(0.2)  # the main thread waits by now
            sent = time.monotonic()
            os.kill(os.getpid(), signal.SIGINT)
            while supervisor.presses < 1 and time.monotonic() < sent + 5:
                time.sleep(0.001)
            return time.monotonic() - sent

        return supervisor.run(work)

    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        assert shortest(seconds, PROMISE_S) < PROMISE_S
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@pytest.mark.parametrize("person", [False, True])
def test_a_stop_that_gets_no_answer_ends_the_run_only_where_there_is_nobody_to_ask(person):
    stop, teacher = StopSwitch(), SilentTeacher()
    teacher.simulated = not person  # a person at the terminal may say nothing: the attempt begins again
    supervisor = Supervisor(stop, teacher)

    def work() -> bool:
        os.kill(os.getpid(), signal.SIGINT)
        give_up = time.monotonic() + 5
        while not stop.pressed and time.monotonic() < give_up:
            time.sleep(0.001)
        with contextlib.suppress(Stopped):
            supervisor.ask(an_episode(), interrupted=True)
        return supervisor.ending

    assert supervisor.run(work) is not person


def test_a_second_press_ends_the_run_of_a_person():
    supervisor = Supervisor(StopSwitch(), Patient())
    supervisor.press()
    assert not supervisor.ending
    supervisor.press()
    assert supervisor.ending


@pytest.mark.parametrize(
    ("simulated", "attended", "ends"), [(True, True, True), (False, True, False), (True, False, False)]
)
def test_the_first_stop_ends_a_studys_run_only_where_nobody_can_say_what_was_wrong(simulated, attended, ends):
    teacher = Patient()
    teacher.simulated = simulated
    supervisor = Supervisor(StopSwitch(), teacher, attended)
    supervisor.press()
    assert supervisor.stop.pressed and supervisor.ending == ends
