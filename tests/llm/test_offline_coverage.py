"""What is not accounted for is asked about: no request is acted on while a word of it that matters is unread."""

from __future__ import annotations

import json

import pytest
from offline_prompts import MODEL, box_with_door, request, scene, thing

CRATE, *_ = box_with_door()
JARS = scene(thing("red jar", (0.4, 0.2, 0.05)), thing("green jar", (0.4, -0.2, 0.05)))


def said(words, graph=JARS, subtask="PICK_UP(red jar)"):
    asked = request("feedback", graph, task="t", subtask=subtask, code="open_gripper()", ended="done", words=words)
    return json.loads(MODEL.answer(asked).text)


@pytest.mark.parametrize(
    "words",
    [
        "Go lower and polish the lid with the cloth.",  # an order with a verb that is not known
        "Take the green jar a little higher.",  # another thing
        "Unless it is full, squeeze harder.",  # a condition
        "Go lower, then shake it and throw it over.",  # verbs that nothing was made of
        "I would not go any lower than that.",  # says where to stop, not where to go
        "Go 2 cm lower at 0.45 0.2.",  # numbers that nothing was made of
    ],
)
def test_a_request_with_something_unread_is_asked_about_and_not_followed_in_part(words):
    answer = said(words)
    assert answer["corrections"] == answer["general"] == [] and answer["unclear"]


@pytest.mark.parametrize(
    ("words", "noted"),
    [
        ("Go lower, the lid is made of thin blue glass from my aunt.", "lower"),
        ("Squeeze harder or you'll drop it on the green jar.", "firmly"),
        ("You knocked the green jar over because you came in too low.", "higher"),
    ],
)
def test_reasons_and_what_happened_may_hold_anything(words, noted):
    assert noted in " ".join(said(words)["corrections"])


@pytest.mark.parametrize(
    ("words", "noted"),
    [
        ("too high", "lower"),
        ("not so high", "lower"),
        ("it was not low enough", "lower"),
        ("higher than it should be", "lower"),
        ("less force", "gently"),
        ("not enough pressure", "firmly"),
        ("more quickly", "faster"),
        ("too brutal", "gently"),
        ("a lil highr pls", "higher"),
        ("dont squeeze so hard", "gently"),
    ],
)
def test_what_is_of_degree_is_read_however_it_is_put(words, noted):
    assert noted in " ".join(said(words)["corrections"])


@pytest.mark.parametrize("word", ["flower", "tower", "through", "thought"])
def test_a_word_of_its_own_is_not_taken_for_a_slip_of_the_keys(word):
    assert said(f"the {word}")["corrections"] == []


def test_an_amount_behind_a_comma_goes_with_what_was_said_before():
    assert "2 cm lower" in " ".join(said("you have to go lower, about two centimetres")["corrections"])


def test_of_an_opening_that_turns_lower_it_is_not_a_place():
    assert said("Lower it gently.", CRATE, "OPEN(crate)")["corrections"] == ["Move slower."]
