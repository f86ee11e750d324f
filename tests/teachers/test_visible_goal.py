"""What a goal says is looked for in what is visible, and what cannot be seen is not claimed."""

from __future__ import annotations

import attrs
import pytest

from memo_core.interfaces.teacher import Episode, Proposal, Sighting, TaskEpisode
from memo_core.scene.description import Body, Free, Geom, SceneDescription
from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.teachers.episode_assessment import impression
from memo_core.teachers.goal_check import met_at_start, unmet_goal, unseen_goal
from memo_core.teachers.simulated_teacher import SimulatedTeacher, SimulatedTeacherSettings
from memo_core.teachers.visible import Seen
from memo_core.teachers.visible_goal import FORMS, holds, read_goal

NAPKIN = Node("napkin", "napkin", Pose((0.5, 0.0, 0.02)), (0.04, 0.04, 0.04))
BIN = Node("bin", "bin", Pose((0.3, -0.5, 0.06)), (0.18, 0.2, 0.13), kind="fixture")
KNOB = Node("stove/dial", "stove knob", Pose((0.5, 0.1, 0.06)), (0.04, 0.02, 0.03), "stove", "part")
STOVE = Node("stove", "stove", Pose((0.5, 0.2, 0.025)), (0.28, 0.38, 0.05), kind="fixture")
DOOR = Node("box/door", "box door", Pose((0.6, 0.0, 0.2)), (0.02, 0.3, 0.3), "box", "part")
BOX = Node("box", "box", Pose((0.75, 0.0, 0.2)), (0.3, 0.3, 0.3), kind="fixture")


def graph(nodes, relations=(), hand=(0.3, 0.0, 0.4), width=0.08) -> SceneGraph:
    return SceneGraph(tuple(nodes), tuple(Relation(*r) for r in relations), Observation(Pose(hand), width, False))


def at(node: Node, *position: float, turned: float = 0.0) -> Node:
    return Node(node.id, node.label, Pose.from_yaw(position, turned), node.size, node.part_of, node.kind)


def told(sentence: str, before: SceneGraph, after: SceneGraph, *between: SceneGraph) -> bool | None:
    condition = read_goal(sentence)
    assert condition is not None, sentence
    return holds(condition, Seen(before, after, tuple(Sighting(float(i), g) for i, g in enumerate(between))))


def test_every_form_is_read_and_nothing_else_is():
    for form, _ in FORMS:
        sentence = {
            "let-go": "the hand has let go of the cup", "held": "the hand holds the cup",
            "held-up": "the hand holds the cup up", "open": "the door is open", "wide-open": "the door is wide open",
            "closed": "the door is shut", "screwed": "the cap was turned on the bottle",
            "pressed": "the button was pressed", "turned": "the knob is turned", "lowered": "the lever is down",
            "pressed-while-closed": "the button was pressed while the door was closed",
            "off": "the cap is off the bottle", "left-of": "the fork is left of the plate",
            "right-of": "the knife is right of the plate", "next-to": "the can is next to the others",
            "straight": "the fork lies straight", "upright": "the cup stands upright",
            "stayed": "the others have stayed where they were", "whole": "the can is not crushed",
            "tower": "the red cube, the green cube and the blue cube stand in one tower",
            "wiped": "the sponge has gone over all of the plate", "in": "the napkin is in the bin",
            "on": "the fork, the knife and the spoon are on the table",
        }[form]  # fmt: skip
        found = read_goal(sentence)
        assert found is not None and found.form == form, sentence
    assert read_goal("the fork, the knife and the spoon are on the table").subjects == ("fork", "knife", "spoon")
    assert read_goal("the joint is at 0.3 rad") is None


def test_things_are_where_they_are_seen():
    before = graph([NAPKIN, BIN], [("napkin", "on", "table")])
    after = graph([at(NAPKIN, 0.3, -0.5, 0.03), BIN], [("napkin", "in", "bin")])
    assert told("the napkin is in the bin", before, before) is False
    assert told("the napkin is in the bin", before, after) is True
    assert told("the napkin is on the table", before, after) is False


