"""What a remark comes down to where the rules would ask: learnt from labelled sentences, said in plain words."""

from __future__ import annotations

import hashlib
import json
import math
from importlib import resources
from pathlib import Path

import memo_llm.offline
import numpy as np
import pytest
import yaml
from memo_benchmarks.sayings_scenes import scene_for
from memo_llm.offline.editing import apply
from memo_llm.offline.gist import gist_of, plain_requests
from memo_llm.offline.learnt import Learnt
from memo_llm.offline.prompt import read_subtask
from memo_llm.offline.reading import read_sentence
from memo_llm.offline.recipe import Habits
from memo_llm.offline.vocabulary import Vocabulary
from offline_prompts import MODEL, request

LEARNT_FROM = Path(__file__).parents[2] / "tools" / "offline_reader" / "requests.jsonl"
SENTENCES = yaml.safe_load(resources.files(memo_llm.offline).joinpath("gist.yaml").read_text("utf-8"))
VOCABULARY = Vocabulary.load()
ASKED_ABOUT = {"plan", "other", "nothing"}  # what has no plain words of its own
SUBTASKS = {
    "pick": "PICK(left can)",
    "place": "PLACE(red cube, blue cube)",
    "open": "OPEN(fridge)",
    "close": "CLOSE(fridge)",
    "push": "PUSH(safe button)",
    "pull": "PULL(drawer)",
    "turn": "TURN(bottle cap)",
    "pour": "POUR(can, bowl)",
    "wipe": "WIPE(plate)",
    "stir": "STIR(bowl)",
    "": "KNEAD(dough)",
    "screw on": "CLOSE(bottle)",
    "screw off": "OPEN(bottle)",
}
NAMED = {"amount": "2 cm", "angle": "by 45 degrees", "seconds": "2 seconds", "count": "3", "part": "button"}
NAMED |= {"gap": "3 cm", "place": "blue cube", "turn": "by 45 degrees", "pull": "Pull"}
PLAIN = [
    (kind, said.format(**NAMED))
    for sentence in SENTENCES.values()
    for kinds, said in (sentence.items() if isinstance(sentence, dict) else [("any", sentence)])
    for kind in (("pick", "place") if kinds == "any" else (kinds,))
    if said
]
# It asks whether the attempt went too low at all, which the empty one of this test did not.
PLAIN.remove(("place", "Stop as soon as it touches."))


def noted(words, subtask="PICK(left can)"):
    told = {"task": "t", "subtask": subtask, "words": words, "code": "open_gripper()"}
    return json.loads(MODEL.answer(request("feedback", scene_for(subtask), ended="done", plans=True, **told)).text)


def gist(words, thing, kind):
    return gist_of(words, Learnt.load().asked_for(words, [thing], kind), kind, VOCABULARY)


@pytest.mark.parametrize(("kind", "words"), PLAIN)
def test_what_a_gist_is_said_in_is_read_by_the_rules(kind, words):
    answer = noted(words, SUBTASKS[kind])
    assert answer["corrections"] and not answer["unclear"]


def test_names_sentences_and_the_classifier_go_together():
    rows = [json.loads(line) for line in LEARNT_FROM.read_text("utf-8").splitlines()]
    known = SENTENCES.keys() | ASKED_ABOUT
    assert {name for row in rows for name in row["asks"]} <= known
    assert set(Learnt.load().names) <= known
    assert len({(row["subtask"], row["says"]) for row in rows}) == len(rows)
    trained = Learnt.load().learnt_from
    assert trained == hashlib.sha256(LEARNT_FROM.read_bytes()).hexdigest(), "run tools/offline_reader/train.py"


@pytest.mark.parametrize(
    ("words", "subtask", "expected"),
    [
        ("Whoa, easy, you're crushing it. Just enough that it doesn't fall.", "PICK(left can)", "gently"),
        ("Those are eggs, for heaven's sake, hold them like eggs!", "PICK(eggs)", "gently"),
        ("Slower, you're getting it everywhere.", "STIR(food, pan)", "slower"),
        ("You're pressing so hard the plate is moving.", "WIPE(plate)", "Press less hard."),
        ("Almost. Do it two more times and I'd say it's clean.", "WIPE(plate)", "Do the motion 3 times."),
        (
            "Don't forget the edges, people eat those too.",
            "SHAKE(pepper, food)",
            "Move about over it while you tip it.",
        ),
        ("To about a right angle is fine.", "OPEN(fridge)", "Lead it through 90 degrees."),
        ("Halfway's plenty, I'm sitting right here.", "OPEN(drawer)", "Go half as far."),
        ("You can let go of it, it's in.", "PLACE(wrapper, bin)", "Let go of it afterwards."),
        (
            "It's too far left, that's going to topple. Shift it over to the right.",
            "PLACE(red cube, blue cube)",
            "to the right",
        ),
        ("It's too far to the right, it's touching the wall in there.", "PLACE(food, microwave)", "to the left"),
    ],
)
def test_what_the_rules_cannot_take_apart_is_understood_by_its_gist(words, subtask, expected):
    assert any(expected in note for note in noted(words, subtask)["corrections"])


