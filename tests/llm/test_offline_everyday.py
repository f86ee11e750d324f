"""Everyday remarks: what is about the plan is kept for it, what is about the motion changes it."""

from __future__ import annotations

import json

import pytest
from offline_prompts import MODEL, box_with_door, request, scene, thing

CRATE, *_ = box_with_door()
JUG = scene(thing("jug"), thing("tray", (0.5, 0.2, 0.01), (0.3, 0.2, 0.02)))


def said(words, subtask, graph=JUG):
    told = {"task": "t", "subtask": subtask, "words": words, "code": "open_gripper()"}
    return json.loads(MODEL.answer(request("feedback", graph, ended="done", plans=True, **told)).text)


@pytest.mark.parametrize(
    "words",
    [
        "No, the other one.",
        "That's my jug, leave it where it is.",
        "Jugs belong on the lower shelf.",
        "You forgot to close the lid.",
        "Rinse the jug before you set it down.",
        "Start with the big ones, the small ones come last.",
        "One at a time.",
        "Not on my papers, somewhere free.",
        "Five minutes is way too long, two will do.",
    ],
)
def test_another_thing_place_or_step_is_kept_for_the_plan_in_the_persons_words(words):
    answer = said(words, "PLACE(jug, tray)")
    assert answer["corrections"] == [] and not answer["unclear"]
    assert " ".join(answer["plan"]).split()[-1] == words.replace(".", " ").split()[-1] + "."


@pytest.mark.parametrize(
    "words",
    [
        "Lift it first, then go sideways.",
        "Open your hand before you go down.",
        "Take it in the middle, not by the other end.",
        "Wait a moment before you let go.",
    ],
)
def test_how_a_step_is_done_is_no_matter_of_the_plan(words):
    assert not said(words, "PLACE(jug, tray)").get("plan")


@pytest.mark.parametrize(
    ("words", "subtask", "noted"),
    [
        ("Gently! You don't need to slam it.", "CLOSE(crate)", "Move slower."),
        ("You don't have to go in there, come from above.", "PICK_UP(jug)", "Approach from top."),
        ("It's wobbling like crazy. Hold it tighter.", "PICK_UP(jug)", "Use the gripper firmly."),
        ("Sooo fast! Slower.", "PLACE(jug, tray)", "Move slower."),
        ("You barely need to hold it.", "PICK_UP(jug)", "Use the gripper gently."),
        (
            "Put it down all the way and then let go.",
            "PLACE(jug, tray)",
            "Lower it until it touches before you let go.",
        ),
        ("Get right over the tray before you let go.", "PLACE(jug, tray)", "Aim for the middle."),
        (
            "Once you've let go, go straight up before you move away.",
            "PLACE(jug, tray)",
            "Move away up once it is let go.",
        ),
        ("Stand it up.", "PLACE(jug, tray)", "Turn it until it is upright and put it down so."),
        (
            "A bit to the left. Like a centimetre.",
            "PLACE(jug, tray)",
            "Go 1 cm further to the left than in that attempt.",
        ),
        ("Not so rough, it is old.", "OPEN(crate)", "Move slower."),
        ("Wrong way. Lefty loosey.", "TWIST(jug)", "Turn it counterclockwise."),
    ],
)
def test_what_is_about_the_motion_is_noted_of_it(words, subtask, noted):
    answer = said(words, subtask, CRATE if "crate" in subtask else JUG)
    assert noted in answer["corrections"], answer


@pytest.mark.parametrize(
    ("words", "subtask"),
    [
        ("You've got to hold on to the crate while you turn the lid.", "OPEN(crate)"),  # something else is to be held
    ],
)
def test_what_has_two_readings_is_asked_about(words, subtask):
    answer = said(words, subtask, CRATE if "crate" in subtask else JUG)
    assert answer["corrections"] == [] and answer["unclear"]


def test_what_went_wrong_is_not_asked_for():
    notes = said("You're screwing it tighter. Turn it counterclockwise.", "TWIST(jug)")["corrections"]
    assert "Turn it counterclockwise." in notes and not any("harder" in note or "firmly" in note for note in notes)
