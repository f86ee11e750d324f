"""Recordings of language models: swapped, damaged, cut off, compressed beyond measure."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from random import Random
from typing import Any

from memo_benchmarks.fuzz.kind import Command, Kind, Memo
from memo_benchmarks.fuzz.mutations import damaged_bytes, damaged_lines

TASK = "put-the-cube-away"
TEACHER = {
    "backend": "scripted",
    "who": "ana",
    "lines": [
        {"subtask": "*", "attempt": 1, "say": "no, go higher and then straight down"},
        {"subtask": "*", "attempt": 2},
    ],
    "task": ["no, it is not done", ""],
}
SETTINGS: dict[str, Any] = {
    "task": TASK,
    "teacher": TEACHER,
    "skillbook": {"url": "book.db"},
    "run": {"video": "off", "retry_wait_s": 0, "retries": 1},
}
_BOMB_BYTES = 1 << 29


class Recordings(Kind):
    name = "recordings"

    def prepare(self, place: Path, memo: Memo) -> None:
        (place / "a.yaml").write_text(json.dumps(SETTINGS))
        memo(["run", "a.yaml", "--record", "calls.jsonl"])
        self._records = [json.loads(line) for line in (place / "calls.jsonl").read_bytes().splitlines()]
        self._bomb = gzip.compress(b'{"memo_recording": 1}\n' + bytes(_BOMB_BYTES), 6)

    def write(self, place: Path, draw: Random) -> list[Command]:
        (place / "a.yaml").write_text(json.dumps(SETTINGS))
        data, name = damaged_lines(self._records, draw), "calls.jsonl"
        how = draw.random()
        if how < 0.15:
            data, name = gzip.compress(data, 1), "calls.jsonl.gz"
            if draw.random() < 0.7:
                data = damaged_bytes(data, draw)
        elif how < 0.152:
            data, name = self._bomb, "calls.jsonl.gz"
        (place / name).write_bytes(data)
        option = "--record" if draw.random() < 0.1 else "--replay"
        return [["run", "a.yaml", option, name, *(["--json"] if draw.random() < 0.2 else [])]]
