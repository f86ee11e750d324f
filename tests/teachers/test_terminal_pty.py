"""The person at a real terminal: what was typed before the question, pasted text, Ctrl-C as a key and as a signal."""

from __future__ import annotations

import os
import signal
import sys

import pytest

from tests.support.pseudo_terminal import PseudoTerminal

pytestmark = [pytest.mark.skipif(os.name != "posix", reason="pseudo terminals"), pytest.mark.process]

JUDGED = """
import sys, time
from memo_core.teachers.terminal import TerminalSettings, TerminalTeacher
from memo_core.testing.teacher import episodes
teacher = TerminalTeacher(TerminalSettings(who="ana"))
teacher.open()
print("BUSY", flush=True)
time.sleep(0.7)
verdict = teacher.judge(episodes()[0])
print("VERDICT", verdict.kind, repr(verdict.words), flush=True)
"""

# A terminal that is slow to go on after it has shown something.
SLOW = """
import sys, time
class Slow:
    def __init__(self, stream):
        self._stream = stream
    def write(self, text):
        self._stream.write(text)
        self._stream.flush()
        if "Did it work?" in text:
            time.sleep(0.3)
    def __getattr__(self, name):
        return getattr(self._stream, name)
"""

SUPERVISED = """
import time
from memo_core.errors import Stopped
from memo_core.runs.signal_handling import Supervisor
from memo_core.process.stop_switch import StopSwitch
from memo_core.teachers.terminal import TerminalSettings, TerminalTeacher
from memo_core.testing.teacher import episodes
teacher = TerminalTeacher(TerminalSettings(who="ana"))
teacher.open()
supervisor = Supervisor(StopSwitch(), teacher)

def work():
    try:
        return supervisor.ask(episodes()[0], interrupted=False)
    except Stopped:
        return supervisor.ask(episodes()[0], interrupted=True)

verdict = supervisor.run(work)
print("VERDICT", verdict.kind, repr(verdict.words), flush=True)
"""


@pytest.fixture
def terminal():
    opened: list[PseudoTerminal] = []

    def start(script: str) -> PseudoTerminal:
        opened.append(PseudoTerminal(sys.executable, "-c", script))
        return opened[-1]

    yield start
    for one in opened:
        one.close()


def test_keys_typed_ahead_are_a_draft_and_never_the_answer(terminal):
    there = terminal(JUDGED)
    assert there.wait_for("BUSY")
    there.type("y\n")
    assert there.wait_for("> y"), f"the draft is not offered: {there.shown}"
    assert not there.wait_for("VERDICT", 0.7), "what was typed before the question was taken as the answer"
    there.type("\x15no, an arc\r")
    assert there.wait_for("VERDICT correct 'no, an arc'"), there.shown


def test_what_is_typed_as_soon_as_the_question_is_seen_is_the_answer(terminal):
    there = terminal(SLOW + JUDGED.replace("verdict = ", "sys.stderr = Slow(sys.stderr)\nverdict = "))
    assert there.wait_for("Did it work?")
    there.type("an arc\n")
    assert there.wait_for("VERDICT correct 'an arc'", 5.0), there.shown


def test_a_draft_can_be_sent_as_it_is(terminal):
    there = terminal(JUDGED)
    assert there.wait_for("BUSY")
    there.type("a bit low")
    assert there.wait_for("> a bit low")
    there.type("er\r")
    assert there.wait_for("VERDICT correct 'a bit lower'"), there.shown


def test_several_pasted_paragraphs_are_one_correction(terminal):
    there = terminal(JUDGED)
    assert there.wait_for("Did it work?") and there.wait_for(">")
    there.type("\x1b[200~pull in an arc\n\nand slowly,\nplease\x1b[201~")
    assert not there.wait_for("VERDICT", 0.5), "a line of the pasted text was taken as the answer"
    there.type("\r")
    assert there.wait_for(r"VERDICT correct 'pull in an arc\n\nand slowly,\nplease'"), there.shown


@pytest.mark.parametrize("how", ["key", "signal"])
def test_ctrl_c_at_the_question_asks_what_was_wrong(terminal, how):
    there = terminal(SUPERVISED)
    assert there.wait_for("Did it work?") and there.wait_for(">")
    if how == "key":
        there.type("\x03")
    else:
        os.kill(there.process.pid, signal.SIGINT)
    assert there.wait_for("What was wrong?", 5.0), there.shown
    there.type("you were too fast\r")
    assert there.wait_for("VERDICT correct 'you were too fast'"), there.shown


def test_the_end_of_input_means_that_nobody_watches(terminal):
    there = terminal(JUDGED)
    assert there.wait_for("Did it work?") and there.wait_for(">")
    there.type("\x04")
    assert there.wait_for("VERDICT silent"), there.shown
