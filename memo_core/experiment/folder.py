"""The folder of one run. Everything is on disk when the call that writes it returns; whole files appear at once.

config.yaml          what was asked for, resolved, without secrets
events.jsonl         everything that was observed, one JSON object a line, as it happened
calls/001-plan.json  each question to a model and its answer
code/01-OPEN.microwave/attempt-1.py
retrieved/…          which entries a subtask was served, and why
checkpoints/01.json  the world at the start of each subtask
video/…              an attempt each
summary.json         how it ended; missing when the run was killed
"""

from __future__ import annotations

import json
import os
import re
import threading
import time
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.events import Event, Retrieved
from memo_core.interfaces.llm import Answer, Request, Usage
from memo_core.redaction import Redactor


class RunFolder:
    """Writes one run's folder. Safe to use from several threads: late answers of models come from their own."""

    def __init__(self, path: Path) -> None:
        """Makes the folder. Raises ``InvalidArgument`` where one with a run is already."""
        if (path / "events.jsonl").exists():
            raise InvalidArgument("out", f"{path} already holds a run", "a new folder")
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidArgument("out", f"{path} cannot be made: {error.strerror}", "a folder to write to") from error
        self.path = path
        self._redact = Redactor.of_environment()
        self._lock = threading.Lock()
        self._events = (path / "events.jsonl").open("a", encoding="utf-8")
        self._calls = 0
        self._retrieved = 0
        self._number = 0

    def close(self) -> None:
        """Idempotent."""
        with self._lock:
            self._events.close()

    def write(self, name: str, content: str | bytes) -> Path:
        """A whole file, on disk when this returns; never half of it."""
        return write_whole(self.path / name, self._redact(content) if isinstance(content, str) else content)

    def write_json(self, name: str, value: Any) -> Path:
        return self.write(name, json_text(value))

    def config(self, values: dict[str, Any]) -> None:
        import yaml

        self.write("config.yaml", yaml.safe_dump(nested(values), sort_keys=False, allow_unicode=True))

    def event(self, event: Event) -> None:
        """Append one event. Flushed to the system at once; the lines survive the end of this process."""
        line = self._redact(json.dumps({"event": type(event).__name__, **plain(event)}, ensure_ascii=False))
        with self._lock:
            if self._events.closed:
                return
            self._events.write(line + "\n")
            self._events.flush()
        if isinstance(event, Retrieved):
            self._retrieved += 1
            self.write_json(f"retrieved/{self._retrieved:02d}-{file_name(event.subtask)}.json", event)

    # -- the journal of a method (memo_core.policy.session.Journal) ------------------------------------------------
    def model_call(
        self, request: Request, answer: Answer | None, problem: str, abandoned: bool, usage: Usage | None = None
    ) -> str:
        with self._lock:
            self._calls += 1
            name = f"calls/{self._calls:03d}-{file_name(request.phase)}.json"
        messages = [
            {"role": m.role, "text": m.text} | ({"images": len(m.images)} if m.images else {}) for m in request.messages
        ]
        kept = {
            "phase": request.phase,
            "time": time.time(),
            "seed": request.seed,
            "prompt": request.prompt,
            "abandoned": abandoned,
            "problem": problem,
            "answer": None if answer is None else attrs.asdict(answer),
            "usage": None if usage is None else attrs.asdict(usage),  # of a call without an answer
            "messages": messages,
        }
        self.write_json(name, kept)
        return name

    def code(self, subtask: str, attempt: int, repair: int, code: str) -> str:
        name = f"{self._subtask_folder(subtask)}/attempt-{attempt}{f'-repair-{repair}' if repair else ''}.py"
        self.write(name, code)
        return name

    def subtask_start(self, number: int, subtask: str, done: tuple[str, ...], checkpoint: bytes) -> None:
        self._number = number
        try:
            world: Any = json.loads(checkpoint)
        except ValueError:
            world = None
        kept = {"number": number, "subtask": subtask, "done": done, "world": world}
        self.write(f"checkpoints/{number:02d}.json", json.dumps(plain(kept)) + "\n")

    def attempt_begins(self, number: int, attempt: int) -> None: ...

    def attempt_ends(self, number: int, attempt: int) -> None: ...

    def _subtask_folder(self, subtask: str) -> str:
        return f"code/{self._number:02d}-{file_name(subtask)}"


def write_whole(path: Path, content: str | bytes) -> Path:
    """A file that is there whole or not at all, on disk when this returns."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.{threading.get_ident()}")
    data = content.encode() if isinstance(content, str) else content
    with temporary.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    os.replace(temporary, path)
    return path


def json_text(value: Any) -> str:
    """A value as an indented JSON document."""
    return json.dumps(plain(value), indent=1, ensure_ascii=False) + "\n"


def new_run_folder(out: Path, task: str, seed: int) -> Path:
    """A name for a run's folder under ``out`` that no other has: date, time, task, seed."""
    stamp = time.strftime("%Y-%m-%dT%H-%M-%S")
    for number in range(1, 1000):
        path = out / f"{stamp}-{file_name(task)}-seed{seed}{f'-{number}' if number > 1 else ''}"
        try:
            path.mkdir(parents=True)
            return path
        except FileExistsError:
            continue
        except OSError as error:
            raise InvalidArgument("out", f"{path} cannot be made: {error.strerror}", "a folder to write to") from error
    raise InvalidArgument("out", f"{out} holds a thousand runs of this second", "another folder")


def file_name(text: str) -> str:
    """A text as part of a file's name."""
    return re.sub(r"[^\w.-]+", ".", text).strip(".")[:60] or "unnamed"


def plain(value: Any) -> Any:
    """A value as JSON can hold it."""
    if attrs.has(type(value)):
        return {field.name: plain(getattr(value, field.name)) for field in attrs.fields(type(value))}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    if isinstance(value, Path):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


def nested(values: dict[str, Any]) -> dict[str, Any]:
    """``{"a.b": 1}`` as ``{"a": {"b": 1}}``."""
    tree: dict[str, Any] = {}
    for path, value in values.items():
        *parents, last = path.split(".")
        branch = tree
        for parent in parents:
            branch = branch.setdefault(parent, {})
        branch[last] = plain(value)
    return tree
