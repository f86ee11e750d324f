"""The folder of one run. Everything is on disk when the call that writes it returns; complete files appear atomically.

config.yaml           what was asked for, resolved, without secrets
log.jsonl             every effect of the run before and after it happened: what `memo run --resume` runs again from
events.jsonl          everything that was observed, one JSON object a line, as it happened
calls/0007-plan.json  each question to a model and its answer; the number is that of its entry in the log
code/01-OPEN.microwave/attempt-1.py
retrieved/…           which entries a subtask was served, and why
words/…               what people said in a run that writes to no book
video/…               an attempt each
looks/0003-front.png  what perception saw in each look, drawn over the pictures, if it has any
summary.json          how it ended; missing when the run was killed
trial.json            who, with which arm and commit, and how it was judged; of runs on a real robot
"""

from __future__ import annotations

import json
import re
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from memo_core.errors import InvalidArgument
from memo_core.events import CodeWritten, Event, Retrieved
from memo_core.runlog import event_log
from memo_core.runlog.event_log import EventLog, read_events
from memo_core.runlog.whole_files import write_whole
from memo_core.text.redaction import Redactor


class RunFolder:
    """Writes one run's folder. Safe to use from several threads, since late answers of models arrive in their own
    threads."""

    def __init__(self, path: Path, again: bool = False, option: str = "") -> None:
        """Makes the folder, or with ``again`` continues in it. Raises ``InvalidArgument`` naming ``option`` if it holds
        a run already; with ``again``, if it holds none or one that is still going on."""
        option = option or ("--resume" if again else "--out")
        if (path / event_log.FILE).exists() != again:
            problem = "holds no run" if again else "already holds a run"
            raise InvalidArgument(option, f"{path} {problem}", "the folder of a run" if again else "a new folder")
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            problem = f"{path} cannot be made: {error.strerror}"
            raise InvalidArgument(option, problem, "a folder to write to") from error
        self.path = path
        self._redact = Redactor.of_environment()
        self._events = EventLog(path, option)
        self.mended = self._events.cut_incomplete_line() if again else 0  # bytes
        self._retrieved = sum(event["event"] == "Retrieved" for event in read_events(path)) if again else 0

    def add_look(self, pictures: Mapping[str, bytes]) -> None:
        """Keep the pictures of one look, camera's name -> PNG, under the next number."""
        taken = [int(file.name[:4]) for file in (self.path / "looks").glob("[0-9][0-9][0-9][0-9]-*.png")]
        number = max(taken, default=0) + 1
        for name, picture in pictures.items():
            self.write(f"looks/{number:04d}-{re.sub(r'[^A-Za-z0-9_-]', '_', name)}.png", picture)

    def close(self) -> None:
        """Idempotent."""
        self._events.close()

    def write(self, name: str, content: str | bytes) -> Path:
        """A whole file, on disk when this returns; never half of it."""
        return write_whole(self.path / name, self._redact(content) if isinstance(content, str) else content)

    def write_json(self, name: str, value: Any) -> Path:
        return self.write(name, json_text(value))

    def config(self, values: dict[str, Any]) -> None:
        import yaml

        self.write("config.yaml", yaml.safe_dump(nested(values), sort_keys=False, allow_unicode=True))

    def event(self, event: Event, at: str | None = None) -> None:
        """Append one event; ``at``: its position in the run (``RunLog.place``). Passed to the operating system at once,
        so that it survives the end of this process."""
        place = {} if at is None else {"at": at}
        if self._events.closed:
            return
        # Files first: an event whose line is missing is sent again.
        if isinstance(event, Retrieved):
            self._retrieved += 1
            self.write_json(f"retrieved/{self._retrieved:02d}-{file_name(event.subtask)}.json", event)
        elif isinstance(event, CodeWritten):
            self.write(_code_name(event), event.code)
        line = json.dumps({"event": type(event).__name__, **plain(event), **place}, ensure_ascii=False)
        self._events.append(self._redact(line))


def _code_name(event: CodeWritten) -> str:
    attempt = attempt_name(event.attempt, event.take) + (f"-repair-{event.repair}" if event.repair else "")
    return f"code/{event.number:02d}-{file_name(event.subtask)}/{attempt}.py"


def json_text(value: Any) -> str:
    """A value as an indented JSON document."""
    return json.dumps(plain(value), indent=1, ensure_ascii=False) + "\n"


def new_run_folder(out: Path, task: str, seed: int) -> Path:
    """A unique name for a run's folder under ``out``: date, time, task, seed."""
    stamp = time.strftime("%Y-%m-%dT%H-%M-%S")
    for number in range(1, 1000):
        path = out / f"{stamp}-{file_name(task)}-seed{seed}{f'-{number}' if number > 1 else ''}"
        try:
            path.mkdir(parents=True)
            return path
        except FileExistsError:
            continue
        except OSError as error:
            raise InvalidArgument(
                "--out", f"{path} cannot be made: {error.strerror}", "a folder to write to"
            ) from error
    raise InvalidArgument("--out", f"{out} holds a thousand runs of this second", "another folder")


def attempt_name(attempt: int, take: int) -> str:
    """The file name of an attempt; an attempt that was restarted has its own files."""
    return f"attempt-{attempt}" + (f"-take-{take}" if take > 1 else "")


def file_name(text: str) -> str:
    """A text as part of a file's name."""
    return re.sub(r"[^\w.-]+", ".", text).strip(".")[:60] or "unnamed"


def plain(value: Any) -> Any:
    """A value as JSON values."""
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
    """``{"a.b": 1, "c[0].d": 2}`` as ``{"a": {"b": 1}, "c": [{"d": 2}]}``."""
    tree: dict[str, Any] = {}
    for path, value in values.items():
        *parents, last = re.sub(r"\[(\d+)\]", r".\1", path).split(".")
        branch = tree
        for parent in parents:
            branch = branch.setdefault(parent, {})
        branch[last] = plain(value)
    return {name: _listed(branch) for name, branch in tree.items()}


def flat(tree: Any, path: str = "") -> dict[str, Any]:
    """A tree of values by dotted paths; lists are values."""
    if not isinstance(tree, dict) or not tree:
        return {path: tree if tree not in ({}, []) else None}
    items = [(f"{path}.{key}" if path else str(key), value) for key, value in tree.items()]
    return {key: value for name, branch in items for key, value in flat(branch, name).items()}


def _listed(branch: Any) -> Any:
    """The branches below 0, 1, 2, … as a list."""
    if not isinstance(branch, dict):
        return branch
    inner = {name: _listed(value) for name, value in branch.items()}
    if inner and all(name == str(index) for index, name in enumerate(inner)):
        return list(inner.values())
    return inner
