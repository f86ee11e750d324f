"""Requests are read as what, where, how, how much and when, in any order and with any verb that carries them."""

from __future__ import annotations

import json

import pytest
from offline_prompts import MODEL, box_with_door, held_poses, request, run, scene, thing, write

from memo_core.scene.graph import Observation
from memo_core.scene.pose import Pose

JUG = scene(thing("jug", (0.45, -0.1, 0.05), (0.1, 0.1, 0.1)), thing("tray", (0.5, 0.2, 0.01), (0.3, 0.2, 0.02)))
HELD = scene(*JUG.nodes, relations=[("jug", "held")])
SLAT = scene(
    thing("slat", (0.45, -0.1, 0.2), (0.16, 0.03, 0.02)),
    thing("tray", (0.5, 0.2, 0.01), (0.3, 0.2, 0.02)),
    relations=[("slat", "held")],
    observation=Observation(Pose((0.45, -0.1, 0.2), (0.0, 1.0, 0.0, 0.0)), 0.03, True),
)


def said(words, graph=JUG, subtask="PICK_UP(jug)"):
    asked = request("feedback", graph, task="t", subtask=subtask, code="open_gripper()", ended="done", words=words)
    return json.loads(MODEL.answer(asked).text)


def plans(words, graph, subtask):
    context = {"task": "t", "subtask": subtask, "code": "open_gripper()", "ended": "done", "plans": True}
    return json.loads(MODEL.answer(request("feedback", graph, words=words, **context)).text).get("plan", [])


@pytest.mark.parametrize(
    "lead", ["", "Could you ", "You need to ", "Maybe try to ", "Why don't you ", "I'd rather you "]
)
@pytest.mark.parametrize("request_", ["take it 3 cm lower", "take it lower by 3 cm"])
def test_a_request_means_the_same_however_it_is_led_up_to(lead, request_):
    assert said(lead + request_)["corrections"] == ["Go 3 cm lower than in that attempt."]


def test_advice_in_the_form_of_a_condition_is_a_request():
    notes = said("If you held it more towards the centre and squeezed a tiny bit more, it wouldn't slip.")[
        "corrections"
    ]
    assert notes == ["Aim for the middle.", "Use the gripper firmly."]


def test_what_would_go_wrong_otherwise_asks_for_nothing():
    notes = said("If you grip it any harder you'll crush it. Softer!")["corrections"]
    assert notes[-1] == "Use the gripper gently." and "Use the gripper firmly." not in notes


def test_what_stands_in_place_of_something_is_set_off_from_it():
    assert said("Come down from above instead of sweeping in from the side.")["corrections"] == ["Approach from top."]


@pytest.mark.parametrize(
    ("words", "noted"),
    [
        ("Stop as soon as you feel it touch.", "Stop as soon as it touches."),
        ("Come down really slowly for the last bit.", "Go slowly on the last stretch."),
        ("Slower once you're close.", "Go slowly on the last stretch."),
        ("Raise it another hand's width before you go forward.", "On the way there, keep 8 cm above everything."),
        ("When you've let go, move straight up.", "Move away up once it is let go."),
        ("Open your fingers slowly.", "Open the fingers little by little to let go."),
        ("Wait a second before you let go.", "Hold it there for 1 seconds before you let go."),
        ("Wait until it stops swinging before you let go.", "Hold it there for a while before you let go."),
        ("Go up and over it next time.", "On the way there, keep above everything."),
        ("Put it two centimetres to the left of the tray.", "Put it to the left of the tray, 2 cm away."),
        ("Stand it upright.", "Turn it until it is upright and put it down so."),
    ],
)
def test_how_something_is_put_down(words, noted):
    assert said(words, SLAT, "PLACE(slat, tray)")["corrections"] == [noted]


