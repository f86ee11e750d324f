"""Printing untrusted text to a terminal: control characters are shown, never interpreted.

Text of people, models, books, files and servers may hold escape sequences that clear the screen, write the clipboard or
reorder what is read. All output passes through ``printable``: either in ``guarded`` streams, with which the command
line replaces stdout and stderr, or, for coloured output, in ``console``.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Callable, Iterator
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

# C0 and C1 but line feed and tab, a return that is no line's end, marks that change the direction of text, and halves
# of surrogate pairs, which no encoding can write
_CONTROL = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028\u2029\u202a-\u202e\u2066-\u2069\ud800-\udfff]"
    "|\r(?!\n)"
)
_STDERR = 2
_OF_STYLE = re.compile("(\x1b\\[[0-9;?]*[mKAJGhl])")  # what Rich writes: colours and, for a progress bar, the cursor


def printable(text: str) -> str:
    """``text`` with its control characters escaped: ``\\x1b``, and ``\\u009b`` beyond ASCII. JSON text keeps its
    meaning, since its strings contain only characters of the second kind, which JSON escapes in the same way."""
    return _CONTROL.sub(_spelt, text)


def _spelt(match: re.Match[str]) -> str:
    code = ord(match.group())
    return f"\\x{code:02x}" if code < 0x7F else f"\\u{code:04x}"


class _Guarded:
    """A text stream that escapes control characters and otherwise behaves like the stream it wraps."""

    def __init__(self, stream: IO[str], loss_is_fine: bool, redact: Callable[[str], str]) -> None:
        self._stream = stream
        self._redact = redact
        self._loss_is_fine = loss_is_fine  # whether text that cannot be written is no reason to stop
        self.rich_proxied_file = _Styled(self)  # Rich asks for this name and writes its colours there

    def write(self, text: str) -> int:
        if not isinstance(text, str):
            raise TypeError(f"write() argument must be str, not {type(text).__name__}")  # Click asks by trying bytes
        with self._maybe_lost():
            self._stream.write(printable(self._redact(text)))
        return len(text)

    def writelines(self, lines: Any) -> None:
        for line in lines:
            self.write(line)

    def flush(self) -> None:
        with self._maybe_lost():
            self._stream.flush()

    def styled(self, text: str) -> int:
        """Write Rich text whose colour codes are not escaped."""
        text = self._redact(text)
        parts = _OF_STYLE.split(text) if self._stream.isatty() else [text]
        with self._maybe_lost():
            self._stream.write("".join(p if n % 2 else printable(p) for n, p in enumerate(parts)))
        return len(text)

    @contextlib.contextmanager
    def _maybe_lost(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            if self._loss_is_fine:
                return
            if isinstance(error, BrokenPipeError):
                raise
            from memo_core.errors import OutputLost

            discard_stdout()
            raise OutputLost(error.strerror or type(error).__name__) from None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class _Styled:
    def __init__(self, guarded: _Guarded) -> None:
        self._guarded = guarded

    def write(self, text: str) -> int:
        return self._guarded.styled(text)

    def flush(self) -> None:
        self._guarded.flush()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._guarded, name)


@contextlib.contextmanager
def guarded() -> Iterator[None]:
    """Within the block, stdout and stderr escape control characters and redact the environment's secrets. A stderr that
    cannot be written is not an error; a stdout that cannot raises ``BrokenPipeError`` or ``OutputLost``."""
    before, redact = (sys.stdout, sys.stderr), _redactor()
    sys.stdout, sys.stderr = _Guarded(sys.stdout, False, redact), _Guarded(sys.stderr, True, redact)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def replace_closed_streams() -> None:
    """Discard what is printed to an output stream that was closed when the process started (``>&-``). The numbers of
    closed streams are taken, too: a file opened later would get them, and with them what libraries print."""
    while (taken := os.open(os.devnull, os.O_RDWR)) <= _STDERR:
        os.set_inheritable(taken, True)
    os.close(taken)
    sys.stdout = sys.stdout or _discarding()
    sys.stderr = sys.stderr or _discarding()


def _discarding() -> IO[str]:
    return open(os.devnull, "w", encoding="utf-8", errors="replace")  # closed with the process


def discard_stdout() -> None:
    """Nobody reads stdout any more, or it cannot be written: drop what is written from here on, as Python would
    otherwise complain again when it closes the stream."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _redactor() -> Callable[[str], str]:
    if not any(_may_be_secret(name) for name in os.environ):
        return str  # also, what redacts takes 30 ms to import
    from memo_core.text.redaction import Redactor

    return Redactor.of_environment()


def _may_be_secret(name: str) -> bool:
    """Whether an environment variable's name says that it holds a secret, as ``Redactor`` sees it, or nearly so."""
    return any(word in name.upper() for word in ("KEY", "TOKEN", "SECRET", "PASSW", "CREDENTIAL"))


def console(**options: Any) -> Console:
    """A Rich console that escapes control characters and raises ``BrokenPipeError`` when its reader is gone (Rich's own
    ends the process). ``options`` are passed to Rich."""
    from rich.console import Console, ConsoleOptions, ConsoleRenderable, RenderResult
    from rich.segment import Segment

    class _Shown:
        def __init__(self, renderable: ConsoleRenderable) -> None:
            self._renderable = renderable

        def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
            for segment in console.render(self._renderable, options):
                yield segment if segment.control else Segment(printable(segment.text), segment.style)

    class _Hook:
        def process_renderables(self, renderables: list[ConsoleRenderable]) -> list[ConsoleRenderable]:
            return [_Shown(one) for one in renderables]

    class _Console(Console):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    made = _Console(**options)
    made.push_render_hook(_Hook())  # type: ignore[arg-type]
    return made
