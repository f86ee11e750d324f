"""A stop kills the worker: within milliseconds while code computes, and nothing the code planned happens afterwards."""

from __future__ import annotations

import os
import threading
import time

import pytest

from memo_core.errors import BackendUnavailable, MotionError, Stopped
from memo_core.events import SkillCalled
from memo_core.sandbox import Limits, Sandbox, Workspace, interpreter_process, prelude
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.control import Control
from memo_core.skills.skill import skill, skill_library
from memo_core.testing.fake_control import FakeControl
from tests.support.timing import shortest


@pytest.fixture(scope="module")
def sandbox():
    with Sandbox(skill_library(BUILTIN_SKILLS)) as opened:
        yield opened


COMPUTING = {
    "pure loop": "while True:\n    pass",
    "big integers": "x = 3\nfor _ in range(22):\n    x = x * x",
    "memory": "x = []\nwhile True:\n    x = [len(x)] * 1000",
    "printing nothing": "for i in range(10**9):\n    print(end='')",
    "catching everything": "while True:\n    try:\n        x = 1 // 0\n    except BaseException:\n        pass",
    "in finally": "try:\n    1 / 0\nfinally:\n    while True:\n        pass",
}


@pytest.mark.process
@pytest.mark.parametrize("kind", COMPUTING)
def test_a_stop_while_code_computes_ends_it_within_50_ms(kind, sandbox):
    assert shortest(lambda: _seconds_to_stop(sandbox, COMPUTING[kind]), 0.05) < 0.05


def _seconds_to_stop(sandbox: Sandbox, code: str) -> float:
    control, pressed = FakeControl(), threading.Event()
    pressed_at: list[float] = []

    def press():
        pressed.wait()
        time.sleep(0.05)
        pressed_at.append(time.perf_counter())
        control.stop()

    presser = threading.Thread(target=press)
    presser.start()
    execution = sandbox.run(
        f"wait(0)\n{code}\ngo_home()",
        control,
        stopped=control.stopped,
        on_call=lambda call: pressed.set(),
    )
    took = time.perf_counter() - pressed_at[0]
    presser.join()
    assert execution.ended == "stopped"
    assert control.commands == ["wait"]
    return took


def test_a_stop_before_the_code_begins_starts_nothing(sandbox):
    control = FakeControl()
    control.stop()
    execution = sandbox.run("go_home()", control, stopped=control.stopped)
    assert (execution.ended, control.commands) == ("stopped", [])


def test_a_stop_between_two_calls_lets_no_further_call_through(sandbox):
    control = FakeControl()
    calls: list[SkillCalled] = []

    def hear(call: SkillCalled) -> None:
        calls.append(call)
        if len(calls) == 3:
            control.stop()

    code = "try:\n    while True:\n        get_gripper_width()\nfinally:\n    go_home()"
    execution = sandbox.run(code, control, stopped=control.stopped, on_call=hear)
    assert (execution.ended, len(calls), control.commands) == ("stopped", 3, [])


def test_a_skill_that_raises_stopped_ends_the_code_even_when_the_latch_was_released(sandbox):
    control = FakeControl(stop_after=1)
    code = "try:\n    go_home()\n    go_home()\nexcept BaseException:\n    print('caught')\nfinally:\n    print('end')"
    execution = sandbox.run(code, control, stopped=lambda: False)
    assert (execution.ended, execution.printed, control.commands) == ("stopped", "", ["go_home"])
    assert execution.calls[-1].error == "stopped"


@pytest.mark.process
def test_no_worker_outlives_a_stop_or_the_sandbox():
    with Sandbox(skill_library(BUILTIN_SKILLS), Limits(seconds_between_calls=30)) as sandbox:
        control = FakeControl(stop_after=1)
        sandbox.run("go_home()\ngo_home()", control, stopped=control.stopped)
        before = _children()
        timer = threading.Timer(0.1, control.stop)
        control.release()
        timer.start()
        sandbox.run("while True: pass", control, stopped=control.stopped)
        assert len(_children()) <= len(before) + 1
    deadline = time.monotonic() + 2
    while _children() and time.monotonic() < deadline:
        time.sleep(0.01)
    assert _children() == []


def _children() -> list[int]:
    """Process ids of our living children whose command is the interpreter."""
    found = []
    for entry in os.listdir("/proc"):
        if not entry.isdigit():
            continue
        try:
            with open(f"/proc/{entry}/stat") as stat:
                fields = stat.read().rsplit(")", 1)[1].split()
            with open(f"/proc/{entry}/cmdline") as line:
                command = line.read()
        except OSError:
            continue
        if int(fields[1]) == os.getpid() and fields[0] != "Z" and "monty" in command:
            found.append(int(entry))
    return found