def test_what_was_put_behind_a_door_that_was_shut_is_still_in_there():
    inside = Node("box/inside", "box inside", Pose((0.75, 0.0, 0.2)), (0.28, 0.28, 0.28), "box", "space")
    before = graph([NAPKIN, BOX, DOOR], [("napkin", "on", "table"), ("box/door", "closed")])
    put = graph([at(NAPKIN, 0.75, 0, 0.1), BOX, DOOR, inside], [("napkin", "in", "box"), ("box/door", "open")])
    shut = graph([BOX, DOOR], [("box/door", "closed")])
    assert told("the napkin is in the box", before, shut, put) is True
    assert told("the napkin is in the box", before, shut, before) is None, "nobody saw where it went"


def test_what_was_never_seen_is_not_on_the_table_and_may_be_behind_a_closed_door():
    shut = graph([BOX, DOOR], [("box/door", "closed")])
    assert told("the apple is on the table", shut, shut) is False
    assert told("the apple is in the box", shut, shut) is None


def test_a_button_counts_only_while_the_door_is_shut():
    button = Node("box/button", "box button", Pose((0.58, -0.2, 0.2)), (0.02, 0.02, 0.02), "box", "part")

    def scene(state, hand):
        return graph([BOX, DOOR, button], [("box/door", state)], hand)

    away, there = (0.3, 0.0, 0.4), (0.57, -0.2, 0.2)
    sentence = "the box button was pressed while the box door was closed"
    assert told(sentence, scene("closed", away), scene("closed", away), scene("open", there)) is False
    assert told(sentence, scene("closed", away), scene("closed", away), scene("closed", there)) is True
    assert told(sentence, scene("closed", away), scene("closed", away)) is None, "nobody watched"


def teacher(**settings) -> SimulatedTeacher:
    made = SimulatedTeacher(SimulatedTeacherSettings(misjudges=0.0, **settings))
    made.open()
    return made


def test_a_forgotten_thing_is_named_and_a_finished_task_approved():
    before = graph([NAPKIN, BIN], [("napkin", "on", "table")])
    done = graph([at(NAPKIN, 0.3, -0.5, 0.03), BIN], [("napkin", "in", "bin")])
    goal = ("the napkin is in the bin",)
    said = teacher().judge_task(TaskEpisode("clean up", before, before, goal))
    assert said.kind == "correct" and "napkin" in said.words
    assert teacher().judge_task(TaskEpisode("clean up", before, done, goal)).kind == "approve"


def test_one_drawer_of_several_is_judged_alone():
    drawers = [attrs.evolve(DOOR, id=f"box/{name}", label=f"{name} drawer") for name in ("top", "middle")]
    shut = graph([BOX, *drawers], [("box/top", "closed"), ("box/middle", "closed")])
    opened = graph([BOX, *drawers], [("box/top", "closed"), ("box/middle", "open")])
    goal = ("the middle drawer is open",)
    assert teacher().judge_task(TaskEpisode("open it", shut, shut, goal)).kind == "correct"
    assert teacher().judge_task(TaskEpisode("open it", shut, opened, goal)).kind == "approve"
    assert teacher().judge_task(TaskEpisode("open it", shut, opened, ("the top drawer is open",))).kind == "correct"


def test_a_finished_task_that_is_misjudged_is_not_called_the_it():
    done = graph([at(NAPKIN, 0.3, -0.5, 0.03), BIN], [("napkin", "in", "bin")])
    episode = TaskEpisode("clean up", done, done, ("the napkin is in the bin",))
    said = set()
    for seed in range(20):
        wrong = SimulatedTeacher(SimulatedTeacherSettings(misjudges=1.0, seed=seed))
        wrong.open()
        said.add(wrong.judge_task(episode).words)
    assert len(said) > 2 and any(" it " in words for words in said) and not any("the it" in words for words in said)


def test_who_was_told_no_goal_or_cannot_see_it_says_nothing():
    scene = graph([BOX, DOOR], [("box/door", "closed")])
    assert teacher().judge_task(TaskEpisode("tidy up", scene, scene)).kind == "silent"
    assert teacher().judge_task(TaskEpisode("tidy up", scene, scene, ("the apple is in the box",))).kind == "silent"


def test_a_whole_task_is_corrected_only_so_often():
    scene = graph([NAPKIN, BIN], [("napkin", "on", "table")])
    episode, patient = TaskEpisode("clean up", scene, scene, ("the napkin is in the bin",)), teacher(patience=2)
    assert [patient.judge_task(episode).kind for _ in range(3)] == ["correct", "correct", "silent"]


