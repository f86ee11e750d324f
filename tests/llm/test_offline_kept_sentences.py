"""What the offline backend makes of 440 everyday sentences, beside what it was judged to make of them.

Notes that nobody has judged yet count as misread: judge them, and keep the verdict in ``offline_verdicts.jsonl``.
"""

from __future__ import annotations

import json
import re
from collections import Counter
from pathlib import Path

import pytest
from memo_benchmarks.sayings_scenes import scene_for
from offline_prompts import MODEL, request

SAYINGS = Path(__file__).parents[1] / "sayings"
KEPT = SAYINGS / "offline_verdicts.jsonl"
ANSWERS = SAYINGS / "everyday_answers.jsonl"  # what people answered who were asked back; the worse of two verdicts


def compared(notes):
    """Notes without what they are relative to, which depends on the code that was tried."""
    return [re.sub(r"(?: than in that attempt|; that attempt).*", ".", note).replace("..", ".") for note in notes]


def verdict(row):
    told = {"task": row["task"], "subtask": row["subtask"], "words": row["says"], "code": "open_gripper()"}
    asked = request("feedback", scene_for(row["subtask"]), ended="a person found fault with it", plans=True, **told)
    answer = json.loads(MODEL.answer(asked).text)
    plans = [f"for plans: {note}" for note in answer.get("plan", ())]
    notes = list(dict.fromkeys([*answer["corrections"], *answer["general"], *plans]))
    if not notes:
        praised = row["verdict"] == "understood" and not row["noted"]
        return "understood" if praised and "right as it was" in answer["unclear"] else "asked"
    return row["verdict"] if compared(notes) == compared(row["noted"]) else "misread"


@pytest.fixture(scope="module")
def shares():
    rows = [json.loads(line) for line in KEPT.read_text("utf-8").splitlines()]
    counts = Counter(verdict(row) for row in rows)
    assert sum(counts.values()) == 440
    return {name: count / len(rows) for name, count in counts.items()}


def test_no_more_is_misread_than_was_measured(shares):
    assert shares.get("misread", 0.0) <= 11 / 440


def test_no_less_is_understood_than_was_measured(shares):
    assert shares["understood"] >= 265 / 440


def test_of_what_people_answer_no_more_is_asked_again_or_misread_than_was_measured():
    rows = [json.loads(line) for line in ANSWERS.read_text("utf-8").splitlines()]
    counts = Counter(verdict(row) for row in rows)
    assert len(rows) == 157 and counts["asked"] <= 28 and counts["misread"] <= 8 and counts["understood"] >= 79
