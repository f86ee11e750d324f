"""Starting, asking and ending the process that reads prompt files which replace the built-in ones."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import subprocess
import threading
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import attrs

from memo_core.isolated_python import end_isolated, start_isolated
from memo_core.llm.prompt_filling import Unfit
from memo_core.llm.prompt_worker import FIELDS, TEXT

_IMPORTED = ("memo_core", "jinja2", "markupsafe")  # all that the process needs besides Python's own modules
_SERVE = "import sys; sys.path[:0] = sys.argv[1:]; from memo_core.llm.prompt_worker import serve; serve()"


class PromptProcess:
    """One process for all files, started when it is first needed and again after it was ended. Callable from any
    thread, one question at a time."""

    def __init__(self, seconds: int = 2) -> None:
        """``seconds`` of the processor's time for one question, and at most one more."""
        self._seconds = seconds
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()

    def names_in(self, text: str) -> list[tuple[str, int]]:
        """As ``prompt_filling.names_in``, within limits on time and memory; exceeding them is ``Unfit``, too."""
        return [(name, line) for name, line in self._answer({"text": text})["names"]]

    def filled(self, text: str, values: Mapping[str, Any]) -> str:
        """As ``prompt_filling.filled``, within limits on time and memory; exceeding them is ``Unfit``, too."""
        given = {name: plain(value) for name, value in values.items()}
        return str(self._answer({"text": text, "values": given})["text"])

    def close(self) -> None:
        """End the process. Idempotent."""
        with self._lock:
            self._kill()

    def forget(self) -> None:
        """Leave the process to whoever started it; for the child of a fork."""
        self._process, self._lock = None, threading.Lock()

    def _answer(self, asked: dict[str, Any]) -> dict[str, Any]:
        line = json.dumps(asked | {"seconds": self._seconds}).encode() + b"\n"
        with self._lock:
            try:
                fresh = self._process is None or self._process.poll() is not None
                answer = self._asked(line)
                if not answer and not fresh:  # a process that was ended between two questions is not this one's fault
                    answer = self._asked(line)
            except BaseException:
                self._kill()
                raise
        if not answer:
            raise Unfit(0, f"takes more than {self._seconds} s of the processor, or too much memory, to be filled in")
        found: dict[str, Any] = json.loads(answer)
        if "problem" in found:
            raise Unfit(found["line"], found["problem"])
        return found

    def _asked(self, line: bytes) -> bytes:
        """The answer; empty if the process died."""
        process = self._running()
        assert process.stdin is not None and process.stdout is not None
        with contextlib.suppress(BrokenPipeError):  # it is read as the end of the output below
            process.stdin.write(line)
            process.stdin.flush()
        answer = process.stdout.readline()
        if not answer.endswith(b"\n"):
            self._kill()
            return b""
        return answer

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is not None and self._process.poll() is None:
            return self._process
        self._kill()
        found = (find_spec(name) for name in _IMPORTED)
        folders = dict.fromkeys(str(Path(spec.origin).parents[1]) for spec in found if spec is not None and spec.origin)
        self._process = start_isolated(_SERVE, folders)
        return self._process

    def _kill(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            end_isolated(process)


def plain(value: Any, depth: int = 6) -> Any:
    """A value as JSON that the process restores: lists for all sequences and arrays, attrs objects by their public
    fields and properties; the text of whatever else."""
    if value is None or isinstance(value, (bool, int, float)):
        return value
    if isinstance(value, str):
        return str(value)
    if hasattr(value, "tolist"):  # an array of numpy
        value = value.tolist()
    if depth == 0:
        return f"{value}"
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item, depth - 1) for item in value]
    if isinstance(value, dict):
        return {FIELDS: [[plain(key, 1), plain(item, depth - 1)] for key, item in value.items()]}
    if not attrs.has(type(value)):
        return f"{value}"
    public = (name for name in dir(value) if not name.startswith("_"))
    fields = {name: member for name in public if not callable(member := getattr(value, name))}
    return {TEXT: f"{value}", FIELDS: [[name, plain(member, depth - 1)] for name, member in fields.items()]}


PROCESS = PromptProcess()
atexit.register(PROCESS.close)
os.register_at_fork(after_in_child=PROCESS.forget)
