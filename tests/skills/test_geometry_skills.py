"""The skills of geometry keep their invariants, say what is wrong with an argument, and replace what programs wrote."""

from __future__ import annotations

import gzip
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import assume, given, strategies as st

import memo_core as memo
from memo_core.environment.task_verification import run_code
from memo_core.errors import InvalidArgument, UnknownName
from memo_core.sandbox import Execution, Sandbox
from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose, multiply_quaternions, quaternion_from_axis_angle
from memo_core.skills.contract import (
    BUILTIN_SKILLS,
    angle_about,
    arc_path,
    get_face_normal,
    get_level_axes,
    hand_axis,
    side_orientation,
    top_orientation,
    turn_orientation,
    turn_point,
)
from memo_core.skills.recording_control import Command, RecordingControl
from memo_core.skills.skill import skill_library

DATA = Path(__file__).parents[1] / "data"
GEOMETRY = (get_level_axes, get_face_normal, hand_axis, angle_about, arc_path)
UP = [0.0, 0.0, 1.0]
HAND = Pose((0.4, 0.0, 0.4), (0.0, 1.0, 0.0, 0.0))
DOOR = Node("door", "fridge door", Pose.from_yaw((0.693, 0.064, 0.25), -0.05), (0.018, 0.36, 0.494))
HANDLE = Node("handle", "fridge handle", Pose.from_yaw((0.630, -0.083, 0.3), -0.05), (0.018, 0.018, 0.2))

numbers = st.floats(-1.0, 1.0)
points = st.lists(numbers, min_size=3, max_size=3)
directions = points.filter(lambda v: np.linalg.norm(v) > 0.1)
angles = st.floats(-6.0, 6.0)
quaternions = st.lists(numbers, min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1)


@pytest.fixture(scope="module")
def sandbox():
    with Sandbox(skill_library(BUILTIN_SKILLS)) as opened:
        yield opened


def robot(*nodes: Node) -> RecordingControl:
    return RecordingControl(SceneGraph(nodes or (DOOR, HANDLE), (), Observation(HAND, 0.08, False), 0.0))


def unit(vector) -> np.ndarray:
    return np.asarray(vector) / np.linalg.norm(vector)


def turned(vector, axis, angle):
    return turn_point.call(None, (vector, [0, 0, 0], axis, angle))


# -- invariants --------------------------------------------------------------------------------------------------------


@given(points, quaternions, points, directions, angles)
def test_an_arc_keeps_its_distance_to_the_axis_and_ends_where_a_turn_does(position, orientation, pivot, axis, angle):
    orientation = unit(orientation).tolist()
    path = arc_path.call(None, (position, orientation, pivot, axis, angle))
    k, arm = unit(axis), np.subtract(position, pivot)
    for point, _ in path:
        moved = np.subtract(point, pivot)
        assert k @ moved == pytest.approx(k @ arm, abs=1e-9)
        assert np.linalg.norm(np.cross(k, moved)) == pytest.approx(np.linalg.norm(np.cross(k, arm)), abs=1e-9)
    assert path[-1][0] == pytest.approx(turn_point.call(None, (position, pivot, axis, angle)), abs=1e-9)
    end = turn_orientation.call(None, (orientation, axis, angle))
    assert abs(np.dot(path[-1][1], end)) == pytest.approx(1.0)


@given(directions, angles)
def test_the_hand_turns_with_an_arc_in_equal_steps_of_about_four_degrees(axis, angle):
    path = arc_path.call(None, ([0.5, 0, 0.3], [0, 1, 0, 0], [0.5, 0.3, 0.3], axis, angle))
    assert 12 <= len(path) <= 500 and abs(angle) / len(path) < math.radians(4.4)
    for number, (_, orientation) in enumerate(path, 1):
        expected = turned([0, 0, -1], axis, angle * number / len(path))
        assert hand_axis.call(None, (orientation,)) == pytest.approx(expected, abs=1e-9)


