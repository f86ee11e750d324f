"""One answer typed at the terminal.

At a terminal the line editor is prompt_toolkit's: a pasted text of several paragraphs is one answer (bracketed paste),
and text typed before the question was asked is offered as a draft, never taken as the answer. Without a terminal (a
pipe, a file) each line is an answer. The library is imported when the first terminal is opened.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import select
import signal
import sys
import textwrap
from typing import Any

from memo_core.errors import InvalidArgument
from memo_core.text.reading_limits import too_long

_PASTE_MARKS = re.compile(r"\x1b\[20[01]~")
_NARROWEST = 20  # characters of a terminal in which lines are broken between words
_ANY_BYTE = "surrogateescape"
_ESCAPES = re.compile(r"\x1b(?:\[[0-9;?]*[ -/]*[@-~]|O.|.)?")


class TypedLine:
    """Reads answers from standard input and shows prompts on standard error. ``ended``: the input is at its end."""

    def __init__(self) -> None:
        self._session: Any = None
        self.ended = False

    def open(self) -> None:
        """Raises ``InvalidArgument`` if standard input is closed."""
        if sys.stdin is None or sys.stdin.closed:
            raise InvalidArgument("stdin", "standard input is closed", "a terminal, or a pipe or file with the answers")
        _read_any_byte()
        if not self.at_terminal or self._session is not None:
            return
        try:
            from prompt_toolkit import PromptSession
            from prompt_toolkit.output import create_output
        except ImportError:
            return  # a plain line then
        self._session = PromptSession(output=create_output(stdout=sys.stderr), enable_suspend=False)

    def close(self) -> None:
        self._session = None

    @property
    def typed(self) -> bool:
        """Whether a person types the answers; else they come from a pipe or a file."""
        return sys.stdin is not None and not sys.stdin.closed and sys.stdin.isatty()

    @property
    def at_terminal(self) -> bool:
        return sys.stdin.isatty() and sys.stderr.isatty() and os.name == "posix"

    def ask(self, *question: str, prompt: str = "> ") -> str | None:
        """Show the lines of a question and return what is typed from then on; None at the end of input. Text typed
        before is a draft. Exceptions of signal handlers propagate."""
        typed = self._asked(question, prompt)
        self.ended = typed is None
        return None if typed is None else _text(typed)

    def _asked(self, question: tuple[str, ...], prompt: str) -> str | None:
        draft = self._typed_ahead()  # before the question is shown: what comes after it is the answer, however soon
        if too_long(draft):
            print(f"({len(draft)} characters typed before the question are not taken)", file=sys.stderr)
            draft = ""
        shown = map(_wrapped, question) if self.at_terminal else question
        print(*shown, sep="\n", file=sys.stderr, flush=True)
        if self._session is None:
            if draft:
                print(f"(typed before the question and not taken: {draft})", file=sys.stderr)
            print(prompt, end="", file=sys.stderr, flush=True)
            line = sys.stdin.readline()
            if not line.endswith("\n"):
                print(file=sys.stderr)  # no Enter has ended the prompt's line
            return line or None
        try:
            return str(self._session.prompt(prompt, default=draft, handle_sigint=False, set_exception_handler=False))
        except EOFError:
            return None
        except KeyboardInterrupt as pressed:
            if type(pressed) is not KeyboardInterrupt:
                raise  # thrown by a signal handler
            # Ctrl-C is a key here: whoever owns the signal hears of it as if the terminal had sent it.
            signal.raise_signal(signal.SIGINT)
            raise

    def _typed_ahead(self) -> str:
        """Removes from the terminal's buffer what was typed since the last answer, and returns it."""
        if os.name != "posix" or not sys.stdin.isatty():
            return ""
        import termios
        import tty

        terminal = sys.stdin.fileno()
        kept = termios.tcgetattr(terminal)
        found = bytearray()
        try:
            tty.setcbreak(terminal, termios.TCSANOW)  # else an unfinished line stays out of reach
            while select.select([terminal], [], [], 0)[0]:
                read = os.read(terminal, 4096)
                if not read:
                    break
                found += read
        finally:
            termios.tcsetattr(terminal, termios.TCSANOW, kept)
        text = _ESCAPES.sub("", _PASTE_MARKS.sub("", found.decode(errors="replace")))
        return " ".join("".join(c if c.isprintable() else " " for c in text).split())


def _read_any_byte() -> None:
    """Let standard input carry bytes that are no UTF-8: the answer must not be lost for them. A stream that was read
    before cannot be changed any more and stays as it is."""
    if isinstance(sys.stdin, io.TextIOWrapper) and sys.stdin.errors != _ANY_BYTE:
        with contextlib.suppress(io.UnsupportedOperation):
            sys.stdin.reconfigure(errors=_ANY_BYTE)


def _wrapped(line: str) -> str:
    """A line broken between words where the terminal would break it within one."""
    width = os.get_terminal_size(sys.stderr.fileno()).columns or 80  # 0: a terminal that does not say
    if len(line) <= width or width < _NARROWEST:
        return line
    indent = line[: len(line) - len(line.lstrip())]
    return textwrap.fill(line, width, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def _text(line: str) -> str:
    """The typed text in a form that can be stored, also from a terminal that does not use UTF-8."""
    try:
        line.encode()
    except UnicodeEncodeError:
        return line.encode(errors=_ANY_BYTE).decode("latin-1")
    return line
