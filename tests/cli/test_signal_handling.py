"""Which signal handlers are in place, and until when."""

from __future__ import annotations

import gc
import signal
import subprocess
import sys

import pytest

from memo_core.cli.signal_handling import STOPS, handling, ignore


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