@given(directions, directions, st.floats(-3.1, 3.1))
def test_the_angle_between_a_direction_and_itself_turned_is_the_turn(axis, start, angle):
    assume(np.linalg.norm(np.cross(unit(axis), unit(start))) > 0.01)
    end = np.asarray(turned(start, axis, angle)) + 0.7 * np.asarray(axis)  # parts along the axis do not count
    assert angle_about.call(None, (axis, start, end.tolist())) == pytest.approx(angle, abs=1e-6)
    assert angle_about.call(None, (axis, end.tolist(), start)) == pytest.approx(-angle, abs=1e-6)


@given(st.floats(-3.0, 3.0))
def test_the_angle_from_y_is_the_yaw_at_which_the_fingers_close_along_a_direction(angle):
    along = [math.cos(angle), math.sin(angle), 0.0]
    yaw = angle_about.call(None, (UP, [0, 1, 0], along))
    assert hand_axis.call(None, (top_orientation.call(None, (yaw,)), "closing")) == pytest.approx(along, abs=1e-9)


@given(quaternions)
def test_a_hand_points_along_its_z_axis_and_closes_along_its_y_axis(quaternion):
    w, x, y, z = unit(quaternion)
    pointing = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]  # as 35 recorded programs write it
    closing = [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)]
    assert hand_axis.call(None, ([w, x, y, z],)) == pytest.approx(pointing, abs=1e-9)
    assert hand_axis.call(None, ((w, x, y, z), "closing")) == pytest.approx(closing, abs=1e-9)


def test_a_hand_from_the_side_points_along_its_direction_and_down_by_its_tilt():
    orientation = side_orientation.call(None, ([0, 2, 0], "vertical", 0.3))
    assert hand_axis.call(None, (orientation,)) == pytest.approx([0, math.cos(0.3), -math.sin(0.3)])
    assert hand_axis.call(None, (orientation, "closing")) == pytest.approx([0, math.sin(0.3), math.cos(0.3)])


@given(st.floats(-3.0, 3.0), st.sampled_from([(0, 1, 2), (1, 2, 0), (2, 0, 1)]))
def test_level_axes_are_level_and_square_with_the_shorter_extent_first(yaw, order):
    lying = {(0, 1, 2): (1, 0, 0, 0), (1, 2, 0): (0.5, 0.5, 0.5, 0.5), (2, 0, 1): (0.5, -0.5, -0.5, -0.5)}[order]
    pose = Pose((0.5, 0.1, 0.1), multiply_quaternions(quaternion_from_axis_angle(UP, yaw), lying))
    box = Node("box", "box", pose, (0.02, 0.3, 0.1))
    (first, short), (second, long) = get_level_axes.call(robot(box), ("box",))
    assert short <= long and first[2] == second[2] == 0.0
    assert np.dot(first, second) == pytest.approx(0.0, abs=1e-9)
    for direction, extent in ((first, short), (second, long)):
        assert np.linalg.norm(direction) == pytest.approx(1.0)
        axis = int(np.argmax(np.abs(pose.rotation.T @ direction)))
        assert extent == box.size[axis] and abs(pose.rotation[:, axis] @ direction) == pytest.approx(1.0)


def test_level_axes_of_a_tilted_box_are_made_level():
    pose = Pose((0.5, 0.1, 0.1), quaternion_from_axis_angle([0, 1, 0], 0.4))
    (first, _), (second, _) = get_level_axes.call(robot(Node("box", "box", pose, (0.02, 0.3, 0.1))), ("box",))
    assert first == pytest.approx([1, 0, 0]) and second == pytest.approx([0, 1, 0])


@given(quaternions, st.integers(0, 2), st.sampled_from([-1, 1]), st.floats(-0.01, 0.3), points)
def test_a_point_before_a_face_is_told_the_faces_normal(quaternion, axis, sign, before, aside):
    box = Node("box", "box", Pose((0.5, 0.1, 0.2), unit(quaternion)), (0.1, 0.2, 0.3))
    local = 0.3 * np.asarray(aside) * box.size  # within the other faces by a fifth of each extent
    local[axis] = sign * (box.size[axis] / 2 + before)
    point = box.pose.apply(local)
    assert get_face_normal.call(robot(box), ("box", point.tolist())) == pytest.approx(
        (sign * box.pose.rotation[:, axis]).tolist(), abs=1e-9
    )


# -- wrong arguments ---------------------------------------------------------------------------------------------------

