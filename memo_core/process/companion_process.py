"""A process beside a command that never outlives it.

Its standard input is a pipe that only the command holds, and that the system closes however the command ends: the end
of its input tells it to end.
"""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import threading
import time
from collections.abc import Sequence
from typing import IO

INTERRUPTED = 130  # exit code of a command that a signal ended
GRACE_S = 5.0  # to end by itself; what is left of a model call that was given up takes two


def start_companion(
    command: Sequence[str], output: IO[bytes], inherited: Sequence[int] = ()
) -> subprocess.Popen[bytes]:
    """Start a command that calls ``end_with_input``.

    Args:
        command: the program and its arguments.
        output: file for what it prints and for its errors.
        inherited: file descriptors that stay open in it.

    Returns:
        The process.
    """
    return subprocess.Popen(
        command,
        stdin=subprocess.PIPE,
        stdout=output,
        stderr=output,
        start_new_session=True,  # Ctrl-C in a terminal goes to a whole group of processes
        pass_fds=inherited,
    )


def end_companion(process: subprocess.Popen[bytes]) -> int:
    """End a companion. If it is not over in time, or on an exception meanwhile, kill it with all that it started.

    Args:
        process: result of ``start_companion``.

    Returns:
        Its exit code.
    """
    assert process.stdin is not None
    process.stdin.close()
    try:
        process.wait(GRACE_S)
    except subprocess.TimeoutExpired:
        pass
    finally:
        if process.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
    return process.returncode


def end_with_input() -> None:
    """Interrupt this process, as Ctrl-C does, when its standard input ends; if it is then not over in time, exit."""
    threading.Thread(target=_end_after_input, name="memo-input", daemon=True).start()


def _end_after_input() -> None:
    main = threading.main_thread().ident
    assert main is not None
    with contextlib.suppress(OSError):
        while os.read(0, 4096):
            pass
    for _ in range(2):  # a first one may come when a trial is just over, and stop only that
        signal.pthread_kill(main, signal.SIGINT)  # to the thread that handles it: it may be waiting
        time.sleep(GRACE_S / 2)
    os._exit(INTERRUPTED)
