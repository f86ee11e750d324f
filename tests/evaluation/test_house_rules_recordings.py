"""The pilot on the suite ``house-rules`` with a real model (docs/house-rules.md), played back from its recordings: the
notes made of people's words, and the runs with and without them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from memo_core.evaluation.evaluating import evaluate
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.plugins.registry import Registry
from memo_core.process.stop_switch import StopSwitch
from memo_core.skillbook.book import Skillbook
from memo_core.study.study import loader, shared_settings
from tests.support.commands import run
from tests.support.house_book import record_remarks

pytestmark = [pytest.mark.sim, pytest.mark.slow, pytest.mark.timeout(1800)]

ROOT = Path(__file__).parents[2]
RECORDED = ROOT / "tests" / "data" / "recordings" / "house-rules"
COMPARED = ("method", "task", "scene", "success", "reason", "lesson_needed", "lesson_served")


@pytest.fixture(scope="module")
def book(tmp_path_factory):
    file = tmp_path_factory.mktemp("book") / "house.db"
    record_remarks(RECORDED / "remarks.yaml", file)
    notes = RECORDED / "notes.jsonl.gz"
    answers = f"llm={{backend: replay, file: {notes}, match: situation, inner: {{backend: offline}}}}"
    code, out, err = run(["skillbook", "retry", "--book", str(file), "--set", answers])
    assert code == 0, out + err
    return file


def test_notes_of_the_houses_rules_are_among_those_of_others(book):
    expected = json.loads((RECORDED / "notes.json").read_text())
    with Skillbook(f"sqlite:///{book}", read_only=True) as opened:
        entries = [[str(entry.key), entry.text] for entry in opened.entries()]
    assert [entry for entry in expected if entry not in entries] == []
    assert len(entries) >= 50 + len(expected)


def test_the_pilot_plays_back_as_it_was(book, tmp_path):
    replay = (f"evaluation.replay={RECORDED}", "evaluation.replay_match=situation", f"evaluation.books=[{book}]")
    given = [*replay, "evaluation.jobs=2", *shared_settings(tmp_path / "evaluation")]
    load = loader(Registry(), ROOT / "examples" / "house-rules.yaml", ALL_SECTIONS, given)
    rows = evaluate(load, tmp_path, StopSwitch()).rows
    expected = json.loads((RECORDED / "rows.json").read_text())
    found = [{name: row[name] for name in COMPARED} for row in rows]
    assert sorted(found, key=repr) == sorted(expected, key=repr)