WRONG = [
    (hand_axis, ([1, 1, 0, 0],), r"hand_axis\(orientation\): .*unit quaternion"),
    (hand_axis, ([1, 0, 0, 0], "sideways"), r"hand_axis\(axis\): 'sideways' is not a choice.*'pointing' or 'closing'"),
    (angle_about, ([0, 0, 0], [1, 0, 0], [0, 1, 0]), r"angle_about\(axis\): it has no length"),
    (angle_about, (UP, [0, 0, 0], [0, 1, 0]), r"angle_about\(start\): it has no length"),
    (angle_about, (UP, [1, 0, 0], [0, 0, -2]), r"angle_about\(end\): it is parallel to the axis"),
    (arc_path, ([0, 0], [1, 0, 0, 0], [0, 0, 0], UP, 1.0), r"arc_path\(position\): .*\[x, y, z\] in metres"),
    (arc_path, ([0, 0, 0], [1, 0, 0, 0], [0, 0, 0], [0, 0, 0], 1.0), r"arc_path\(axis\): it has no length"),
    (arc_path, ([0, 0, 0], [1, 0, 0, 0], [0, 0, 0], UP, 90), r"arc_path\(angle\): .*radians"),
    (get_face_normal, ("fridge door", [0, math.nan, 0]), r"get_face_normal\(point\)"),
    (
        get_face_normal,
        ("fridge door", list(DOOR.pose.position)),
        r"get_face_normal\(point\): it is midway between two",
    ),
]


@pytest.mark.parametrize(("called", "arguments", "message"), WRONG)
def test_what_is_wrong_with_an_argument_is_said(called, arguments, message):
    with pytest.raises(InvalidArgument, match=message):
        called.call(robot(), arguments)


@pytest.mark.parametrize("called", [get_level_axes, get_face_normal])
def test_a_name_that_is_not_in_the_scene_is_said(called):
    with pytest.raises(UnknownName, match="fridge dor"):
        called.call(robot(), ("fridge dor", [0.0, 0.0, 0.0])[: len(called.parameters)])


def test_the_skills_of_geometry_cost_a_prompt_less_than_1200_characters():
    assert sum(len(one.documentation()) + 2 for one in GEOMETRY) < 1200


@pytest.mark.process
def test_a_wrong_call_is_found_before_anything_moves(sandbox):
    code = "hand_axis()\narc_path([0, 0, 0], [1, 0, 0, 0], pivt=[0, 0, 0])"
    findings = [str(finding) for finding in sandbox.check(code)]
    assert findings[0].startswith("line 1: hand_axis needs the argument 'orientation'; it is hand_axis(")
    assert findings[1].startswith("line 2: arc_path has no argument 'pivt'; did you mean 'pivot'?")


# -- programs ----------------------------------------------------------------------------------------------------------


def run(sandbox: Sandbox, code: str) -> tuple[Execution, list[Command]]:
    control = robot()
    return sandbox.run(code, control, stopped=lambda: False), control.commands


def recorded(recording: str) -> str:
    """The first program of a recording."""
    with gzip.open(DATA / "recordings" / f"{recording}.jsonl.gz", "rt", encoding="utf-8") as lines:
        calls = [json.loads(line) for line in lines][1:]
    answer = next(one["answer"]["text"] for one in calls if one["call"]["phase"] == "code")
    found = re.search(r"```python\n(.*?)```", answer, re.DOTALL)
    assert found is not None
    return found[1]


def assert_same_motion(first: list[Command], second: list[Command]) -> None:
    assert len(first) > 20
    assert [(c.kind, c.amount, c.speed, c.free) for c in first] == [(c.kind, c.amount, c.speed, c.free) for c in second]
    for one, other in zip(first, second, strict=True):
        assert one.pose.position == pytest.approx(other.pose.position, abs=1e-9)
        assert abs(np.dot(one.pose.orientation, other.pose.orientation)) == pytest.approx(1.0)


