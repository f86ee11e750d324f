"""A process at a pseudo terminal, as a person has it."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import struct
import subprocess
import termios
import time
from pathlib import Path

_ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b[=>]|\r")


class PseudoTerminal:
    """Runs a command whose streams are a terminal, and keeps what it has shown so far, without escape sequences.

    Attributes:
        shown: all text so far; what was erased or rewritten is in it too.
        unread: the part of it after the last match of ``wait_for_next``.
    """

    def __init__(
        self, *command: str, columns: int = 80, cwd: Path | None = None, environment: dict[str, str] | None = None
    ) -> None:
        ours, theirs = pty.openpty()
        self._ours, self._raw, self.shown, self._read_up_to = ours, "", "", 0
        self.resize(columns)
        self.process = subprocess.Popen(
            command,
            stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True, cwd=cwd,
            env=os.environ | {"TERM": "xterm", "PROMPT_TOOLKIT_NO_CPR": "1"} | (environment or {}),
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )  # fmt: skip
        os.close(theirs)

    def resize(self, columns: int, rows: int = 40) -> None:
        """Tell the terminal another size, as when its window is drawn larger or smaller."""
        fcntl.ioctl(self._ours, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))

    def type(self, keys: str) -> None:
        os.write(self._ours, keys.encode())

    def wait_for(self, words: str, seconds: float = 30.0) -> bool:
        """Whether the words are shown by then; line breaks count as spaces."""
        return self._wait(words, 0, seconds) >= 0

    def wait_for_next(self, words: str, seconds: float = 30.0) -> bool:
        """Whether the words are shown after those of the last call that was true."""
        found = self._wait(words, self._read_up_to, seconds)
        self._read_up_to = max(self._read_up_to, found)
        return found >= 0

    def _wait(self, words: str, start: int, seconds: float) -> int:
        end = time.monotonic() + seconds
        pattern = re.compile(r"\s+".join(map(re.escape, words.split(" "))))
        while (found := pattern.search(self.shown, start)) is None:
            if not self._read(end - time.monotonic()):
                return -1
        return found.end()

    def _read(self, seconds: float) -> bool:
        if not select.select([self._ours], [], [], max(0.0, seconds))[0]:
            return False
        try:
            read = os.read(self._ours, 4096)
        except OSError:  # the other side is closed
            read = b""
        self._raw += read.decode(errors="replace")
        self.shown = _ESCAPES.sub("", self._raw)
        return bool(read)

    @property
    def unread(self) -> str:
        return self.shown[self._read_up_to :]

    def exit_code(self, seconds: float = 60.0) -> int:
        """The exit code of the process once it has ended, having read all it showed."""
        end = time.monotonic() + seconds
        while self._read(end - time.monotonic()):
            pass
        return self.process.wait(max(0.1, end - time.monotonic()))

    def hang_up(self) -> None:
        """Close our side, as when the window is closed."""
        os.close(self._ours)
        self._ours = -1

    def close(self) -> None:
        self.process.kill()
        self.process.wait()
        if self._ours >= 0:
            os.close(self._ours)
