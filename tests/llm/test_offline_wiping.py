"""What is wiped, stirred, shaken over something or put down in line: how it is done, and what people say of it."""

from __future__ import annotations

import json
import math
from importlib import resources

import memo_llm.offline
import pytest
from memo_benchmarks.recorded_hand import RecordedHand
from memo_benchmarks.sayings_scenes import scene_for
from memo_llm.offline.recipe import Habits
from offline_prompts import MODEL, Entry, request, scene, thing, write

from memo_core.errors import InvalidArgument
from memo_core.sandbox.sandbox import Sandbox
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library


@pytest.fixture(scope="module")
def sandbox():
    with Sandbox(skill_library(BUILTIN_SKILLS)) as opened:
        yield opened


def commands(sandbox, subtask, *notes):
    """What a hand without a robot does with the code that is written with these notes."""
    graph = scene_for(subtask)
    hand = RecordedHand(graph)
    ended = sandbox.run(write(graph, subtask, [Entry(note, subtask) for note in notes])[0], hand, stopped=lambda: False)
    assert ended.ended == "done", ended.error
    return hand.commands


def noted(words, subtask):
    told = {"task": "t", "subtask": subtask, "words": words, "code": "open_gripper()"}
    return json.loads(MODEL.answer(request("feedback", scene_for(subtask), ended="done", plans=True, **told)).text)


def strokes(acts):
    return [act.pose.position[:2] for act in acts if act.kind == "go" and not act.free]


def test_a_plate_is_wiped_in_rows_that_reach_both_sides_of_it(sandbox):
    acts = commands(sandbox, "WIPE(plate)")
    plate = next(node for node in scene_for("WIPE(plate)").nodes if node.label == "plate")
    for axis in (0, 1):
        ways = [point[axis] - plate.pose.position[axis] for point in strokes(acts)]
        assert min(ways) < -0.4 * plate.size[axis] / 2 and max(ways) > 0.4 * plate.size[axis] / 2
    assert max(act.amount for act in acts if act.kind == "press") == 6.0


@pytest.mark.parametrize(
    ("words", "subtask"),
    [
        ("Go round and round with the sponge, in circles.", "WIPE(plate)"),
        ("You missed the rim, do the edge all the way round as well.", "WIPE(plate)"),
        ("Sweep the crumbs towards the middle, not onto the floor.", "WIPE(table)"),
        ("You're hardly touching it, press harder on that plate.", "WIPE(plate)"),
        ("Get the spoon round the edges too, it burns there.", "STIR(food, pan)"),
        ("Don't shake it all on one spot, move about over the food.", "SHAKE(salt, bowl)"),
    ],
)
def test_what_is_said_of_wiping_stirring_and_shaking_changes_it(sandbox, words, subtask):
    notes = noted(words, subtask)["corrections"]
    assert notes
    assert commands(sandbox, subtask, *notes) != commands(sandbox, subtask)


def test_what_one_wipes_with_is_taken_first():
    kitchen = scene(thing("plate"), thing("sponge", (0.4, -0.2, 0.02)))
    told = {"task": "wipe the plate", "done": [], "notes": [], "corrected": []}
    assert MODEL.answer(request("plan", kitchen, **told)).text == "PICK_UP(sponge)"
    held = scene(*kitchen.nodes, relations=[("sponge", "held")])
    assert MODEL.answer(request("plan", held, **told)).text == "WIPE(plate)"


def test_with_nothing_in_the_hand_it_says_so_instead_of_wiping(sandbox):
    code, _ = write(scene(thing("plate")), "WIPE(plate)")
    ended = sandbox.run(code, RecordedHand(scene(thing("plate"))), stopped=lambda: False)
    assert "nothing is held" in ended.error


def test_a_remark_about_plan_and_motion_is_noted_of_both():
    answer = noted("No, take the other can, and don't squeeze it so hard this time.", "PICK(left can)")
    assert "other can" in answer["plan"][0] and any("gently" in note for note in answer["corrections"])


def test_what_is_put_down_in_line_is_turned_like_what_it_stands_on(sandbox):
    """By 20 degrees here, the shorter way of two that line up the sides of a box."""
    red, blue = thing("red cube"), thing("blue cube", (0.5, 0.1, 0.025), yaw=math.radians(110))
    graph = scene(red, blue, relations=[("red cube", "held")])
    turned = []
    for notes in ([], ["Turn it until its sides line up."]):
        hand = RecordedHand(graph)
        code, _ = write(graph, "PLACE(red cube, blue cube)", [Entry(note, "PLACE(red cube)") for note in notes])
        sandbox.run(code, hand, stopped=lambda: False)
        let_go = next(act for act in hand.commands if act.kind == "open")
        turned.append(let_go.pose.rotation)
    assert math.degrees(math.acos(turned[0][:, 0] @ turned[1][:, 0])) == pytest.approx(20)


@pytest.mark.parametrize("count", [1, 3, 5])
def test_what_is_shaken_while_it_is_led_about_is_shaken_as_often_as_was_said(sandbox, count):
    notes = [f"Shake it up and down {count} times.", "Move about over it while you tip it."]
    acts = commands(sandbox, "SHAKE(salt, bowl)", *notes)
    shakes = [act for act in acts if act.kind == "go" and act.speed == 1.0 and not act.free]
    assert len(shakes) == 2 * count  # up, and down again


def test_what_is_said_of_a_plan_is_kept_for_it_and_praise_is_not():
    def of_plan(words):
        told = {"task": "set the table", "subtask": "PLAN(set the table)", "words": words, "code": ""}
        answer = MODEL.answer(request("feedback", scene_for("PLACE(fork, table)"), plans=True, planning=True, **told))
        return json.loads(answer.text)

    assert of_plan("The fork is not on the left of the plate.")["plan"] == ["The fork is not on the left of the plate."]
    assert not of_plan("Great job, thank you!").get("plan")


def test_a_cap_is_unscrewed_the_other_way_round_than_it_is_screwed_on():
    habits = Habits.load()
    on, off = habits.recipe("screw", ("cap",)), habits.recipe("unscrew", ("cap",))
    assert on.kind == off.kind == "turn" and off.turn == -on.turn


def test_tools_of_a_kind_that_there_is_no_habit_of_are_named(tmp_path):
    text = resources.files(memo_llm.offline).joinpath("habits.yaml").read_text("utf-8")
    (tmp_path / "own.yaml").write_text(text.replace("  stir: [spoon", "  knead: [spoon"))
    with pytest.raises(InvalidArgument, match=r"tools\.knead"):
        Habits.load(str(tmp_path / "own.yaml"))
