"""A file of results, one JSON object per line, appended as they come, so that an interrupted process can be
continued."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from memo_core.text.parsing import parse_json


def read_lines(file: Path) -> Iterator[tuple[int, Any]]:
    """(line number, value) of each line; None for a line that is not JSON. An incomplete line of a killed process is
    skipped, wherever it is in the file. Raises ``OSError``."""
    for number, line in enumerate(file.read_bytes().split(b"\n"), 1):
        if not line:
            continue
        text = line.decode(errors="replace")
        try:
            yield number, parse_json(text)
        except ValueError:
            if not text.startswith("{") or text.endswith("}"):
                yield number, None


def append_line(file: Path, value: Any) -> None:
    """Add a line; it is on the disk when this returns. Makes the folder. Raises ``OSError``."""
    _append(file, json.dumps(value, ensure_ascii=False).encode() + b"\n")


def make_writable(file: Path) -> None:
    """Make an empty file if there is none. Raises ``OSError`` if none can be written."""
    _append(file, b"")


def _append(file: Path, data: bytes) -> None:
    """Append bytes as a separate line. Raises ``OSError``."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("ab+") as lines:
        if lines.tell():
            lines.seek(-1, os.SEEK_END)
            if lines.read(1) != b"\n":  # the last line was cut off
                lines.write(b"\n")
        lines.write(data)
        lines.flush()
        os.fsync(lines.fileno())
