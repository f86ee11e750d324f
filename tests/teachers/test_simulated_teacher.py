"""The simulated teacher sees only what a person in the room would, and says what seemed wrong."""

from __future__ import annotations

import ast
import math
from pathlib import Path

import attrs
import numpy as np
import pytest
import yaml

import memo_core.teachers.episode_assessment as episode_assessment
import memo_core.teachers.impression as impression_module
import memo_core.teachers.opening_assessment as opening_assessment
import memo_core.teachers.simulated_teacher as simulated_teacher
import memo_core.teachers.visible as visible
import memo_core.teachers.visible_goal as visible_goal
from memo_core.errors import InvalidArgument
from memo_core.interfaces.teacher import Episode, Proposal, Sighting, TaskEpisode
from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose, quaternion_from_axis_angle
from memo_core.teachers.episode_assessment import impression
from memo_core.teachers.scripted import Line, ScriptedTeacher, ScriptSettings
from memo_core.teachers.simulated_teacher import SimulatedTeacher, SimulatedTeacherSettings

HINGE = Pose((0.6, -0.2, 0.2))
DOOR_SIZE = (0.02, 0.4, 0.3)


def scene_with_door(angle: float, hand: Pose, width: float, slid: float = 0.0, handle_y: float = 0.37) -> SceneGraph:
    """A chest whose door hangs on its right edge, turned by ``angle`` (rad) or pulled out by ``slid`` (m)."""
    hinge = HINGE * Pose((-slid, 0, 0), quaternion_from_axis_angle((0, 0, 1), angle))
    door = hinge * Pose((0, 0.2, 0))
    handle = hinge * Pose((-0.04, handle_y, 0))
    state = "closed" if angle < 0.1 and slid < 0.02 else "open"
    return SceneGraph(
        nodes=(
            Node("chest", "chest", Pose((0.75, 0, 0.2)), (0.3, 0.4, 0.3), kind="fixture"),
            Node("chest/door", "chest door", door, DOOR_SIZE, part_of="chest", kind="part"),
            Node("chest/handle", "chest handle", handle, (0.02, 0.02, 0.12), part_of="chest/door", kind="part"),
        ),
        relations=(Relation("chest/door", state),),
        observation=Observation(hand, width, False),
    )


def door_episode(angles, hands, widths, slides=None, handle_y=0.37) -> Episode:
    slides = slides or [0.0] * len(angles)
    graphs = [
        scene_with_door(a, Pose(tuple(h)), w, s, handle_y)
        for a, h, w, s in zip(angles, hands, widths, slides, strict=True)
    ]
    sightings = tuple(Sighting(float(i), graph) for i, graph in enumerate(graphs))
    return Episode("open the chest", "OPEN(chest)", 1, graphs[0], graphs[-1], sightings)


def handle_at(angle: float, slid: float = 0.0, handle_y: float = 0.37) -> np.ndarray:
    hinge = HINGE * Pose((-slid, 0, 0), quaternion_from_axis_angle((0, 0, 1), angle))
    return np.asarray((hinge * Pose((-0.04, handle_y, 0))).position)


def straight_pull_that_slips() -> Episode:
    start = handle_at(0.0)
    angles = [0, 0, 0.15, 0.3, 0.3, 0.3]
    hands = [start + [-0.2, 0, 0], start] + [start + [-d, 0, 0] for d in (0.05, 0.1, 0.15, 0.2)]
    return door_episode(angles, hands, [0.05, 0.018, 0.018, 0.018, 0.0, 0.0])


def arc_pull(final: float) -> Episode:
    turns = np.linspace(0, final, 8)
    angles = [0.0, *turns, final]
    hands = [handle_at(0) + [-0.2, 0, 0], *[handle_at(a) for a in turns], handle_at(final) + [-0.1, 0, 0.1]]
    return door_episode(angles, hands, [0.05] + [0.018] * 8 + [0.05])


def test_a_straight_pull_on_a_swinging_door_is_called_that():
    seen = impression(straight_pull_that_slips())
    assert not seen.fine and seen.cause == "straight-on-swing"


