"""The instrument that says how much of everyday speech is understood."""

from __future__ import annotations

import json

import pytest
from memo_benchmarks.sayings_scenes import scene_for
from memo_benchmarks.understanding import Saying, agreement, judged, sayings_in

from memo_core.errors import InvalidArgument
from memo_core.llm.readers import Notes


def saying(*effects: str) -> Saying:
    return Saying(
        "put-the-food-in-the-oven", "PLACE(food, oven)", "the door was shut", "open the door first", "", effects
    )


def verdict(one: Saying, notes: Notes) -> str:
    return judged(one, notes, None, None, scene_for(one.subtask))


def test_a_step_of_its_own_is_understood_where_it_is_noted_for_the_plan():
    for_plans = Notes((), (), "", plan=("Open the door first.",))
    assert verdict(saying("first OPEN"), for_plans) == "understood"
    assert verdict(saying("lower"), for_plans) == "misread"
    assert verdict(saying("first OPEN"), Notes((), (), "which one?")) == "asked back"


def test_what_was_noted_of_a_sentence_without_effects_is_left_to_judges(tmp_path):
    file = tmp_path / "said.jsonl"
    row = {"task": "t", "subtask": "OPEN(fridge)", "seen": "it slipped", "says": "firmer", "judges": ["asked", "asked"]}
    file.write_text(json.dumps(row) + "\n", "utf-8")
    (one,) = sayings_in(file)
    assert one.says == "firmer" and one.effects == ()
    assert verdict(one, Notes(("Use the gripper firmly.",), (), "")) == "to be judged"
    assert verdict(one, Notes((), (), "how?")) == "asked back"


def test_agreement_of_two_judges_is_corrected_for_chance(tmp_path):
    file = tmp_path / "judged.jsonl"
    pairs = [("understood", "understood")] * 4 + [("misread", "misread")] * 4 + [("understood", "misread")] * 2
    file.write_text("".join(json.dumps({"says": "x", "judges": pair}) + "\n" for pair in pairs), "utf-8")
    report = agreement(file)
    assert report["agreement"] == 0.8
    assert report["kappa"] == round((0.8 - 0.48) / (1 - 0.48), 3)  # 0.6 x 0.4 + 0.4 x 0.6 by chance
    assert report["judge_a"] == {"misread": 0.4, "understood": 0.6}


def test_a_sentence_without_judges_is_named(tmp_path):
    file = tmp_path / "judged.jsonl"
    file.write_text('{"says": "x"}\n', "utf-8")
    with pytest.raises(InvalidArgument, match="sentence 1"):
        agreement(file)
