"""Starting, using and killing the process that checks and rewrites generated code."""

from __future__ import annotations

import contextlib
import inspect
import json
import os
import select
import subprocess
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path

import attr
import attrs

import memo_core
from memo_core.errors import Stopped
from memo_core.process.isolated_python import end_isolated, start_isolated
from memo_core.sandbox.check_worker import Checked, from_json
from memo_core.sandbox.limits import Limits
from memo_core.sandbox.subset import Finding, SkillShape
from memo_core.skills.skill import Skill

_POLL_MS = 4  # between two looks at the stop
_START_S = 10.0  # a machine under load may take so long to start Python
_IMPORTED = (memo_core.__file__, attr.__file__)  # all that the process needs besides Python's own modules
_SERVE = "import sys; sys.path[:0] = sys.argv[1:]; from memo_core.sandbox.check_worker import serve; serve()"


class Checker:
    """One process for all programs, restarted after it had to be killed. Callable from any thread, one program at a
    time."""

    def __init__(self, skills: Iterable[Skill], limits: Limits) -> None:
        """Prepare the checks; the process starts with ``open`` or the first ``check``.

        Args:
            skills: skills that code may call; only their names and parameters are passed on.
            limits: limits on the time (``seconds_between_calls``) and memory of a check.
        """
        self._limits = limits
        shapes = [attrs.asdict(_shape(skill)) for skill in skills]
        self._greeting = {"skills": shapes, "seconds": limits.seconds_between_calls, "memory": limits.memory}
        self._process: subprocess.Popen[bytes] | None = None
        self._answered = 0  # programs, by this process
        self._lock = threading.Lock()

    def open(self) -> None:
        """Start the process, which initialises in the background. Idempotent."""
        with self._lock:
            self._running()

    def close(self) -> None:
        """End the process. Idempotent."""
        with self._lock:
            self._kill()

    def check(self, code: str, stopped: Callable[[], bool] = lambda: False) -> Checked:
        """Check generated code and rewrite it for the interpreter, without running it.

        Args:
            code: the program, any text.
            stopped: reads the latched stop; polled every few milliseconds.

        Returns:
            The rewritten source with its line numbers; or findings: syntax errors, constructs outside the subset,
                unknown names, skills called with wrong arguments, or a check that exceeds its time or memory.

        Raises:
            Stopped: within milliseconds after ``stopped`` becomes true.
        """
        with self._lock:
            try:
                # Twice: a process that was killed between two programs is not this program's fault.
                answer = self._asked(code, stopped) or self._asked(code, stopped)
            except BaseException:
                self._kill()
                raise
        return answer or _refusal("the code cannot be checked within the sandbox's limits; write it more simply")

    def _asked(self, code: str, stopped: Callable[[], bool]) -> Checked | None:
        """The answer; None if the process died."""
        process = self._running()
        assert process.stdin is not None and process.stdout is not None
        limit = self._limits.seconds_between_calls
        deadline = time.monotonic() + limit + (0.0 if self._answered else _START_S)
        with contextlib.suppress(BrokenPipeError):  # it is read as the end of the output below
            process.stdin.write(json.dumps(code).encode() + b"\n")
            process.stdin.flush()
        waiting = select.poll()
        waiting.register(process.stdout, select.POLLIN)
        answer = bytearray()
        while not answer.endswith(b"\n"):
            if stopped():
                raise Stopped("checking code")
            if time.monotonic() > deadline:
                self._kill()
                return _refusal(f"checking the code took longer than {limit:g} s; write it more simply")
            if not waiting.poll(_POLL_MS):
                continue
            piece = os.read(process.stdout.fileno(), 1 << 16)
            if not piece:
                self._kill()
                return None
            answer += piece
        self._answered += 1
        return from_json(json.loads(answer))

    def _running(self) -> subprocess.Popen[bytes]:
        if self._process is not None and self._process.poll() is None:
            return self._process
        self._kill()
        folders = list(dict.fromkeys(str(Path(file).parents[1]) for file in _IMPORTED if file))
        self._process = start_isolated(_SERVE, folders)
        self._answered = 0
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(self._greeting).encode() + b"\n")
        return self._process

    def _kill(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            end_isolated(process)


def _shape(skill: Skill) -> SkillShape:
    required = tuple(p.name for p in skill.parameters if p.default is inspect.Parameter.empty)
    return SkillShape(skill.name, tuple(p.name for p in skill.parameters), required, skill.signature)


def _refusal(problem: str) -> Checked:
    return Checked(findings=(Finding(1, problem),))