def test_a_pull_that_the_door_bends_before_it_slips_still_looks_straight():
    start = handle_at(0.0)
    angles = [0, 0, 0.03, 0.3, 0.42, 0.42, 0.42]
    hands = [start + [-0.2, 0, 0], start] + [
        start + [-d, s, 0] for d, s in ((0.01, 0), (0.09, 0.04), (0.15, 0.05), (0.15, 0), (0.2, 0))
    ]
    seen = impression(door_episode(angles, hands, [0.05, 0.018, 0.018, 0.018, 0.0, 0.0, 0.05]))
    assert seen.cause == "straight-on-swing"


def test_a_door_led_wide_open_is_fine_and_half_open_is_not():
    assert impression(arc_pull(math.radians(80))).fine
    assert impression(arc_pull(math.radians(40))).cause == "not-far-enough"


def test_a_drawer_that_is_pulled_straight_is_fine_and_an_arc_on_it_is_named():
    distances = [0, 0, 0.05, 0.1, 0.1]
    hands = [handle_at(0, 0, 0.2) + [-0.2, 0, 0], *[handle_at(0, d, 0.2) for d in distances[1:]]]
    out = door_episode([0] * 5, hands, [0.05, 0.018, 0.018, 0.018, 0.05], distances, 0.2)
    assert impression(out).fine
    bent = [0, 0, 0.01, 0.015, 0.015]
    hands = [
        handle_at(0, 0, 0.2) + [-0.2, 0, 0],
        *[handle_at(0, 0, 0.2) + [-d, d * d * 10, 0] for d in (0, 0.05, 0.1, 0.12)],
    ]
    assert impression(door_episode([0] * 5, hands, [0.05] + [0.018] * 4, bent, 0.2)).cause == "arc-on-slide"


def test_a_hand_that_never_came_near_is_told_to_take_the_handle():
    hands = [handle_at(0) + [-0.5, 0.3, 0.3], handle_at(0) + [-0.3, 0.3, 0.3]]
    assert impression(door_episode([0, 0], hands, [0.08, 0.08])).cause == "untouched-handle"


def thing_episode(
    subtask: str, thing: Pose, relations: tuple[Relation, ...], hand: tuple[float, float, float]
) -> Episode:
    def graph(pose: Pose, relations: tuple[Relation, ...], hand: tuple[float, float, float]) -> SceneGraph:
        nodes = (
            Node("block", "block", pose, (0.05,) * 3),
            Node("tray", "tray", Pose((0.5, 0.3, 0.01)), (0.2, 0.2, 0.02)),
        )
        return SceneGraph(nodes, relations, Observation(Pose(hand), 0.08, False))

    before = graph(Pose((0.4, 0, 0.025)), (), (0.3, 0, 0.4))
    after = graph(thing, relations, hand)
    return Episode("task", subtask, 1, before, after, (Sighting(0, before), Sighting(1, after)))


def test_holding_what_was_to_be_picked_up_is_fine_and_missing_it_names_the_side():
    held = thing_episode("PICK_UP(block)", Pose((0.4, 0, 0.2)), (Relation("block", "held"),), (0.4, 0, 0.2))
    assert impression(held).fine
    missed = impression(thing_episode("PICK_UP(block)", Pose((0.4, 0, 0.025)), (), (0.4, -0.06, 0.03)))
    assert missed.cause == "closed-beside" and missed.blanks["side"] == "left"


def test_a_thing_beside_its_place_is_noticed():
    on = thing_episode(
        "PLACE(block, tray)", Pose((0.5, 0.3, 0.045)), (Relation("block", "on", "tray"),), (0.5, 0.3, 0.2)
    )
    assert impression(on).fine
    assert (
        impression(thing_episode("PLACE(block, tray)", Pose((0.5, 0.05, 0.025)), (), (0.5, 0.05, 0.2))).cause
        == "landed-beside"
    )


def test_an_unknown_action_leaves_the_teacher_silent():
    episode = attrs.evolve(arc_pull(1.4), subtask="YODEL(chest)")
    teacher = SimulatedTeacher(SimulatedTeacherSettings(misjudges=0.0))
    teacher.open()
    assert teacher.judge(episode).kind == "silent"


