"""Words that used to come out as something else than was meant are read as meant, or asked about."""

from __future__ import annotations

import json

import pytest
from offline_prompts import MODEL, box_with_door, request, scene, thing

CRATE, *_ = box_with_door()
JUG = scene(thing("jug"), thing("mug", (0.5, 0.2, 0.05), (0.1, 0.1, 0.1)))


def said(words, graph=CRATE, subtask="OPEN(crate)"):
    asked = request("feedback", graph, task="t", subtask=subtask, code="open_gripper()", ended="done", words=words)
    return json.loads(MODEL.answer(asked).text)


@pytest.mark.parametrize(
    "words",
    [
        "open it fully and make sure nothing falls out",  # something else is to be seen to
        "further away from the hinge",  # where to, not how far
    ],
)
def test_a_request_beside_one_that_was_read_is_asked_about(words):
    answer = said(words)
    assert answer["corrections"] == answer["general"] == [] and answer["unclear"]


def test_what_is_done_harder_is_what_was_named():
    assert said("Pull harder, it is heavy.")["corrections"] == ["Pull harder."]
    assert said("Grip it harder.")["corrections"] == ["Use the gripper firmly."]


def test_coming_up_slowly_is_no_place():
    assert said("Come up slower.", JUG, "PICK_UP(jug)")["corrections"] == ["Move slower."]


def test_only_so_far_is_how_far_it_goes_in_all():
    assert said("Only pull it about ten centimetres.")["corrections"] == ["Go 10 cm in all."]


def test_further_to_an_angle_that_was_passed_already_is_asked_about():
    turning = said("Turn it a lot further, to 20 degrees.", JUG, "TURN(jug)")
    assert turning["corrections"] == [] and "20 degrees is no further" in turning["unclear"]


def test_what_need_not_be_done_is_not_forbidden():
    assert said("Pull further, you won't need to pull hard.")["corrections"] == ["Go further than in that attempt."]


@pytest.mark.parametrize(
    ("words", "graph", "subtask"),
    [
        ("Lift the flaps one at a time.", CRATE, "OPEN(crate)"),  # not one motion
        ("The sink is where it belongs.", JUG, "PLACE(jug, mug)"),  # a thing, and no way down
        ("Other way.", CRATE, "OPEN(crate)"),  # of a straight pull: round, or to another side?
        ("It slides.", CRATE, "OPEN(crate)"),  # what has its handle at an edge slides to a side
        ("Gently!", JUG, "STIR(jug)"),  # more slowly, or with less force
    ],
)
def test_what_has_two_readings_is_asked_about(words, graph, subtask):
    answer = said(words, graph, subtask)
    assert answer["corrections"] == answer["general"] == [] and answer["unclear"]


@pytest.mark.parametrize(
    ("words", "subtask", "noted"),
    [
        ("Lift it straight up, really slowly.", "PICK_UP(jug)", ["Lift it straight up.", "Move slowly."]),
        ("Take it round its belly.", "PICK_UP(jug)", ["Aim for the middle."]),
        ("Hold the vessel lower, it is top heavy.", "PICK_UP(jug)", ["Go lower than in that attempt."]),
        ("Put it down more softly.", "PLACE(jug, mug)", ["Move slower."]),
        (
            "Only let go of things when they're standing.",
            "PLACE(jug, mug)",
            ["Lower it until it touches before you let go."],
        ),
        ("Half the speed would do.", "PICK_UP(jug)", ["Move slower."]),
        ("Use twice the force.", "PICK_UP(jug)", ["Use the gripper firmly."]),
        ("Use a third of the force.", "PICK_UP(jug)", ["Use the gripper gently."]),
        ("Press harder.", "WIPE(jug)", ["Press harder."]),
    ],
)
def test_everyday_forms_are_noted_as_meant(words, subtask, noted):
    assert said(words, JUG, subtask)["corrections"] == noted


@pytest.mark.parametrize(
    "words", ["Much better than before, keep doing it this way.", "I'm impressed.", "Not even a scratch!"]
)
def test_praise_in_other_words_is_asked_back_as_praise(words):
    assert "right as it was" in said(words)["unclear"]


@pytest.mark.parametrize(
    "words",
    [
        "Open it only halfway, please.",
        "Only half way.",
        "Whoa, only about halfway, please, it'll come right off.",
        "Just pull it half open.",
    ],
)
def test_halfway_that_is_wished_for_is_half_of_a_right_angle(words):
    assert said(words)["corrections"] == ["Lead it through 45 degrees."]


@pytest.mark.parametrize("words", ["It's only half open.", "You opened it only halfway."])
def test_halfway_that_is_complained_of_is_further(words):
    assert said(words)["corrections"] in (["Go further than in that attempt."], ["Go all the way."])


@pytest.mark.parametrize(
    "words",
    [
        "You've got to push the thing down there and then the door jumps open.",
        "Turn that off again and press the bottom one instead.",
        "It goes up and then backwards.",
    ],
)
def test_pressing_something_else_or_going_back_of_a_lid_is_asked_about(words):
    assert said(words)["corrections"] == []


def test_a_door_pushed_in_first_is_still_read():
    assert said("Push it in and it pops open by itself.")["corrections"] == ["Push it in first, then let it come."]


def test_holding_on_in_the_middle_is_no_place():
    assert said("Don't let go in the middle.")["corrections"] == ["Keep hold of it."]
