"""``memo``: the entry point. Expected errors and Ctrl-C end in one clear line on stderr, never in a traceback.

Even importing the command line happens inside the guard: Ctrl-C a tenth of a second after Enter is no traceback either.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import sys
import threading
from collections.abc import Sequence

from memo_core.cli.signal_handling import INTERRUPTED, Interrupt, handling, ignore
from memo_core.terminal import guarded


def main(arguments: Sequence[str] | None = None) -> None:
    """Run ``memo`` with these arguments (those of the process by default) and exit with its code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in given or bool(os.environ.get("MEMO_DEBUG"))
    signals = contextlib.ExitStack()
    signals.enter_context(handling(Interrupt()))
    try:
        with guarded():
            code = _run(given, debug)
    except KeyboardInterrupt:
        if debug:
            raise
        print("memo: interrupted", file=sys.stderr)
        code = INTERRUPTED
    finally:
        if arguments is not None:
            signals.close()
        else:  # the process ends, and a signal that comes now changes nothing about how it did
            ignore()
    if arguments is None and any(thread.daemon for thread in threading.enumerate()):
        _leave(code)
    sys.exit(code)


def _leave(code: int) -> None:
    """Leave although threads are still at work, such as planning after a stop or an abandoned call. Python would end
    them when it shuts down, in the middle of C++ code that cannot be unwound: the process would abort."""
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(code)


def _run(given: list[str], debug: bool) -> int:
    try:
        from memo_core.cli.app import run_app

        code = run_app(given)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        # Whoever read our output has gone (`memo … | head`). Python would complain once more when it closes stdout.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if debug:
            raise
        from memo_core.errors import MemoError  # late: help has no use for it

        if isinstance(error, MemoError):
            _say(str(error))
            return error.exit_code
        _say(f"unexpected {type(error).__name__}: {' '.join(str(error).split())} (a bug; memo --debug shows where)")
        return 70


def _say(line: str) -> None:
    for part in line.split("\n"):  # only a line feed ends a line: other characters that might are shown
        if part.strip():
            print(f"memo: {part}", file=sys.stderr)


if __name__ == "__main__":
    main()