@pytest.mark.process
def test_the_worker_has_no_environment_of_ours(monkeypatch):
    monkeypatch.setenv("MEMO_TEST_SECRET", "abc123")
    seen: list[str] = []

    def look(call: SkillCalled) -> None:
        for pid in _children():
            with open(f"/proc/{pid}/environ") as environ:
                seen.append(environ.read())

    with Sandbox(skill_library(BUILTIN_SKILLS)) as sandbox:
        sandbox.run("wait(0)", FakeControl(), stopped=lambda: False, on_call=look)
    assert seen and not any("abc123" in environ for environ in seen)


@pytest.mark.process
def test_a_bug_in_a_skill_is_raised_here_and_the_sandbox_goes_on():
    @skill("query")
    def broken(control: Control) -> float:
        """It has a bug."""
        return {}["nothing"]

    with Sandbox(skill_library([*BUILTIN_SKILLS, broken])) as sandbox:
        code = "try:\n    broken()\nexcept BaseException:\n    go_home()"
        with pytest.raises(KeyError):
            sandbox.run(code, FakeControl(), stopped=lambda: False)
        assert sandbox.run("print(1)", FakeControl(), stopped=lambda: False).printed == "1\n"


@pytest.mark.parametrize("error", [BrokenPipeError(32, "Broken pipe"), KeyboardInterrupt()], ids=repr)
def test_what_goes_wrong_with_printing_is_raised_here_and_never_blamed_on_the_code(sandbox, error):
    def full(text: str) -> None:
        raise error

    control = FakeControl()
    code = "try:\n    print(1)\nexcept BaseException:\n    go_home()\ngo_home()"
    with pytest.raises(type(error)) as raised:
        sandbox.run(code, control, stopped=lambda: False, on_print=full)
    assert raised.value is error and control.commands == []
    assert sandbox.run("print(1)", FakeControl(), stopped=lambda: False).printed == "1\n"


def test_many_threads_run_code_at_once(sandbox):
    controls = [FakeControl() for _ in range(6)]
    ended: list[str] = []

    def one(control: FakeControl, n: int) -> None:
        code = f"for _ in range(5):\n    wait(0.1)\nmove_to([0.4, 0.0, 0.3 + {n} / 100])"
        ended.append(sandbox.run(code, control, stopped=control.stopped).ended)

    threads = [threading.Thread(target=one, args=(control, n)) for n, control in enumerate(controls)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert ended == ["done"] * 6
    assert [round(control.trail[-1][2], 2) for control in controls] == [0.3, 0.31, 0.32, 0.33, 0.34, 0.35]


def test_the_fake_refuses_like_a_robot():
    control = FakeControl(stop_after=1)
    with pytest.raises(MotionError):
        control.move_to([0.9, 0.9, 0.3], None, None, 0.0, 1.0)
    control.go_home()
    with pytest.raises(Stopped):
        control.go_home()
    assert Workspace().reach > 0


def test_threads_that_open_a_sandbox_at_once_share_one_pool(monkeypatch):
    started = []
    start = interpreter_process.Monty

    def slowly(**options):
        started.append(options)
        time.sleep(0.05)
        return start(**options)

    monkeypatch.setattr(interpreter_process, "Monty", slowly)
    pool = interpreter_process.WorkerPool(Limits())
    threads = [threading.Thread(target=pool.open) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    pool.close()
    assert len(started) == 1


@pytest.mark.process
def test_a_worker_that_stalls_before_the_code_begins_has_reached_the_limit(monkeypatch):
    """On a starved computer even our own first lines may take longer than the code is allowed."""
    own = prelude.source
    monkeypatch.setattr(prelude, "source", lambda name: own(name) + "\nwhile True:\n    pass\n")
    with Sandbox(skill_library(BUILTIN_SKILLS), Limits(seconds_between_calls=0.3, seconds_in_all=0.6)) as sandbox:
        execution = sandbox.run("print(1)", FakeControl(), stopped=lambda: False)
    assert (execution.ended, execution.kind) == ("limit", "time limit")


def test_a_missing_interpreter_is_named_with_the_remedy(monkeypatch):
    def missing() -> str:
        raise FileNotFoundError("could not locate the `monty` binary")

    monkeypatch.setattr(interpreter_process, "find_monty_binary", missing)
    with pytest.raises(BackendUnavailable, match=r"`monty` is missing .pip install --force-reinstall pydantic-monty"):
        interpreter_process.WorkerPool(Limits()).open()