@pytest.mark.parametrize(
    ("words", "subtask", "beside"),
    [
        ("You can leave a little space, it's touching the plate.", "PLACE(knife, table)", "the plate, 3 cm away"),
        ("Closer, it should stand right next to the other one.", "PLACE(cup, table)", "the can, 0.5 cm away"),
    ],
)
def test_something_is_put_beside_what_was_named_or_is_nearest(words, subtask, beside):
    assert noted(words, subtask)["corrections"] == [f"Put it next to {beside}."]


def test_what_was_read_into_words_that_ask_for_nothing_is_asked_about():
    answer = noted("Ah, now it's not lonely any more. That's sweet.", "PLACE(lonely object, others)")
    assert answer["corrections"] == answer["general"] == [] and "Go further." in answer["unclear"]


@pytest.mark.parametrize(
    ("words", "subtask"),
    [
        ("It's tall, from above you'll only knock it over. Go at it from the side.", "PICK(lonely object)"),
        ("Mind the bottle! Come at the cup from the other side.", "PICK(cup)"),
        ("Eww, you don't need to stick your hand in there. Just let it fall in from the top.", "PLACE(trash, bin)"),
        ("Could you take hold about ten centimetres further down next time?", "POUR(water, glass)"),
        ("You're scratching the coating, don't press down so much.", "STIR(food, pan)"),
    ],
)
def test_what_may_be_about_another_side_step_or_height_is_asked_about(words, subtask):
    answer = noted(words, subtask)
    assert answer["corrections"] == answer["general"] == [] and answer["unclear"]


@pytest.mark.parametrize(
    ("subtask", "way"),
    [("UNSCREW(cap, bottle)", -1), ("SCREW(cap, bottle)", 1), ("CLOSE(bottle)", 1), ("OPEN(bottle)", -1)],
)
def test_pressing_or_gripping_while_it_turns_leaves_the_way_it_turns(subtask, way):
    action, objects = read_subtask(subtask)
    recipe = Habits.load().recipe(action, objects)
    for words in ("Press it down while you turn it.", "Turn it."):
        for edit in read_sentence(words, VOCABULARY, (), recipe.read_as).edits:
            pressed = apply(recipe, edit, Habits.load().rough)
            assert pressed.turn * way > 0 or (words == "Turn it." and not recipe.turn), words


def test_what_was_surely_read_beside_the_gist_is_kept_where_it_was_said_outright():
    lower = noted("hold the can lower and firmly")["corrections"]
    assert "Use the gripper firmly." in lower and any("lower" in note for note in lower)
    held = noted("Don't let go of the door until it's all the way down!", "OPEN(oven)")["corrections"]
    assert "Keep hold of it." in held and not any("Do not" in note for note in held)


def test_to_press_is_what_a_press_does_anyway():
    assert noted("Press it four times.", "PRESS(button)")["corrections"] == ["Do the motion four times."]


def test_a_second_name_is_believed_only_where_it_is_likely_and_says_more():
    def asked(**likely):
        bias = np.array([math.log(share / (1 - share)) for share in likely.values()], np.float32)
        names = tuple(name.replace("_", "-") for name in likely)
        none = np.zeros((0, len(names)), np.int8)
        return Learnt(names, {}, none, np.ones(len(names), np.float32), bias, "").asked_for("", (), "")

    assert asked(slower=0.9, arc=0.7).names == {"slower"}
    assert asked(slower=0.9, arc=0.8).names == {"slower", "arc"}
    assert asked(to_angle=0.9, less_far=0.95).names == {"to-angle"}, "an angle says how far"
    assert asked(slower=0.2, arc=0.1).names == {"slower"}, "each remark has a name"
    assert asked(slower=0.9, arc=0.1).probability > asked(slower=0.9, arc=0.7).probability


def test_words_about_the_plan_are_kept_as_they_were_said():
    answer = noted("One rack up, please, it'll burn on the bottom down there.", "PLACE(food, oven)")
    assert answer["plan"] == ["One rack up, please, it'll burn on the bottom down there."]


def test_that_is_what_was_named_before_it():
    answer = noted("The wrapper's still on it! That has to come off before it goes in.", "PLACE(food, oven)")
    assert "That has to come off before it goes in." in answer["plan"]
    assert noted("That belongs in the drawer.", "PLACE(red cube, table)")["plan"] == [
        "The red cube belongs in the drawer."
    ]


def test_amounts_are_the_persons_own():
    found = gist("Oh, a good bit too high, come down by about three centimetres, love.", "can", "pick")
    assert found is not None and "3 cm" in found.text


@pytest.mark.parametrize(
    "words",
    [
        "You're much too high, three centimetres lower, and the cap is two centimetres wide.",  # which is it?
        "Grip it more gently, at 0.45 0.2.",
        "Unless it is full, squeeze it harder.",
        "Blorp the frobnicator more gently with your quuxes.",
    ],
)
def test_what_is_not_surely_the_gist_is_none(words):
    assert gist(words, "can", "pick") is None


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("Don't swing it around, it has no hinge.", "arc"),
        ("Not in circles please, go to and fro.", "circles"),
        ("Stop making arcs, it moves in and out only.", "less-far"),
        ("You don't have to be so gentle with it, just drop it in.", "gentler"),
    ],
)
def test_what_somebody_does_not_want_is_not_taken_for_the_gist(words, name):
    said = {text for kind in SUBTASKS for text in [plain_requests(kind).get(name)] if text}
    for kind in ("open", "wipe", "place"):
        found = gist(words, "drawer", kind)
        assert found is None or not any(text in found.text for text in said)