def test_every_cause_has_five_phrasings_and_every_blank_can_be_filled():
    phrases = yaml.safe_load(Path(simulated_teacher.__file__).with_name("phrases.yaml").read_text())
    for cause, said in phrases.items():
        assert len(set(said)) >= 5, cause
        for phrase in said:
            phrase.format(object="block", place="tray", side="left", amount="3 cm")
    named = set(episode_assessment._UNMET.values())
    for module in (episode_assessment, opening_assessment):
        tree = ast.walk(ast.parse(Path(module.__file__).read_text()))
        named |= {node.value for node in tree if isinstance(node, ast.Constant) and isinstance(node.value, str)}
    unmet = {episode_assessment._UNMET.get(form, f"goal-{form}") for form, _ in visible_goal.FORMS}
    assert set(phrases) <= named | unmet, "a cause nobody ever names"
    assert unmet <= set(phrases), "a condition of which nobody could say that it is not met"


def test_every_sentence_names_something_that_can_be_seen():
    """A thing, a place, or what anybody sees of a hand and of doors."""
    seen = {"handle", "door", "drawer", "hand", "fingers", "arc", "curve", "hinge", "side", "front", "top", "below"}
    seen |= {"drop", "dropped", "grip", "slipped", "tilt", "open", "tip", "out", "left", "right", "further", "deeper"}
    phrases = yaml.safe_load(Path(simulated_teacher.__file__).with_name("phrases.yaml").read_text())
    for cause, said in phrases.items():
        for phrase in said:
            if cause.startswith("refused"):
                continue  # an answer to what the robot said aloud
            words = set(phrase.replace(",", " ").replace("'s", "").split())
            assert words & (seen | {"{object}", "{place}", "{side}"}), f"{cause}: {phrase}"


def test_who_knows_the_thing_says_what_they_know_once_the_hand_is_at_it():
    teacher = SimulatedTeacher(SimulatedTeacherSettings(misjudges=0.0, knows="lift it first"))
    teacher.open()
    assert teacher.judge(straight_pull_that_slips()).words == "lift it first"
    assert teacher.judge(arc_pull(math.radians(80))).kind == "approve"
    far = attrs.evolve(arc_pull(0.0), sightings=())
    assert teacher.judge(far).words not in ("", "lift it first")


def test_the_stated_rate_of_misjudgement_is_kept():
    teacher = SimulatedTeacher(SimulatedTeacherSettings(misjudges=0.3, seed=1))
    teacher.open()
    good = arc_pull(math.radians(80))
    wrong = sum(teacher.judge(good).kind == "correct" for _ in range(400))
    assert 0.22 < wrong / 400 < 0.38
    sure = SimulatedTeacher(SimulatedTeacherSettings(misjudges=0.0))
    sure.open()
    assert {sure.judge(good).kind for _ in range(50)} == {"approve"}


def test_the_same_seed_says_the_same_words_and_phrases_vary():
    def said(seed: int) -> list[str]:
        teacher = SimulatedTeacher(SimulatedTeacherSettings(misjudges=0.0, seed=seed))
        teacher.open()
        return [teacher.judge(straight_pull_that_slips()).words for _ in range(20)]

    assert said(3) == said(3)
    assert len(set(said(3))) >= 4


