"""Measure how much of the prompts of runs a provider can cache: the longest beginning shared with an earlier question.

    python tools/prompt_prefixes.py RUN_FOLDER... > results/prompts.json

Questions of a phase are compared with all earlier ones, in the order of the folders, system message first. Providers
cache beginnings of some thousand characters and more, and only for minutes: this is the most that caching can save.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from itertools import takewhile
from pathlib import Path
from typing import Any

CHARACTERS_PER_TOKEN = 4  # about


def prompts_of(run: Path) -> list[tuple[str, str]]:
    """Phase and text of each question of a run, in order."""
    calls = [json.loads(file.read_text(encoding="utf-8")) for file in sorted((run / "calls").glob("*.json"))]
    return [(call["phase"], "".join(message["text"] for message in call["messages"])) for call in calls]


def shared(one: str, other: str) -> int:
    """Number of characters that two texts begin with alike."""
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(one, other, strict=False)))


def measured(runs: list[Path]) -> list[dict[str, Any]]:
    """A row for each phase, and one for all: questions, tokens, and those not shared with an earlier question."""
    texts: dict[str, list[str]] = defaultdict(list)
    for phase, text in (prompt for run in runs for prompt in prompts_of(run)):
        texts[phase].append(text)
    rows = []
    for phase, asked in sorted(texts.items()):
        new = [
            len(text) - max((shared(text, earlier) for earlier in asked[:place]), default=0)
            for place, text in enumerate(asked)
        ]
        alike = min((shared(asked[0], text) for text in asked[1:]), default=0)
        rows.append(_row(phase, len(asked), alike, sum(map(len, asked)), sum(new), len(runs)))
    total = {name: sum(row[name] for row in rows) for name in ("questions", "tokens a run", "of these new")}
    rows.append({**rows[0], "phase": "all", "tokens alike in all": "", **total})
    return rows


def _row(phase: str, questions: int, alike: int, characters: int, new: int, runs: int) -> dict[str, Any]:
    return {
        "phase": phase,
        "questions": questions,
        "tokens alike in all": alike // CHARACTERS_PER_TOKEN,
        "tokens a run": characters // CHARACTERS_PER_TOKEN // runs,
        "of these new": new // CHARACTERS_PER_TOKEN // runs,
    }


if __name__ == "__main__":
    found = measured([Path(folder) for folder in sys.argv[1:]])
    print(json.dumps({"command": "python tools/prompt_prefixes.py runs/*", "note": "", "rows": found}, indent=1))
