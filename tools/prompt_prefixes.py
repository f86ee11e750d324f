"""Measure how much of the prompts of runs a provider can cache: the longest prefix shared with an earlier question.

    python tools/prompt_prefixes.py RUN_FOLDER... > results/prompts.json

Questions are compared with all earlier ones, in the order of the folders, system message first. Providers cache
prefixes of some thousand characters and more, and only for minutes, so this is the most that caching can save.
"""

from __future__ import annotations

import json
import sys
from collections import defaultdict
from itertools import takewhile
from pathlib import Path
from typing import Any

CHARACTERS_PER_TOKEN = 4


def prompts_of(run: Path) -> list[tuple[str, str]]:
    """Phase and text of each question of a run, in order; questions asked again after an unreadable answer too."""
    calls = [json.loads(file.read_text(encoding="utf-8")) for file in sorted((run / "calls").glob("*.json"))]
    return [(call["phase"], "".join(message["text"] for message in call["messages"])) for call in calls]


def shared(one: str, other: str) -> int:
    """Number of characters that two texts begin with alike."""
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(one, other, strict=False)))


def measured(runs: list[Path]) -> dict[str, Any]:
    """Per phase: questions, their median length, share of it that an earlier question of the phase begins with."""
    earlier: dict[str, list[str]] = defaultdict(list)
    rows: dict[str, list[tuple[int, int]]] = defaultdict(list)
    for phase, text in (prompt for run in runs for prompt in prompts_of(run)):
        cached = max((shared(text, one) for one in earlier[phase]), default=0)
        rows[phase].append((len(text), cached))
        earlier[phase].append(text)
    every = [row for phase in rows.values() for row in phase]
    return {
        "runs": len(runs),
        "phases": {
            phase: {
                "questions": len(found),
                "characters": sum(length for length, _ in found) // len(found),
                "common_prefix": min((shared(earlier[phase][0], one) for one in earlier[phase][1:]), default=None),
                "shared": round(sum(cached for _, cached in found[1:]) / max(1, sum(n for n, _ in found[1:])), 3),
            }
            for phase, found in sorted(rows.items())
        },
        "tokens_a_run": round(sum(length for length, _ in every) / CHARACTERS_PER_TOKEN / len(runs)),
        "uncached_tokens_a_run": round(sum(n - cached for n, cached in every) / CHARACTERS_PER_TOKEN / len(runs)),
    }


if __name__ == "__main__":
    print(json.dumps(measured([Path(folder) for folder in sys.argv[1:]]), indent=1))
