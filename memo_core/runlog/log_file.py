"""The file of a run log: JSON lines that are only ever appended to (format: docs/run-log.md)."""

from __future__ import annotations

import json
import os
import threading
import time
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import InvalidArgument
from memo_core.runlog.whole_files import writing
from memo_core.text.parsing import encodable, parse_json
from memo_core.text.redaction import Redactor

VERSION = 1
FILE = "log.jsonl"
_OPTION = "--resume"


@attrs.frozen(eq=False)
class Lines:
    """The lines of a log file, and the number of bytes at its end that belong to an incomplete line."""

    records: tuple[dict[str, Any], ...]
    torn: int = 0


def read_lines(folder: Path) -> Lines:
    """Read a run's log. An incomplete last line is left out. Raises ``InvalidArgument`` if there is no run, its log is
    missing or has another version, or a line is damaged."""
    file = folder / FILE
    if not folder.is_dir():
        raise InvalidArgument(_OPTION, f"{folder} is no folder", "the folder of a run, e.g. runs/…")
    try:
        data = file.read_bytes()
    except FileNotFoundError:
        if (folder / "events.jsonl").exists():
            problem = f"the run in {folder} was made by an older version of MEMO: it can be read, not resumed"
            raise InvalidArgument(_OPTION, problem, f"a run with {FILE}") from None
        raise InvalidArgument(_OPTION, f"{folder} holds no run ({FILE} is missing)", "the folder of a run") from None
    except OSError as error:
        raise InvalidArgument(_OPTION, f"{file}: {error.strerror}", "the folder of a run") from None
    whole = data.rfind(b"\n") + 1
    records = [_record(file, number, line) for number, line in enumerate(data[:whole].split(b"\n")[:-1], start=1)]
    if not records:
        raise InvalidArgument(_OPTION, f"{file} is empty: the run was interrupted before it began", "a run that began")
    version = records[0].get("memo_run_log")
    if version is None:
        raise InvalidArgument(_OPTION, f"{file}, line 1 is damaged: it is not the head of a run log", "a run log")
    if version != VERSION:
        problem = f"{file} is of version {version}: it can be read, not resumed"
        raise InvalidArgument(_OPTION, problem, f"a run log of version {VERSION}")
    head = {"task": ""} | records[0]
    for key in ("run", "task"):
        if not isinstance(head.get(key), str) or not encodable(head[key]):
            raise damaged(file, 1, f"{key!r} is no text that can be stored")
    return Lines(tuple(records), len(data) - whole)


def _record(file: Path, number: int, line: bytes) -> dict[str, Any]:
    try:
        record = parse_json(line)
    except ValueError as error:
        raise damaged(file, number, str(error)) from None
    if not isinstance(record, dict):
        raise damaged(file, number, "it is not a JSON object")
    return record


def damaged(file: Path, number: int, why: str) -> InvalidArgument:
    """The error for a line that is not a record of a run log."""
    return InvalidArgument(
        _OPTION, f"{file}, line {number} is damaged ({why})", "the file as the run wrote it, and its version of MEMO"
    )


class LogFile:
    """Appends to a run's log. Safe to use from several threads."""

    def __init__(self, folder: Path) -> None:
        """Creates the file or continues it; an incomplete last line is removed (``cut``: its number of bytes)."""
        self._lock = threading.Lock()
        self._redact = Redactor.of_environment()
        self._path = path = folder / FILE
        with writing(path):
            self.cut = _cut_torn_line(path) if path.exists() else 0
            self._file = path.open("ab")

    def append(self, record: dict[str, Any], sync: bool) -> None:
        """Add one line with the time. When this returns the operating system has it; with ``sync`` it is on disk with
        all lines before it. Nothing is written after ``close``."""
        line = self._redact(json.dumps(record | {"t": round(time.time(), 3)}, ensure_ascii=False)) + "\n"
        with self._lock:
            if self._file.closed:
                return
            with writing(self._path):
                self._file.write(line.encode("utf-8", "surrogatepass"))
                self._file.flush()
                if sync:
                    os.fsync(self._file.fileno())

    def close(self) -> None:
        """Idempotent."""
        with self._lock:
            self._file.close()


def _cut_torn_line(path: Path) -> int:
    data = path.read_bytes()
    whole = data.rfind(b"\n") + 1
    if whole < len(data):
        os.truncate(path, whole)
    return len(data) - whole
