"""Signals to ``memo web``: what it prints of Ctrl-C is true, and what ends a run by a signal ends the command."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import threading
import time

import pytest

pytestmark = [pytest.mark.process, pytest.mark.wire]

WAIT_S = 90.0
INTERRUPTED = 130
# The pages' messages as the run's process has them: "begin" comes as if a person pressed the button, and each question
# that goes to a page is printed.
PROGRAM = """
import sys, threading
from memo_web.robot_side.pages_process import PagesProcess

on, send = PagesProcess.on, PagesProcess.send

def begin(pages, kind, handler):
    undo = on(pages, kind, handler)
    if kind == "begin" and sys.argv.pop() == "begin":
        threading.Timer(1.0, handler, [{"task": "stack-the-cubes", "seed": 0}]).start()
    return undo

def tell(pages, kind, *more, **fields):
    if kind == "question" and fields["question"]:
        print("asked:", fields["question"]["title"], file=sys.stderr, flush=True)
    send(pages, kind, *more, **fields)

PagesProcess.on, PagesProcess.send = begin, tell

from memo_core.cli.main import main
main(["web", "--set", "teacher.port=0", "--set", "teacher.who=ann", "--set", "run.pace=off"])
"""


class Command:
    """``memo web`` in a folder; ``begin``: a task is begun on its page. Use as a context manager."""

    def __init__(self, folder, *arguments):
        self.folder, self.printed = folder, ""
        self._command = [sys.executable, "-c", PROGRAM, *arguments]

    def __enter__(self):
        self.process = subprocess.Popen(
            self._command, cwd=self.folder, text=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )  # fmt: skip
        threading.Thread(target=self._read, daemon=True).start()
        return self

    def _read(self):
        for line in self.process.stderr:
            self.printed += line

    def wait_for(self, text):
        until = time.monotonic() + WAIT_S
        while not re.search(text, self.printed):
            assert time.monotonic() < until and self.process.poll() is None, self.printed
            time.sleep(0.02)

    def __exit__(self, *error):
        self.process.kill()
        self.process.wait()


def summary(folder):
    [found] = folder.glob("runs/*/summary.json")
    return json.loads(found.read_text())


def test_between_runs_one_ctrl_c_ends_the_command(tmp_path):
    with Command(tmp_path, "idle") as command:
        command.wait_for("Ctrl-C ends this command")
        command.process.send_signal(signal.SIGINT)
        assert command.process.wait(WAIT_S) == INTERRUPTED
        assert "Traceback" not in command.printed


@pytest.mark.sim
@pytest.mark.slow
def test_during_a_run_ctrl_c_asks_on_the_page_and_twice_ends_run_and_command(tmp_path):
    with Command(tmp_path, "begin") as command:
        command.wait_for("asked: .*Did it work")
        command.process.send_signal(signal.SIGINT)
        command.wait_for("asked: Stopped")
        command.wait_for("the page asks what was wrong .*twice within two seconds ends both")
        time.sleep(2.1)
        assert command.process.poll() is None
        command.process.send_signal(signal.SIGINT)
        time.sleep(0.3)  # two that are pending at once are one
        command.process.send_signal(signal.SIGINT)
        assert command.process.wait(WAIT_S) == INTERRUPTED
        assert "Traceback" not in command.printed
    assert summary(tmp_path)["ended_by_person"] and summary(tmp_path)["resumable"]


@pytest.mark.sim
@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_end_ends_run_and_command_with_everything_saved(tmp_path, number):
    with Command(tmp_path, "begin") as command:
        command.wait_for("asked: .*Did it work")
        command.process.send_signal(number)
        assert command.process.wait(WAIT_S) == INTERRUPTED
    assert summary(tmp_path)["ended_by_person"] and summary(tmp_path)["resumable"]