def test_a_plan_that_reaches_into_something_closed_is_objected_to_once():
    scene = graph([NAPKIN, BOX, DOOR], [("napkin", "on", "table"), ("box/door", "closed")])
    watching = teacher()
    said = watching.judge_plan(Proposal("tidy up", "PLACE(napkin, box)", scene))
    assert said.kind == "correct" and said.about_plan and "box door" in said.words
    assert watching.judge_plan(Proposal("tidy up", "PLACE(napkin, box)", scene)).kind == "silent"
    assert watching.judge_plan(Proposal("tidy up", "OPEN(box)", scene)).kind == "silent"
    assert "box door" in watching.judge_plan(Proposal("tidy up", "PICK_UP(apple)", scene)).words


@pytest.mark.parametrize(
    ("subtask", "turned", "near", "cause"),
    [
        ("TURN_ON(stove)", 0.5, True, ""),
        ("TURN(stove knob)", 0.05, True, "not-turned"),
        ("ROTATE(stove knob)", 0.0, False, "never-near"),
        ("PLACE(napkin, bin)", 0.0, False, "landed-beside"),
        ("LET_GO(napkin)", 0.0, False, ""),
    ],
)
def test_a_verb_is_judged_by_what_it_should_change(subtask, turned, near, cause):
    nodes = [NAPKIN, BIN, STOVE, KNOB]
    before = graph(nodes, [("napkin", "on", "table")])
    knob = at(KNOB, *KNOB.pose.position, turned=turned)
    hand = KNOB.pose.position if near else (0.3, -0.4, 0.4)
    after = graph([NAPKIN, BIN, STOVE, knob], [("napkin", "on", "table")], hand)
    seen = (Sighting(0.0, before), Sighting(0.5, after))
    found = impression(Episode("cook", subtask, 1, before, after, seen))
    assert found.sure and found.cause == cause and found.fine == (not cause)


SALT = Node("salt", "salt", Pose((0.4, 0.3, 0.05)), (0.02, 0.02, 0.02), kind="heap")
SHAKER = Node("shaker", "salt shaker", Pose((0.4, 0.3, 0.05)), (0.04, 0.04, 0.1))
BOWL = Node("bowl", "bowl", Pose((0.5, 0.0, 0.03)), (0.15, 0.15, 0.06))
SPONGE = Node("sponge", "sponge", Pose((0.4, -0.2, 0.02)), (0.08, 0.05, 0.04))
PLATE = Node("plate", "plate", Pose((0.5, 0.1, 0.01)), (0.2, 0.2, 0.02))
BOTTLE = Node("bottle", "bottle", Pose((0.5, 0.0, 0.06)), (0.05, 0.05, 0.12), kind="fixture")
CAP = Node("bottle/cap", "bottle cap", Pose((0.5, 0.0, 0.13)), (0.03, 0.03, 0.02), "bottle", "part")
BELL = Node("bell", "bell", Pose((0.4, 0.2, 0.02)), (0.1, 0.1, 0.04), kind="fixture")
BUTTON = Node("bell/button", "bell button", Pose((0.4, 0.2, 0.05)), (0.02, 0.02, 0.01), "bell", "part")
ON_TABLE = [("napkin", "on", "table")]
AFAR = (0.3, -0.4, 0.4)

