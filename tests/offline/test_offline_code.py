"""The offline backend writes code by habit and edits it by what people said, for any hinge and either hand."""

from __future__ import annotations

import itertools
import math
import threading
import time

import numpy as np
import pytest
from memo_offline.imagination import Imagination, hand_over
from memo_offline.templates import imagine

from memo_core.sandbox.sandbox import Sandbox
from memo_core.scene.graph import Observation
from memo_core.scene.pose import Pose
from tests.support.offline_prompts import (
    ARC,
    MODEL,
    SKILLS,
    Entry,
    box_with_door,
    held_poses,
    request,
    run,
    scene,
    thing,
    unfenced,
    write,
)

EDGES = ("left", "right", "bottom", "top")


def radius_and_angle(poses, hinge, axis):
    """(spread of the distance from the hinge line, mean of it, signed degrees turned about it)."""
    points = np.array([p.position for p in poses]) - hinge
    flat = points - np.outer(points @ axis, axis)
    radii = np.linalg.norm(flat, axis=1)
    angles = [math.atan2(float(np.cross(a, b) @ axis), float(a @ b)) for a, b in itertools.pairwise(flat)]
    return float(np.ptp(radii)), float(radii.mean()), math.degrees(sum(angles))


@pytest.mark.process
@pytest.mark.parametrize("edge", EDGES)
@pytest.mark.parametrize("yaw", [0.0, 0.4, -0.3])
def test_without_lessons_a_handle_is_pulled_straight_back(edge, yaw):
    graph, _, _, out = box_with_door(edge=edge, yaw=yaw)
    code, answer = write(graph, "OPEN(crate)")
    poses = held_poses(run(code, graph))
    way = np.subtract(poses[-1].position, poses[0].position)
    assert way / np.linalg.norm(way) == pytest.approx(out, abs=0.01)
    assert poses[0].position == pytest.approx(graph.node("crate handle").pose.position, abs=1e-3)
    assert answer.not_understood == ()


@pytest.mark.process
@pytest.mark.parametrize("edge", EDGES)
@pytest.mark.parametrize("yaw", [0.0, 0.4, -0.3])
def test_taught_an_arc_it_leads_the_handle_about_the_edge_the_door_hangs_on(edge, yaw):
    graph, hinge, axis, out = box_with_door(edge=edge, yaw=yaw)
    poses = held_poses(run(write(graph, "OPEN(crate)", [ARC])[0], graph))
    spread, radius, angle = radius_and_angle(poses, hinge, axis)
    assert spread < 0.003 and radius == pytest.approx(0.31, abs=0.03)
    assert abs(angle) == pytest.approx(85, abs=1)
    first = np.subtract(poses[1].position, poses[0].position)
    assert first @ out > 0.9 * np.linalg.norm(first)
    # The hand turns with the door, and its fingers close across the bar from first to last.
    assert math.degrees(poses[0].distance(poses[-1])[1]) == pytest.approx(85, abs=1)
    for pose in poses:
        assert abs(pose.rotation[:, 1] @ axis) < 0.05


@pytest.mark.process
@pytest.mark.parametrize("edge", EDGES)
def test_fingers_open_part_way_and_let_go_before_the_hand_leaves_backwards(edge):
    graph, *_ = box_with_door(edge=edge)
    events = run(write(graph, "OPEN(crate)", [ARC])[0], graph)
    assert [e.kind for e in events if e.kind != "go"] == ["open", "close", "open"]
    assert events[0].amount == pytest.approx(0.05)
    last, released = events[-1].pose, next(e.pose for e in reversed(events) if e.kind == "open")
    back = np.subtract(last.position, released.position)
    assert back @ released.rotation[:, 2] < -0.05


def test_the_same_prompt_gives_the_same_code():
    graph, *_ = box_with_door()
    assert len({write(graph, "OPEN(crate)", [ARC, "grip it firmly"])[0] for _ in range(5)}) == 1


NONSENSE = "Xqzv wro blenfit draap ic qlu abbet wro fimse edru, yta edru foklart nrud wro blenfi."


def test_nonsense_of_equal_length_changes_nothing_and_is_reported():
    graph, *_ = box_with_door()
    naive, _ = write(graph, "OPEN(crate)")
    code, answer = write(graph, "OPEN(crate)", [NONSENSE])
    assert uncommented(code) == uncommented(naive)
    assert answer.not_understood and "Not understood" in code


