"""The command ``memo web`` in a process of its own, with its pages at a free port."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

START_S = 90.0
END_S = 30.0


class WebCommand:
    """Runs ``memo web`` in a folder. Use as a context manager; ``url`` is where its pages are."""

    def __init__(self, folder: Path, *arguments: str, environment: dict[str, str] | None = None) -> None:
        self.folder = folder
        self._command = [
            sys.executable, "-c", "from memo_core.cli.main import main; main()",
            "web", *arguments, "--set", "teacher.port=0",
        ]  # fmt: skip
        self._environment = os.environ | (environment or {})
        self.printed = ""
        self.url = ""
        self._found = threading.Event()

    def __enter__(self) -> WebCommand:
        self.process = subprocess.Popen(
            self._command, cwd=self.folder, env=self._environment, text=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        )  # fmt: skip
        threading.Thread(target=self._read, daemon=True).start()
        assert self._found.wait(START_S), self.printed
        assert self.url, self.printed
        return self

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.printed += line
            if found := re.search(r"teach at (https?://\S+?/)", line):
                self.url = found[1]
                self._found.set()
        self._found.set()

    def __exit__(self, *error: object) -> None:
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
