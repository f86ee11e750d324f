"""What a program's text decides is done in a process that can be killed, under the limits, and for as long as it takes
in proportion to the text."""

from __future__ import annotations

import os
import signal
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from memo_core.sandbox import Limits, Sandbox
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_control import FakeControl

pytestmark = pytest.mark.process

# 300 000 assignments to write down: far longer than the limit, whatever the machine
SLOW = "from numpy import *\n" * 4_000


@pytest.fixture
def sandbox():
    with Sandbox(skill_library(BUILTIN_SKILLS), Limits(seconds_between_calls=1.0)) as opened:
        yield opened


def own_seconds() -> float:
    times = os.times()
    return times.user + times.system


def _command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""  # it ended meanwhile


def checkers() -> set[int]:
    """Process ids of our children that check code."""
    found = set()
    for children in Path(f"/proc/{os.getpid()}/task").glob("*/children"):
        with suppress(OSError):  # a thread or a child of another test that ends meanwhile
            for pid in map(int, children.read_text().split()):
                if b"sandbox.check_worker" in _command_line(pid):
                    found.add(pid)
    return found


def test_a_chain_of_methods_as_values_is_rewritten_in_proportion_to_its_length(sandbox):
    control = FakeControl()
    before = own_seconds()
    execution = sandbox.run("x = {}\ny = x" + ".pop" * 40, control, stopped=control.stopped)
    assert execution.ended == "done"
    assert own_seconds() - before < 0.5


def test_the_owner_of_a_method_as_a_value_is_evaluated_once(sandbox):
    control = FakeControl()
    code = "def f():\n    print('once')\n    return [3]\nadd = f().append\nadd(4)\nprint([1, 2].pop.__name__)\n"
    assert sandbox.run(code, control, stopped=control.stopped).printed.count("once") == 1


def test_a_program_that_takes_too_long_to_check_is_refused_within_the_limit(sandbox):
    sandbox.check("look()")
    before, began = own_seconds(), time.monotonic()
    (finding,) = sandbox.check(SLOW)
    assert "longer than 1 s" in finding.problem
    assert time.monotonic() - began < 4 and own_seconds() - before < 0.5
    assert sandbox.check("look()") == []  # another process has taken over


def test_a_stop_while_code_is_checked_is_heard_at_once():
    control = FakeControl()
    with Sandbox(skill_library(BUILTIN_SKILLS), Limits(seconds_between_calls=60)) as sandbox:
        sandbox.check("look()")
        pressed = []

        def press():
            pressed.append(time.monotonic())
            control.stop()

        threading.Timer(0.3, press).start()
        execution = sandbox.run(SLOW, control, stopped=control.stopped)
        assert execution.ended == "stopped" and time.monotonic() - pressed[0] < 0.2


def test_a_checker_that_was_killed_between_two_programs_is_started_again(sandbox):
    sandbox.check("look()")
    (checker,) = checkers()
    os.kill(checker, signal.SIGKILL)
    assert sandbox.check("look()") == []


def test_no_process_is_left_when_the_sandbox_is_closed():
    with Sandbox(skill_library(BUILTIN_SKILLS)) as sandbox:
        sandbox.check("look()")
        assert checkers()
    assert not checkers()


def test_the_checker_sees_nothing_of_the_environment(sandbox, monkeypatch):
    monkeypatch.setenv("SOME_API_KEY", "sk-1234567890")
    sandbox.close()
    sandbox.check("look()")
    (checker,) = checkers()
    assert Path(f"/proc/{checker}/environ").read_bytes() == b""