def test_a_note_that_changes_nothing_in_the_code_is_not_said_to_be_followed():
    graph, *_ = box_with_door()
    turn = "Lead it through 90 degrees."
    alone, answer = write(graph, "OPEN(crate)", [turn])
    assert f"# Cannot follow: {turn}" in alone and "As told" not in alone and answer.not_understood == ()
    for notes in ([turn, ARC], [ARC, turn]):  # whichever is applied first
        both, _ = write(graph, "OPEN(crate)", notes)
        assert "ANGLE = 90" in both and f"# As told: {turn}" in both and "Cannot follow" not in both
    twice, _ = write(graph, "OPEN(crate)", [ARC], general=["Doors swing: lead the handle along an arc."])
    assert "Cannot follow" not in twice, "either one would do alone"


def uncommented(code: str) -> str:
    return "\n".join(line for line in code.splitlines() if not line.startswith("#")).strip()


def test_the_opposite_lesson_takes_the_benefit_away():
    graph, *_ = box_with_door()
    naive, _ = write(graph, "OPEN(crate)")
    arc, _ = write(graph, "OPEN(crate)", [ARC])
    for opposite in ("Pull the handle straight out, not in an arc.", "No arc, pull straight back."):
        code, _ = write(graph, "OPEN(crate)", [opposite])
        assert uncommented(code) == uncommented(naive)
        # Contradictions are both applied; the better ranked one, listed first, has the last word.
        assert uncommented(write(graph, "OPEN(crate)", [opposite, ARC])[0]) == uncommented(naive)
        assert uncommented(write(graph, "OPEN(crate)", [ARC, opposite])[0]) == uncommented(arc)


def test_corrections_have_the_last_word_over_general_statements():
    graph, *_ = box_with_door()
    straight, _ = write(graph, "OPEN(crate)", ["Pull the handle straight out, in one line."])
    both, _ = write(graph, "OPEN(crate)", ["Pull the handle straight out, in one line."], general=[ARC])
    assert uncommented(both) == uncommented(straight)


@pytest.mark.process
def test_general_guidance_alone_is_followed():
    graph, hinge, axis, _ = box_with_door(edge="bottom")
    lesson = "Doors swing: hold a door's handle and lead it along an arc about the hinge edge, not in a straight line."
    poses = held_poses(run(write(graph, "OPEN(crate)", general=[lesson])[0], graph))
    assert abs(radius_and_angle(poses, hinge, axis)[2]) == pytest.approx(85, abs=1)


@pytest.mark.parametrize(
    ("lesson", "followed"),
    [
        ("Doors swing: lead the handle along an arc about the hinge edge.", {"OPEN(crate)"}),
        ("When opening something, go 5 cm higher.", set()),  # a condition is not understood
        ("Go 5 cm higher.", {"OPEN(crate)", "PICK_UP(brick)"}),
    ],
)
def test_a_general_statement_is_followed_where_it_fits(lesson, followed):
    graph, *_ = box_with_door(content=[thing("brick")])
    for subtask in ("OPEN(crate)", "PICK_UP(brick)"):
        plain, told = write(graph, subtask)[0], write(graph, subtask, general=[lesson])[0]
        assert (uncommented(plain) != uncommented(told)) == (subtask in followed)


@pytest.mark.process
@pytest.mark.parametrize(
    "irrelevant",
    [
        "Go 6 cm higher before you close your fingers.",
        "Take it from above.",
        "Turn the hand by a quarter turn.",
        "Let go 5 cm to the left.",
    ],
)
def test_a_lesson_about_something_else_is_applied_all_the_same_and_spoils(irrelevant):
    graph, *_ = box_with_door()
    good = held_poses(run(write(graph, "OPEN(crate)", [ARC])[0], graph))[0]
    spoilt = held_poses(run(write(graph, "OPEN(crate)", [Entry(irrelevant, "PICK_UP(jar)"), ARC])[0], graph))[0]
    metres, radians = good.distance(spoilt)
    assert metres > 0.015 or radians > 0.3


@pytest.mark.process
def test_an_arc_lesson_on_something_that_slides_spoils_the_pull():
    tray = thing("tray", (0.75, 0.1, 0.08), (0.28, 0.3, 0.12), "part", "chest")
    chest = thing("chest", (0.8, 0.1, 0.08), (0.28, 0.32, 0.16), "fixture")
    handle = thing("tray handle", (0.55, 0.1, 0.08), (0.018, 0.12, 0.018), "part", "tray")
    graph = scene(chest, tray, handle, relations=[("tray", "closed")])
    straight = held_poses(run(write(graph, "OPEN(tray)")[0], graph))
    arc = held_poses(run(write(graph, "OPEN(tray)", [ARC])[0], graph))
    assert np.ptp([p.position[2] for p in straight]) < 1e-6
    assert np.ptp([p.position[2] for p in arc]) > 0.03


# -- templates --------------------------------------------------------------------------------------------------------


