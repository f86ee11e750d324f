"""``memo``: the entry point. Expected errors and Ctrl-C end in one clear line on stderr, never in a traceback.

This includes importing the command line, so that Ctrl-C directly after Enter causes no traceback either. Therefore this
module imports almost nothing before ``main`` has installed the signal handlers.
"""

from __future__ import annotations

import contextlib
import os
import sys

from memo_core.cli.signal_handling import INTERRUPTED, Interrupt, handling, ignore, never_lost

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> None:
    """Run ``memo`` with these arguments (those of the process by default) and exit with its code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in given or bool(os.environ.get("MEMO_DEBUG"))
    interrupt = Interrupt()
    signals = handling(interrupt)
    try:
        signals.__enter__()
        with never_lost():
            code = _run(given, debug, interrupt)
        interrupt.over()  # from here on no signal raises anything: nobody would catch it
    except KeyboardInterrupt:  # raised once at most
        if debug:
            raise
        code = INTERRUPTED
        with contextlib.suppress(BrokenPipeError):
            _say("interrupted")
    finally:
        if arguments is not None:
            signals.__exit__(None, None, None)
        else:  # the process ends, and a signal that comes now changes nothing about how it did
            ignore()
    if arguments is None:
        _leave(code)
    sys.exit(code)


def _leave(code: int) -> None:
    """Exit immediately if Python's normal shutdown would do harm. It would end threads that are still running, such as
    planning after a stop or an abandoned call, in the middle of C++ code that cannot be unwound: the process would
    abort. And a process whose ``KeyboardInterrupt`` came through an ``exec`` on its way here, ``python -m`` would kill
    with SIGINT, although it was caught."""
    import atexit
    import threading

    if code != INTERRUPTED and not any(thread.daemon for thread in threading.enumerate()):
        return
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError):
            stream.flush()
    os._exit(code)


def _run(given: list[str], debug: bool, interrupt: Interrupt) -> int:
    from memo_core.text.terminal import guarded, replace_closed_streams

    replace_closed_streams()
    with guarded():
        return _guarded_run(given, debug, interrupt)


def _guarded_run(given: list[str], debug: bool, interrupt: Interrupt) -> int:
    try:
        from memo_core.cli.app import run_app

        code = run_app(given)
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # whoever read our output has gone (`memo … | head`)
        from memo_core.text.terminal import discard_stdout

        discard_stdout()
        return 0
    except Exception as error:
        if interrupt.raised:  # what is interrupted, an import above all, may end in an error of another kind
            raise KeyboardInterrupt from error
        if debug:
            raise
        from memo_core.errors import WHILE, MemoError, unwritable  # late: help has no use for it

        if isinstance(error, MemoError):
            _say(str(error))
            return error.exit_code
        whose = next((one for one in getattr(error, "__notes__", ()) if one.startswith(WHILE)), "")
        if not whose and (problem := unwritable(error)):
            _say(f"{problem} (name another place, or make room and access there)")
            return 1
        if isinstance(error, ModuleNotFoundError) and (missing := _needed(error)):
            _say(missing)
            return 1
        whose = whose or "a bug"
        _say(f"unexpected {type(error).__name__}: {' '.join(str(error).split())} ({whose}; memo --debug shows where)")
        return 70


def _needed(error: ModuleNotFoundError) -> str:
    """Say what needs the missing module and how to install it; empty where that is not known."""
    from memo_core.plugins.installing import needed

    return needed((error.name or "").partition(".")[0])


def _say(line: str) -> None:
    for part in line.split("\n"):  # only a line feed ends a line: other characters that might are shown
        if part.strip():
            print(f"memo: {part}", file=sys.stderr)


if __name__ == "__main__":
    main()