# subtask, what is seen before, during and after it (each: things, relations, where the hand is), what was wrong
VERBS = [
    ("CLOSE(box)", ([BOX, DOOR], [("box/door", "open")], AFAR), ([BOX, DOOR], [("box/door", "closed")], AFAR), ""),
    (
        "SHUT(box)",
        ([BOX, DOOR], [("box/door", "open")], AFAR),
        ([BOX, DOOR], [("box/door", "open")], AFAR),
        "not-closed",
    ),
    ("PICK_UP(napkin)", ([NAPKIN], ON_TABLE, AFAR), ([NAPKIN], [("napkin", "held")], (0.5, 0.0, 0.02)), ""),
    ("GRASP(napkin)", ([NAPKIN], ON_TABLE, AFAR), ([NAPKIN], ON_TABLE, (0.5, 0.05, 0.02)), "closed-beside"),
    ("TAKE_OUT(napkin, bin)", ([NAPKIN, BIN], [("napkin", "in", "bin")], AFAR), ([NAPKIN, BIN], ON_TABLE, AFAR), ""),
    (
        "TAKE_OUT(napkin, bin)",
        ([NAPKIN, BIN], [("napkin", "in", "bin")], AFAR),
        ([NAPKIN, BIN], [("napkin", "in", "bin")], AFAR),
        "nothing-moved",
    ),
    ("PUT(napkin, bin)", ([NAPKIN, BIN], ON_TABLE, AFAR), ([NAPKIN, BIN], [("napkin", "in", "bin")], AFAR), ""),
    ("DROP(napkin, bin)", ([NAPKIN, BIN], ON_TABLE, AFAR), ([NAPKIN, BIN], [("napkin", "held")], AFAR), "still-held"),
    ("MOVE(napkin, bin)", ([NAPKIN, BIN], ON_TABLE, AFAR), ([at(NAPKIN, 0.44, -0.5, 0.02), BIN], ON_TABLE, AFAR), ""),
    ("MOVE(napkin, bin)", ([NAPKIN, BIN], ON_TABLE, AFAR), ([NAPKIN, BIN], ON_TABLE, AFAR), "not-beside"),
    ("UNSCREW(bottle cap)", ([BOTTLE, CAP], [], AFAR), ([BOTTLE, at(CAP, 0.4, 0.2, 0.01)], [], AFAR), ""),
    ("TAKE_OFF(bottle cap)", ([BOTTLE, CAP], [], AFAR), ([BOTTLE, CAP], [], CAP.pose.position), "cap-still-on"),
    ("PRESS(bell button)", ([BELL, BUTTON], [], AFAR), ([BELL, BUTTON], [], BUTTON.pose.position), ""),
    ("PRESS(bell button)", ([BELL, BUTTON], [], AFAR), ([BELL, BUTTON], [], AFAR), "nothing-moved"),
    (
        "POUR(salt shaker, bowl)",
        ([SHAKER, SALT, BOWL], [("salt", "in", "shaker")], AFAR),
        ([SHAKER, at(SALT, 0.5, 0.0, 0.03), BOWL], [("salt", "in", "bowl")], AFAR),
        "",
    ),
    (
        "SEASON(salt shaker, bowl)",
        ([SHAKER, SALT, BOWL], [("salt", "in", "shaker")], AFAR),
        ([SHAKER, SALT, BOWL], [("salt", "in", "shaker")], AFAR),
        "nothing-came-out",
    ),
    (
        "SHAKE(salt shaker, bowl)",
        ([SHAKER, SALT, BOWL], [("salt", "in", "shaker")], AFAR),
        ([SHAKER, at(SALT, 0.3, 0.3, 0.0), BOWL], [("salt", "on", "table")], AFAR),
        "poured-beside",
    ),
    ("WIPE(plate, sponge)", ([PLATE, SPONGE], [], AFAR), ([PLATE, SPONGE], [], AFAR), "not-wiped"),
    ("RELEASE(napkin)", ([NAPKIN], [("napkin", "held")], AFAR), ([NAPKIN], [("napkin", "held")], AFAR), "still-held"),
    ("CLEAR(table)", ([NAPKIN, BIN], ON_TABLE, AFAR), ([NAPKIN, BIN], ON_TABLE, AFAR), "goal-in"),
    ("CLEAR(table)", ([NAPKIN, BIN], ON_TABLE, AFAR), ([NAPKIN, BIN], [("napkin", "in", "bin")], AFAR), ""),
]


@pytest.mark.parametrize(
    ("subtask", "before", "after", "cause"), VERBS, ids=[f"{v[0]}-{v[3] or 'fine'}" for v in VERBS]
)
def test_every_verb_of_the_tasks_is_judged(subtask, before, after, cause):
    first, last = graph(*before), graph(*after)
    seen = (Sighting(0.0, first), Sighting(0.5, last))
    found = impression(Episode("tidy up", subtask, 1, first, last, seen, goal=("the napkin is in the bin",)))
    assert found.sure and (found.fine, found.cause) == (not cause, cause)