def template_of(graph, subtask, code):
    return unfenced(MODEL.answer(request("template", graph, subtask=subtask, code=code)).text)


@pytest.mark.process
@pytest.mark.parametrize("edge", EDGES)
def test_a_template_from_another_thing_carries_its_arc_over(edge):
    taught, *_ = box_with_door("pantry", edge="left")
    template = template_of(taught, "OPEN(pantry)", write(taught, "OPEN(pantry)", [ARC])[0])
    graph, hinge, axis, _ = box_with_door("crate", edge=edge)
    code, answer = write(graph, "OPEN(crate)", templates=[Entry(template, "OPEN(pantry)")])
    spread, _, angle = radius_and_angle(held_poses(run(code, graph)), hinge, axis)
    assert spread < 0.003 and abs(angle) == pytest.approx(85, abs=2)
    assert answer.not_understood == ()
    assert template.splitlines()[4] not in code  # never pasted


REVERSALS = {
    "the default amount": lambda text: text.replace("angle=85", "angle=-85"),
    "the angle where it is used": lambda text: text.replace("math.radians(angle)", "math.radians(-angle)"),
    "the sense that it computes": lambda text: text.replace("return 1.0 if", "return -1.0 if").replace(
        "else -1.0", "else 1.0"
    ),
}


@pytest.mark.process
@pytest.mark.parametrize("where", REVERSALS)
@pytest.mark.parametrize("edge", EDGES)
def test_a_template_with_its_arc_reversed_spoils_what_is_written(edge, where):
    taught, *_ = box_with_door("pantry")
    template = template_of(taught, "OPEN(pantry)", write(taught, "OPEN(pantry)", [ARC])[0])
    reversed_template = REVERSALS[where](template)
    assert reversed_template != template
    graph, _, _, out = box_with_door(edge=edge)
    # Also where the lesson itself says "an arc": it does not say which way round.
    for corrections in ([], [ARC]):
        code, _ = write(graph, "OPEN(crate)", corrections, templates=[Entry(reversed_template, "OPEN(pantry)")])
        poses = held_poses(run(code, graph))
        assert np.subtract(poses[1].position, poses[0].position) @ out < 0


def imagined(template, graph):
    with Imagination() as imagination:
        return imagine(Entry(template, "OPEN(old)"), graph, ("crate",), imagination)


SAMPLED = """pts = []
    for k in range(1, 13):
        a = turn * math.radians(60) * k / 12
        pts.append([turn_point(grip, hinge, [0, 0, -1], -a), turn_orientation(hand, [0, 0, -1], -a)])"""


@pytest.mark.process
@pytest.mark.parametrize("arc", [SAMPLED, "pts = arc_path(grip, hand, hinge, [0, 0, 1], turn * math.radians(60))"])
def test_a_template_written_by_somebody_else_is_read_by_what_it_does(arc):
    foreign = f'''
import math


def swing(door="old door", handle="old handle"):
    """Swings a door."""
    grip = get_position(handle)
    c, s = get_position(door), get_size(door)
    hinge = [c[0], c[1] + (s[1] / 2 if grip[1] < c[1] else -s[1] / 2), grip[2]]
    turn = 1 if grip[1] > c[1] else -1
    hand = side_orientation([1, 0, 0], "horizontal")
    open_gripper(0.06)
    move_to([grip[0] - 0.1, grip[1], grip[2]], hand)
    move_straight(grip, hand)
    close_gripper()
    {arc}
    follow_path(pts)
    open_gripper()
'''
    side, hinge, axis, _ = box_with_door(edge="left")
    code, answer = write(side, "OPEN(crate)", templates=[Entry(foreign, "OPEN(old)")])
    assert answer.not_understood == ()
    angle = float(code.split("ANGLE = ")[1].split()[0])
    _, _, theirs = radius_and_angle(held_poses(imagined(foreign, side)), hinge, axis)
    _, _, ours = radius_and_angle(held_poses(run(code, side)), hinge, axis)
    assert abs(angle) == pytest.approx(60, abs=2) and ours == pytest.approx(theirs, abs=2)
    assert "OPENING = 0.06" in code


def test_a_template_that_makes_no_sense_is_reported_and_changes_nothing():
    graph, *_ = box_with_door()
    naive, _ = write(graph, "OPEN(crate)")
    for rubbish in ("def f(x:\n", "wro blenfi = 3", "def f(a):\n    '''x'''\n    return a"):
        code, answer = write(graph, "OPEN(crate)", templates=[Entry(rubbish, "OPEN(pantry)")])
        assert uncommented(code) == uncommented(naive)
        assert any("template" in words for words in answer.not_understood)


