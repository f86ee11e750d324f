"""Books of others, imported and looked at: exports, and lorebooks as JSON and as pickles."""

from __future__ import annotations

import json
import pickle
from pathlib import Path
from random import Random
from typing import Any

from memo_benchmarks.fuzz.example_book import write_example
from memo_benchmarks.fuzz.kind import Command, Kind, Memo
from memo_benchmarks.fuzz.mutations import Raw, damaged_bytes, damaged_lines, damaged_value, text

BOOK = ["--book", "book.db"]
LOOKS: tuple[Command, ...] = (
    ["skillbook", "history", *BOOK],
    ["skillbook", "history", "OPEN(door)", *BOOK],
    ["skillbook", "list", *BOOK],
    ["skillbook", "stats", *BOOK, "--json"],
    ["skillbook", "export", *BOOK],
    ["skillbook", "books", *BOOK],
    ["skillbook", "check", *BOOK],
    ["skillbook", "show", "1", *BOOK],
    ["skillbook", "why", "OPEN(door)", *BOOK],
    ["skillbook", "search", "an arc", *BOOK],
    ["skillbook", "diff", "1", *BOOK],
)


class Imports(Kind):
    name = "imports"

    def prepare(self, place: Path, memo: Memo) -> None:
        write_example(place / "other.db")
        exported = memo(["skillbook", "export", "--book", "other.db"])
        self._records = [json.loads(line) for line in exported.splitlines()]
        write_example(place / "here.db", notes=2)
        self._here = (place / "here.db").read_bytes()
        items = [
            {"key": "OPEN(door) scene table", "value": "Pull along an arc."},
            {"key": "GENERAL scene table", "value": "Go slowly."},
            {"key": "TEMPLATE OPEN(door)", "value": "def f():\n    pass\n"},
            {"key": "no key", "value": "nothing"},
        ]
        self._lorebook: Any = {"vectors": [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6], [0.7, 0.8]], "metadata": items}

    def write(self, place: Path, draw: Random) -> list[Command]:
        if draw.random() < 0.5:
            (place / "book.db").write_bytes(self._here)
        how = draw.random()
        name = "other.jsonl"
        if how < 0.75:
            data = damaged_lines(self._records, draw)
        else:
            name, data = ("lore.json", self._json(draw)) if how < 0.87 else ("lore.pkl", self._pickle(draw))
        (place / name).write_bytes(data)
        command = ["skillbook", "import", name, *BOOK]
        for option in (["--dry-run"], ["--json"], ["--from", draw.choice(("memo", "lorebook"))], ["--whose", "x"]):
            if draw.random() < 0.08:
                command += option
        # A book that was taken in can be looked at; where none was, the first look says that there is none.
        return [command, *draw.sample(LOOKS, 2)]

    def _json(self, draw: Random) -> bytes:
        raw = Raw(draw)
        written = raw.dumped(damaged_value(self._lorebook, draw, raw, draw.choice((1, 2, 4))))
        data = written.encode("utf-8", "surrogatepass")
        return damaged_bytes(data, draw) if draw.random() < 0.2 else data

    def _pickle(self, draw: Random) -> bytes:
        lorebook = json.loads(json.dumps(self._lorebook))
        for _ in range(draw.choice((0, 1, 2))):
            owner = draw.choice(lorebook["metadata"])
            owner[draw.choice(("key", "value", text(draw)))] = draw.choice(
                (text(draw), 2**70, float("nan"), None, b"\xff", (1, 2), {1: 2}, [[]], 1j, frozenset({1}))
            )
        data = pickle.dumps(lorebook, protocol=draw.randrange(6))
        return damaged_bytes(data, draw) if draw.random() < 0.7 else data