def test_a_plate_that_the_sponge_went_over_is_wiped():
    ways = [graph([PLATE, at(SPONGE, 0.5 + x, 0.1 + y, 0.04)]) for x in (-0.06, 0.0, 0.06) for y in (-0.06, 0.0, 0.06)]
    seen = tuple(Sighting(float(i), scene) for i, scene in enumerate(ways))
    found = impression(Episode("clean up", "WIPE(plate, sponge)", 1, ways[0], ways[-1], seen))
    assert found.sure and found.fine


def test_the_robots_own_words_are_heard_about_any_verb():
    nodes = [NAPKIN, BIN, STOVE, KNOB]
    scene = graph(nodes, [("napkin", "on", "table")])
    for spoken, cause in (
        ("MotionError: move_to: [1, 0, 0] is out of the arm's reach", "refused"),
        ("MotionError: press_along: 67 N were felt, more than the 60 N this arm may press with", "too-hard"),
    ):
        found = impression(Episode("cook", "TURN_ON(stove)", 1, scene, scene, (Sighting(0.0, scene),), spoken))
        assert found.cause == cause


def test_what_nobody_sees_may_be_behind_the_door_that_is_closed():
    scene = graph([BOX, DOOR], [("box/door", "closed")])
    spoken = "line 3: UnknownName: unknown object 'apple' (available: box, box door)"
    found = impression(Episode("get the apple", "PICK_UP(apple)", 1, scene, scene, (), spoken))
    assert found.cause == "out-of-sight" and found.blanks["place"] == "box door" and found.about_plan


def test_what_of_a_goal_cannot_be_seen_is_told_by_sentence():
    block = Body("block", (Geom("box", (0.04, 0.04, 0.04)),), Pose((0.5, 0.0, 0.02)), Free(), label="block")
    scene = SceneDescription((block,))
    assert unseen_goal(("the block is on the table",), scene) == []
    told = unseen_goal(("the block is on the mat", "the block looks happy"), scene)
    assert told[0] == "'the block is on the mat' names 'mat', which is none of block, table"
    assert told[1].startswith("'the block looks happy' has none of the ") and len(told) == 2
    assert unseen_goal((), scene) == ["it has no goal sentences"]


@pytest.mark.parametrize(
    ("sentence", "meant"),
    [
        ("the napkin is onn the table", "the napkin is on the table"),
        ("the napkin is inn the bin.", "the napkin is in the bin"),
        ("the hand has let got of the napkin", "the hand has let go of the napkin"),
    ],
)
def test_a_misspelt_form_gets_the_near_one(sentence, meant):
    block = Body("napkin", (Geom("box", (0.04, 0.04, 0.04)),), Pose((0.5, 0.0, 0.02)), Free(), label="napkin")
    [told] = unseen_goal((sentence,), SceneDescription((block,)))
    assert told.endswith(f"did you mean {meant!r}?")


def test_a_goal_that_is_fulfilled_as_a_whole_at_the_start_is_found():
    start = graph([NAPKIN, BIN], [("napkin", "on", "table")])
    let_go = "the hand has let go of the napkin"
    assert met_at_start((let_go, "the napkin is on the table"), start)
    assert not met_at_start((let_go, "the napkin is in the bin"), start) and not met_at_start((), start)
    assert not met_at_start((let_go, "the napkin looks happy"), start)


def test_a_goal_that_the_scene_words_otherwise_is_told_with_its_sentence():
    """A plate that is a part of a warmer: something in its middle is on it, and reported on the warmer."""
    warmer = Node("warmer", "warmer", Pose((0.5, 0.2, 0.03)), (0.2, 0.2, 0.06), kind="fixture")
    plate = Node("warmer/plate", "hot plate", Pose((0.5, 0.2, 0.065)), (0.12, 0.12, 0.01), "warmer", "part")
    before, placed = at(NAPKIN, 0.3, 0.0, 0.02), at(NAPKIN, 0.5, 0.2, 0.09)
    start = graph([before, warmer, plate], [("napkin", "on", "table")])
    end = graph([placed, warmer, plate], [("napkin", "on", "warmer")])

    def told(goal: str) -> list[str]:
        return unmet_goal(TaskEpisode("put it there", start, end, (goal,)))

    said = "'the napkin is on the hot plate' is fulfilled, but planners read 'the napkin is on the warmer'"
    assert told("the napkin is on the hot plate") == [said]
    assert told("the napkin is on the warmer") == []
