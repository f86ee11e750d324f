"""The instrument that says how much of everyday speech is understood."""

from __future__ import annotations

import json

import attrs
import pytest
from memo_benchmarks.sayings_scenes import scene_for
from memo_benchmarks.understanding import Saying, agreement, bench_understanding, judged, sayings_in
from memo_llm.offline.model import OfflineModel

from memo_core.errors import InvalidArgument
from memo_core.llm.prompt_files import Prompts
from memo_core.llm.readers import Notes
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_llm import ScriptedModel


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


def test_what_was_said_of_a_program_is_noted_with_that_program_in_view():
    notes = '{"corrections": ["Press harder than with 4 N."], "general": [], "plan": [], "unclear": ""}'
    model = ScriptedModel({"feedback": [notes] * 2, "code": ["```python\nlook()\n```"] * 3})
    code = "press([0, 0, -1], 4.0, seconds=0.5)"
    of_none = Saying("punch holes", "PRESS(hole punch)", "it barely went down", "Harder!")
    of_a_program = attrs.evolve(of_none, code=code, printed="4 N")
    heard = bench_understanding(model, [of_a_program, of_none], skill_library(BUILTIN_SKILLS), Prompts())
    assert [one.notes for one in heard] == [("Press harder than with 4 N.",)] * 2
    first, second = model.prompts("feedback")
    assert code in first and "## Printed by the code" in first
    assert code not in second and "look()" in second, "the model's own"
    assert [request.phase for request in model.asked] == ["feedback", "code", "code", "feedback", "code"]


def test_what_the_hand_did_already_as_it_was_noted_is_told_to_judges():
    model = OfflineModel()
    model.open()
    from_above = Saying("pick-left-can", "PICK(left can)", "it bumped the other", "Can you come down from above?")
    level = attrs.evolve(from_above, says="Take it higher up, by two centimetres.")
    already, differently = bench_understanding(model, [from_above, level], skill_library(BUILTIN_SKILLS), Prompts())
    assert already.changed == () and already.already == ("from above",) and already.verdict == "to be judged"
    assert differently.changed and differently.already == ()


@pytest.mark.parametrize(
    ("subtask", "owner", "part"),
    [
        ("PRESS(toaster lever)", "toaster", "toaster lever"),
        ("PRESS(start button)", "microwave", "start button"),
        ("TURN(faucet lever)", "faucet", "faucet lever"),
        ("TURN_ON(oven knob)", "stove", "oven knob"),
        ("PRESS(button)", "microwave", "button"),
    ],
)
def test_buttons_levers_and_knobs_are_parts_of_something(subtask, owner, part):
    (node,) = [node for node in scene_for(subtask).nodes if node.label == part]
    assert node.part_of == owner and node.kind == "part"
