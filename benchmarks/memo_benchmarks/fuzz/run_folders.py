"""Folders of runs that were cut off: log, events, kept calls, config and summary damaged, then resumed. And ledgers."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from random import Random

from memo_benchmarks.fuzz.kind import Command, Kind, Memo
from memo_benchmarks.fuzz.mutations import damaged_bytes, damaged_lines, damaged_text
from memo_benchmarks.fuzz.recordings import SETTINGS
from memo_core.parsing import parse_json

LOG = "log.jsonl"


class RunFolders(Kind):
    name = "run-folders"

    def prepare(self, place: Path, memo: Memo) -> None:
        settings = SETTINGS | {"run": SETTINGS["run"] | {"study_ledger": "ledger.jsonl"}}
        (place / "a.yaml").write_text(json.dumps(settings))
        memo(["run", "a.yaml"])
        [folder] = (place / "runs").iterdir()
        self._files = {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.is_file()}
        self._book = (place / "book.db").read_bytes()
        self._ledger = (place / "ledger.jsonl").read_bytes()

    def write(self, place: Path, draw: Random) -> list[Command]:
        if draw.random() < 0.1:
            (place / "ledger.jsonl").write_bytes(self._damaged_lines(self._ledger, draw))
            return [["budget", "ledger.jsonl"]]
        (place / "book.db").write_bytes(self._book)
        files = dict(self._files)
        lines = files[LOG].splitlines(keepends=True)
        files[LOG] = b"".join(lines[: draw.randint(1, len(lines))])  # killed there
        if draw.random() < 0.7:
            files.pop("summary.json", None)
        for _ in range(draw.choice((1, 1, 2))):
            self._damage(files, draw)
        for name, data in files.items():
            (place / "run" / name).parent.mkdir(parents=True, exist_ok=True)
            (place / "run" / name).write_bytes(data)
        if draw.random() < 0.03:  # a folder where a file was
            name = draw.choice(sorted(files))
            (place / "run" / name).unlink()
            (place / "run" / name).mkdir()
        if draw.random() < 0.03:
            shutil.rmtree(place / "run" / "calls", ignore_errors=True)
        return [["run", "--resume", "run", *(["--json"] if draw.random() < 0.2 else [])]]

    def _damage(self, files: dict[str, bytes], draw: Random) -> None:
        others = [name for name in sorted(files) if name.startswith("calls/")] or [LOG]
        often = (LOG, LOG, LOG, "events.jsonl", "config.yaml", draw.choice(others), draw.choice(others))
        name = draw.choice((*often, draw.choice(sorted(files))))
        if name not in files:
            return
        data, how = files[name], draw.random()
        if how < 0.08:
            del files[name]
        elif how < 0.12:
            files[name] = b""
        elif how < 0.2:
            files[name] = files[draw.choice(sorted(files))]
        elif name == "config.yaml":
            changed = damaged_text(data.decode(errors="replace"), draw) if how < 0.7 else ""
            files[name] = changed.encode("utf-8", "surrogatepass") or damaged_bytes(data, draw)
        else:
            files[name] = self._damaged_lines(data, draw) if how < 0.85 else damaged_bytes(data, draw)

    def _damaged_lines(self, data: bytes, draw: Random) -> bytes:
        try:
            records = [parse_json(line) for line in data.splitlines()]
        except ValueError:  # one document, or no JSON
            try:
                records = [parse_json(data)]
            except ValueError:
                return damaged_bytes(data, draw)
        return damaged_lines(records, draw)