@pytest.mark.process
def test_they_take_the_arrays_and_lists_that_programs_hold(sandbox):
    code = """
import numpy as np
h = np.array(get_position('fridge handle'))
out = np.array(get_face_normal('fridge door', h))
along, width = get_level_axes('fridge door')[1]
o = np.array(side_orientation(-out))
assert np.allclose(hand_axis(o), -out)
assert abs(abs(angle_about(np.array([0, 0, 1]), np.array(along), out)) - np.pi / 2) < 1e-6
follow_path(arc_path(h, o, h + 0.3 * np.array(along), [0, 0, 1], 0.5))
print(round(width, 2), len(arc_path(h.tolist(), tuple(o.tolist()), tuple(h), (0, 0, 1), np.pi / 2)))
"""
    execution, commands = run(sandbox, code)
    assert (execution.ended, execution.printed.strip(), len(commands)) == ("done", "0.36 22", 12), execution.error


@pytest.mark.process
@pytest.mark.parametrize("one", GEOMETRY, ids=lambda one: one.name)
@pytest.mark.parametrize(
    "code",
    [
        "def NAME(a, b, c, d, e, f):\n    return f\nprint(NAME(1, 2, 3, 4, 5, f=6))",
        "def go():\n    def NAME():\n        return 6\n    return NAME()\nprint(go())",
        "NAME = lambda *given: 6\nprint(NAME())",
        "NAME = 6\nprint(NAME)",
        "print(max([NAME for NAME in (5, 6)]))",
    ],
    ids=["function", "nested", "lambda", "value", "comprehension"],
)
def test_a_program_may_give_their_names_to_its_own_things(sandbox, one, code):
    execution, _ = run(sandbox, code.replace("NAME", one.name))
    assert (execution.ended, execution.printed.strip()) == ("done", "6"), execution.error


@pytest.mark.process
def test_a_recorded_program_with_its_own_functions_of_their_names_moves_as_it_did(sandbox):
    program = recorded("open-the-fridge-taught")
    assert "def ahead(o)" in program and "def arc(o, degrees)" in program and "def opened()" in program
    renamed = program
    for own, name in {
        "ahead": "hand_axis",
        "arc": "arc_path",
        "opened": "angle_about",
        "inner": "get_face_normal",
    }.items():
        renamed = re.sub(rf"\b{own}\(", f"{name}(", renamed)
    (first, motion), (second, other) = run(sandbox, program), run(sandbox, renamed)
    assert first.printed == second.printed and first.error == second.error
    assert_same_motion(motion, other)


def test_no_recorded_program_gives_one_of_their_names_to_something_else():
    names = "|".join(one.name for one in GEOMETRY)
    for file in DATA.glob("recordings/**/*.jsonl.gz"):
        with gzip.open(file, "rt", encoding="utf-8") as lines:
            answers = [one["answer"]["text"] for one in map(json.loads, lines) if one.get("answer")]
        defined = rf"(\bdef ({names})\b|(?<![.\w])({names})\s*=[^=])"
        assert not [text for text in answers if re.search(defined, text)], file


@pytest.mark.process
@pytest.mark.parametrize("recording", yaml.safe_load((DATA / "programs" / "rewritten.yaml").read_text("utf-8")))
def test_a_recorded_program_rewritten_with_them_is_shorter_and_moves_the_same(sandbox, recording):
    program = recorded(recording)
    rewritten = yaml.safe_load((DATA / "programs" / "rewritten.yaml").read_text("utf-8"))[recording]
    (first, motion), (second, other) = run(sandbox, program), run(sandbox, rewritten)
    assert first.printed == second.printed and first.error.partition(":")[2] == second.error.partition(":")[2]
    assert_same_motion(motion, other)
    assert len(program.splitlines()) - len(rewritten.splitlines()) >= 15


@pytest.mark.sim
@pytest.mark.process
def test_a_rewritten_program_opens_the_door_as_the_recorded_one_did(sandbox):
    rewritten = yaml.safe_load((DATA / "programs" / "rewritten.yaml").read_text("utf-8"))["open-the-fridge-taught"]
    doors, times = [], []
    for code in (recorded("open-the-fridge-taught"), rewritten):
        with memo.make_environment(memo.load(None, task="open-the-fridge", seed=0), "open-the-fridge") as environment:
            assert run_code(environment, code, sandbox).ended == "done"
            outcome = environment.check()
            assert outcome.success, outcome.reason
            doors.append(outcome.measures["door_rad"])
            times.append(environment.time())
    assert doors[0] == pytest.approx(doors[1], abs=1e-6) and times[0] == pytest.approx(times[1])