@pytest.mark.parametrize(
    ("words", "subtask"),
    [
        ("You don't have to lift it again.", "PLACE(jug, tray)"),  # what not to do
        ("Don't press it down.", "PLACE(jug, tray)"),
        ("Stay further away from the tray.", "PICK_UP(jug)"),  # of another thing
        ("Come back a little, go up and then forward.", "PLACE(jug, tray)"),  # one after the other
        ("Back, and pull it 10 cm more.", "PLACE(jug, tray)"),  # something else is to be opened
        ("Ninety degrees, then down.", "PLACE(jug, tray)"),  # about which axis
        ("On the left.", "PLACE(jug, tray)"),  # where it belongs, and not which way from where it was
        ("Tilt it left 3 cm.", "TURN(jug)"),
        ("It may be behind the tray, open that first.", "PICK_UP(jug)"),  # not the fingers
    ],
)
def test_what_is_no_motion_of_this_is_asked_about(words, subtask):
    answer = said(words, HELD, subtask)
    assert answer["corrections"] == answer["general"] == [] and answer["unclear"]


@pytest.mark.parametrize(
    "words",
    ["Lid first, then the jug.", "You need to rinse it before.", "It belongs in the sink, not there."],
)
def test_steps_of_their_own_are_notes_about_the_plan(words):
    assert plans(words, HELD, "PLACE(jug, tray)")


def test_on_the_way_there_it_is_carried_above_everything():
    before, _ = write(HELD, "PLACE(jug, tray)")
    after, _ = write(HELD, "PLACE(jug, tray)", ["On the way there, keep 12 cm above everything."])

    def highest(code):
        return max(event.pose.position[2] for event in run(code, HELD) if event.kind == "go")

    assert highest(after) - highest(before) > 0.1


def test_what_is_put_down_upright_stands_on_its_end_on_the_place():
    code, _ = write(SLAT, "PLACE(slat, tray)", ["Turn it until it is upright and put it down so."])
    released = next(event for event in run(code, SLAT) if event.kind == "open")
    assert abs(released.pose.rotation[2, 2]) < 0.1  # the hand that held it from above comes from the side
    assert released.pose.position[2] > 0.02 + 0.16 / 2 - 0.01


def test_fingers_that_open_slowly_open_in_several_parts():
    code, _ = write(HELD, "PLACE(jug, tray)", ["Open the fingers little by little to let go."])
    assert sum(event.kind == "open" for event in run(code, HELD)) > 3


def test_only_the_last_stretch_is_slow():
    code, _ = write(JUG, "PICK_UP(jug)", ["Go slowly on the last stretch."])
    speeds = [event.speed for event in run(code, JUG) if event.kind == "go"]
    assert speeds[1] < speeds[0] and held_poses(run(code, JUG))


@pytest.mark.parametrize(
    "words",
    ["You're lifting too soon.", "Close your hand first, then lift.", "Don't lift until your fingers are closed."],
)
def test_what_is_lifted_too_early_is_held_before_it_is_lifted(words):
    (note,) = said(words)["corrections"]
    code, _ = write(JUG, "PICK_UP(jug)", [note])
    assert code.index("close_gripper()") < code.index("wait(GRIP_WAIT)") < code.rindex("follow_path(path")
    assert run(code, JUG)


def test_beside_another_thing_is_put_down_beside_it():
    code, _ = write(HELD, "PLACE(jug, tray)", ["Put it to the left of the tray, 2 cm away."])
    released = next(event for event in run(code, HELD) if event.kind == "open")
    held = next(node for node in HELD.nodes if node.label == "jug").pose.position
    assert released.pose.position[1] - HELD.observation.end_effector.position[1] + held[1] > 0.2 + 0.1


def test_the_arm_leaves_before_a_door_is_shut_where_it_was_in_the_way():
    crate, *_ = box_with_door(opened=True)
    notes = said("Take your arm out of there before you shut it.", crate, "CLOSE(crate)")["corrections"]
    code, _ = write(crate, "CLOSE(crate)", notes)
    assert code.index("go_home()") < code.index("move_to(")


def test_what_has_no_door_is_screwed_and_not_swung():
    assert said("Twist, don't pull.", JUG, "OPEN(jug)")["corrections"] == ["Turn it counterclockwise."]


def test_a_way_that_was_named_stays_while_it_is_pressed():
    words = "Push down a little while you turn it clockwise."
    code, _ = write(JUG, "TURN(jug)", said(words, JUG, "TURN(jug)")["corrections"])
    assert "TURN = 90 " in code


@pytest.mark.parametrize("words", ["Move over to the left.", "Slide it over to the left a bit."])
def test_over_to_a_side_is_that_side_where_it_is_asked_for(words):
    assert "to the left" in said(words, HELD, "PLACE(jug, tray)")["corrections"][0]