MODULES = [episode_assessment, impression_module, opening_assessment, simulated_teacher, visible, visible_goal]


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__.rsplit(".", 1)[1])
def test_a_simulated_teacher_cannot_import_what_a_person_cannot_see(module):
    """Only scene graphs, poses and the teacher's interface: no simulator, task, description, sandbox, policy or arm."""
    allowed = {
        "memo_core.errors",
        "memo_core.text.parsing",
        "memo_core.scene.graph",
        "memo_core.scene.pose",
        "memo_core.interfaces.teacher",
    } | {module.__name__ for module in MODULES}
    for node in ast.walk(ast.parse(Path(module.__file__).read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("memo"):
            imported = {f"{node.module}.{alias.name}" for alias in node.names}
            assert node.module in allowed or imported <= allowed, node.module
        if isinstance(node, ast.Import):
            assert not any(alias.name.startswith("memo") for alias in node.names)
    for shown in (Episode, TaskEpisode, Proposal):
        assert not {"joint_position", "check", "success", "code"} & {f.name for f in attrs.fields(shown)}


def test_a_script_is_followed_line_by_line_and_silent_otherwise():
    teacher = ScriptedTeacher(ScriptSettings(lines=(Line("OPEN(*)", "pull in an arc", 1), Line("OPEN(*)"))))
    first = arc_pull(0.3)
    assert teacher.judge(first).words == "pull in an arc"
    assert teacher.judge(attrs.evolve(first, attempt=2)).kind == "approve"
    assert teacher.judge(attrs.evolve(first, subtask="CLOSE(chest)")).kind == "silent"


REACH = "line 9: MotionError: move_to: [0.4, 0.1, 0.2] is out of the arm's reach with the hand pointing forward"
HINT = "; it is reachable with the hand turned by 30 degrees, pointing "


@pytest.mark.parametrize(
    ("spoken", "cause", "edit", "value"),
    [
        (f"{REACH}{HINT}forward and 30 degrees down", "refused-tilt", "tilt", "down"),
        (f"{REACH}{HINT}20 degrees to the left of forward and 40 degrees up", "refused-tilt", "tilt", "up"),
        (f"{REACH}{HINT}down", "refused-from", "approach", "top"),
        (f"{REACH}{HINT}forward", "refused-from", "approach", "front"),
        (f"{REACH}; the arm falls short by at most 4 cm", "refused", "approach", ""),
        (
            "MotionError: move_to: [0, 0, 0] cannot be reached, because the hand would hit the shelf",
            "refused",
            "approach",
            "",
        ),
        ("line 3: NameError: grip is not defined", "nothing-moved", "", ""),
    ],
)
def test_a_robot_that_says_why_it_did_not_move_is_told_what_would_help(spoken, cause, edit, value):
    from memo_offline.reading import read

    still = Pose((0.3, 0.0, 0.5))
    seen = [scene_with_door(0.0, still, 0.08)] * 3
    episode = attrs.evolve(
        arc_pull(1.4),
        before=seen[0],
        after=seen[0],
        sightings=tuple(Sighting(0.5 * i, scene) for i, scene in enumerate(seen)),
        spoken_error=spoken,
    )
    found = impression(episode)
    assert found.cause == cause and not found.fine
    if not edit:
        return
    found_nodes = seen[0].nodes
    for phrase in yaml.safe_load(Path(simulated_teacher.__file__).with_name("phrases.yaml").read_text())[cause]:
        words = phrase.format(**found.blanks)
        edits = read(words, found_nodes).edits
        assert [one.phrase.matter for one in edits] == [edit], words
        assert value in edits[0].phrase.value, words


def failing_episodes(teacher: SimulatedTeacher, count: int) -> list[str]:
    teacher.open()
    hands = [handle_at(0.0) - np.array([0.3, 0, 0])] + [handle_at(0.0) - np.array([0.01 * i, 0, 0]) for i in range(12)]
    episode = door_episode([0.0] * 13, hands, [0.08] + [0.02] * 12)
    return [
        verdict.words if (verdict := teacher.judge(episode)).kind == "correct" else verdict.kind for _ in range(count)
    ]


def test_a_participant_says_things_in_a_vocabulary_and_a_manner_of_their_own():
    def said(who: str, seed: int = 0) -> set[str]:
        settings = SimulatedTeacherSettings(who=who, seed=seed, misjudges=0.0, phrasings=2, manner="hm, {}")
        return set(failing_episodes(SimulatedTeacher(settings), 30))

    assert len(said("S01")) == 2 and all(words.startswith("hm, ") for words in said("S01"))
    assert said("S01", seed=7) == said("S01")  # whatever else is drawn
    assert any(said(f"S0{number}") != said("S01") for number in range(2, 6))


@pytest.mark.parametrize("trait", ["attention", "useless", "wrong"])
def test_inattentive_useless_and_wrong_remarks_come_at_their_rates(trait):
    plain = set(failing_episodes(SimulatedTeacher(SimulatedTeacherSettings(misjudges=0.0)), 60))
    rate = {"attention": 0.5} if trait == "attention" else {trait: 0.5}
    words = failing_episodes(SimulatedTeacher(SimulatedTeacherSettings(misjudges=0.0, **rate)), 60)
    other = [one for one in words if one not in plain]
    assert 15 <= len(other) <= 45
    assert all(one == "silent" for one in other) == (trait == "attention")


def test_a_manner_without_a_place_for_the_remark_is_refused():
    with pytest.raises(InvalidArgument, match="manner"):
        SimulatedTeacher(SimulatedTeacherSettings(manner="please"))
