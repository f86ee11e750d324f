"""What people said in a run that writes to no book: one file per person in the run's folder, see docs/run-log.md.

    words/NAME.jsonl: {"number": 1, "entry": 14, "who": "ana", "words": "…", "state": "…", "time": 1763781123.4}

The log refers to words by their number only, so that a person's words can be withdrawn by rewriting one file.
"""

from __future__ import annotations

import json
import re
import time
from pathlib import Path
from typing import Any

from memo_core.errors import InvalidArgument
from memo_core.runlog.whole_files import write_whole
from memo_core.text.parsing import parse_json

FOLDER = "words"


class WordsFile:
    """The words of one person in one run; kept in memory if there is no folder."""

    def __init__(self, folder: Path | None, who: str) -> None:
        self._who = who
        self._path = None if folder is None else folder / FOLDER / f"{_file_name(who)}.jsonl"
        self._lines: list[dict[str, Any]] | None = None

    def keep(self, words: str, entry: int, state: str) -> int:
        """Store words that are the result of this log entry and return their number. On disk when this returns."""
        lines = self._read()
        number = max((int(line["number"]) for line in lines), default=0) + 1
        line = {"number": number, "entry": entry, "who": self._who, "words": words, "state": state}
        lines.append(line | {"time": time.time()})
        if self._path is not None:
            write_whole(self._path, "".join(json.dumps(one, ensure_ascii=False) + "\n" for one in lines))
        return number

    def kept(self, entry: int) -> tuple[int, str, str] | None:
        """Number, words and state stored for the entry, if any."""
        found = [line for line in self._read() if line["entry"] == entry]
        return (found[-1]["number"], found[-1]["words"], found[-1]["state"]) if found else None

    def read(self, number: int) -> str:
        """Raises ``InvalidArgument`` if the words were removed."""
        for line in self._read():
            if line["number"] == number:
                return str(line["words"])
        raise InvalidArgument("--resume", f"words {number} of {self._who} were withdrawn", "a run that has its words")

    def _read(self) -> list[dict[str, Any]]:
        if self._lines is None:
            self._lines = []
            if self._path is not None and self._path.exists():
                try:
                    text = self._path.read_text(encoding="utf-8", errors="surrogatepass")
                    self._lines = [parse_json(line) for line in text.splitlines()]
                    _ = [(line["number"], line["entry"], line["words"], line["state"]) for line in self._lines]
                except (OSError, ValueError, KeyError, TypeError) as error:
                    self._lines = None
                    problem = f"{self._path} is damaged ({error!r})"
                    raise InvalidArgument("--resume", problem, "the file as the run wrote it") from None
        return self._lines


def _file_name(who: str) -> str:
    return re.sub(r"[^\w.-]+", ".", who).strip(".")[:60] or "unnamed"