# -- picking and placing ----------------------------------------------------------------------------------------------


def holding(graph, position, orientation=(0.0, 1.0, 0.0, 0.0)):
    import attrs

    return attrs.evolve(graph, observation=Observation(Pose(position, orientation), 0.05, True))


@pytest.mark.process
def test_things_are_taken_from_above_at_the_centre_across_their_narrow_side():
    graph = scene(thing("brick", (0.5, 0.1, 0.02), (0.10, 0.04, 0.04), yaw=0.5))
    events = run(write(graph, "PICK_UP(brick)")[0], graph)
    grasp = next(e.pose for e in events if e.kind == "close")
    assert grasp.position == pytest.approx((0.5, 0.1, 0.02), abs=1e-3)
    assert grasp.rotation[:, 2] == pytest.approx((0, 0, -1), abs=1e-6)
    narrow = np.array([-math.sin(0.5), math.cos(0.5), 0])
    assert abs(grasp.rotation[:, 1] @ narrow) == pytest.approx(1, abs=1e-3)
    assert events[-1].pose.position[2] == pytest.approx(0.17, abs=1e-3)


@pytest.mark.process
def test_tall_things_are_taken_near_the_top_so_that_the_palm_stays_clear():
    graph = scene(thing("bottle", (0.5, 0.1, 0.12), (0.05, 0.05, 0.24)))
    grasp = next(e.pose for e in run(write(graph, "PICK_UP(bottle)")[0], graph) if e.kind == "close")
    assert grasp.position[2] == pytest.approx(0.21, abs=1e-3)


@pytest.mark.process
def test_what_goes_into_something_that_opens_to_the_side_is_taken_as_one_reaches_in_there():
    brick = thing("brick")
    graph, _, _, out = box_with_door(opened=True, content=(brick,))
    task = "put the brick in the crate"
    grasp = next(e.pose for e in run(write(graph, "PICK_UP(brick)", task=task)[0], graph) if e.kind == "close")
    assert grasp.rotation[:, 2] == pytest.approx((math.cos(math.radians(25)), 0, -math.sin(math.radians(25))), abs=0.01)
    held = holding(graph, brick.pose.position, grasp.orientation)
    events = run(write(held, "PLACE(brick, crate)", task=task)[0], held)
    release = next(e.pose for e in events if e.kind == "open")
    inside = graph.node("crate inside")
    assert release.position[:2] == pytest.approx(inside.pose.position[:2], abs=0.01)
    assert release.position[2] == pytest.approx(inside.bounds()[0][2] + 0.025 + 0.008, abs=2e-3)
    entry = next(e.pose for e in events if e.kind == "go")
    assert np.subtract(entry.position, release.position) @ out > 0.25


@pytest.mark.process
def test_a_thing_is_set_on_top_of_another():
    graph = scene(thing("red brick"), thing("blue brick", (0.5, 0.2, 0.025)))
    held = holding(graph, graph.node("red brick").pose.position)
    events = run(write(held, "PLACE(red brick, blue brick)")[0], held)
    release = next(e.pose for e in events if e.kind == "open")
    assert release.position == pytest.approx((0.5, 0.2, 0.05 + 0.025 + 0.008), abs=2e-3)


@pytest.mark.process
def test_an_unknown_verb_is_said_and_a_thing_out_of_sight_is_an_error_of_the_code():
    graph = scene(thing("brick"))
    _, answer = write(graph, "DEFENESTRATE(brick)")
    assert "defenestrate" in answer.not_understood
    with pytest.raises(AssertionError, match="no vase"):
        run(write(graph, "PICK_UP(vase)")[0], graph)


@pytest.mark.process
def test_closing_ends_what_is_being_imagined():
    crate, *_ = box_with_door("crate")
    imagination, imagined_commands = Imagination(), []
    imagination.open()
    imagining = threading.Thread(
        target=lambda: imagined_commands.append(imagination.commands("open_gripper()\nwhile True:\n    pass\n", crate))
    )
    imagining.start()
    time.sleep(0.5)  # most of the time it has begun by then
    imagination.close()
    imagining.join(40)
    assert len(imagined_commands) == 1


@pytest.mark.process
def test_a_grasp_of_nothing_is_told_in_millimetres_that_people_read():
    graph = scene(thing("brick"))
    hand = hand_over(graph)
    hand.holding, hand.gripper_width = lambda: False, lambda: 3.1302913391115453e-12
    with Sandbox(SKILLS) as sandbox:
        printed = sandbox.run(write(graph, "PICK_UP(brick)")[0], hand, stopped=lambda: False).printed
    assert printed == "nothing is held: the fingers are 0.0 mm apart\n"
