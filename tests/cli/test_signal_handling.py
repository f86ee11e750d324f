"""Which signal handlers are in place, and until when."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from memo_core.cli.signal_handling import STOPS, Interrupt, handling, ignore, never_lost


def test_handlers_that_are_forgotten_do_not_come_back_after_ignoring():
    before = {number: signal.getsignal(number) for number in STOPS}
    try:
        signals = handling(lambda *_: None)
        signals.__enter__()
        ignore()
        del signals
        gc.collect()
        assert [signal.getsignal(number) for number in STOPS] == [signal.SIG_IGN] * len(STOPS)
    finally:
        for number, one in before.items():
            signal.signal(number, one)


def test_a_block_restores_what_was_there():
    before = [signal.getsignal(number) for number in STOPS]
    with handling(lambda *_: None):
        assert signal.getsignal(signal.SIGTERM) not in (signal.SIG_DFL, signal.SIG_IGN)
    assert [signal.getsignal(number) for number in STOPS] == before


class Dropped:
    """Interrupted while it is finalized, where Python drops exceptions."""

    def __del__(self) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(5)


def test_an_interrupt_that_python_would_drop_is_raised_again(capsys):
    interrupt, again = Interrupt(), threading.Event()
    with handling(interrupt), never_lost():
        kept = Dropped()
        with pytest.raises(KeyboardInterrupt):
            del kept
            again.wait(30)
        os.kill(os.getpid(), signal.SIGINT)  # the second one, which interrupts nothing
        time.sleep(0.01)
    assert capsys.readouterr().err == ""


def test_what_else_python_drops_is_told_as_ever(monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", told.append)

    class Broken:
        def __del__(self) -> None:
            raise KeyboardInterrupt if told else ValueError("broken")

    monkeypatch.setattr(Interrupt, "raised_last", None)
    with never_lost():
        Broken()
        Broken()
    assert [one.exc_type for one in told] == [ValueError, KeyboardInterrupt]
    assert sys.unraisablehook == told.append


# In place of a command: an import runs by `exec`, and Python remembers a KeyboardInterrupt that came through one.
_COMMAND = """
from memo_core.cli import app, main
from memo_core.cli.execute import CodeEnded
from memo_core.cli.signal_handling import Interrupt, handling

def run_app(arguments):
    {body}

app.run_app = run_app
main.main()
"""
_SIGNAL = "import os, signal; os.kill(os.getpid(), signal.SIGTERM); sum(range(10**7))"
_INTERRUPTED = f'exec("{_SIGNAL}")'
_CAUGHT = f"""
    with handling(Interrupt()):
        try:
            exec("{_SIGNAL}")
        except KeyboardInterrupt:
            raise CodeEnded("moving.py", "stopped", 130) from None
"""


@pytest.mark.process
@pytest.mark.parametrize("body", [_INTERRUPTED, _CAUGHT], ids=["interrupted", "caught by the command"])
@pytest.mark.parametrize("reader", ["there", "gone"])
def test_an_interrupt_that_came_through_an_exec_does_not_kill_the_process(body, reader, tmp_path):
    (tmp_path / "command.py").write_text(_COMMAND.format(body=body))
    command = [sys.executable, "-m", "command"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        if reader == "gone":
            process.stderr.close()
        said = "" if reader == "gone" else process.stderr.read()
        assert process.wait() == 130, said
    assert "Traceback" not in said
