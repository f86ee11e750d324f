"""Python processes that answer questions about text from outside: its content decides how much work that is."""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Iterable


def start_isolated(program: str, folders: Iterable[str]) -> subprocess.Popen[bytes]:
    """Start Python with ``program``, which finds in ``sys.argv[1:]`` the ``folders`` to import from, with pipes to its
    stdin and stdout."""
    # -I and -S: neither the environment nor the current folder decides what is imported, and site is slow.
    return subprocess.Popen(
        [sys.executable, "-I", "-S", "-c", program, *folders],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={},
        cwd="/",
        start_new_session=True,  # Ctrl-C in a terminal goes to a whole group of processes
    )


def end_isolated(process: subprocess.Popen[bytes]) -> None:
    """Kill it and close its pipes."""
    process.kill()
    process.wait()
    for pipe in (process.stdin, process.stdout):
        assert pipe is not None
        with contextlib.suppress(BrokenPipeError):  # what was still to be written to it
            pipe.close()
