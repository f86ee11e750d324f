"""What each lesion does to a lesson and to a scene. Its effect on a run: tests/benchmarks/test_lesion_effects.py."""

from __future__ import annotations

import ast
import random

import numpy as np
import pytest

from memo_core.config import load_experiment
from memo_core.environment.task_environment import generator
from memo_core.errors import InvalidArgument, UnknownName
from memo_core.evaluation.lesions import (
    LESIONS,
    Taught,
    VariedTask,
    arc_reversed,
    calls_shuffled,
    function_only,
    functions_failing,
    keys_shuffled,
    lesioned_copy,
    mirrored,
    no_function_notes,
    no_functions,
    nonsense,
    opposite,
)
from memo_core.interfaces.task import Task
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, task_of, tasks_of
from memo_core.runs.sections import SECTIONS
from memo_core.scene.description import Hinge
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import functions_of, merge_notes, merge_programs
from memo_core.skillbook.model.functions import as_template, read_function
from memo_core.skillbook.model.keys import Key
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

SEED = 1
ARC = """def f(a, angle=1.0):
    '''Opens a.'''
    s = turn_point(p, q, z, 0.1)
    move_straight(turn_point(p, q, z, angle * s))
"""
LESSON = (
    Taught("correction", Key("open", ("jar",)), "Pull it in an arc. Do not pull straight."),
    Taught("general", Key("open", ("jar",)), "Doors swing."),
    Taught("template", Key("open", ("jar",)), ARC),
    Taught("correction", Key("place", ("food", "jar")), "Let go at the end."),
)

SWING = f"""def swing(door, angle=1.0):
    '''Swing it open.'''
    # {"a comment that is long enough for merging to pay " * 5}
    move_straight(turn_point(door, door, door, angle * 2))
"""
LEARNT = (
    Taught("correction", Key("open", ("jar",)), "Pull it in an arc."),
    Taught("correction", Key("place", ("food", "jar")), "Let go at the end."),
    Taught("template", Key("place", ("food", "jar")), ARC),
    Taught("function", Key("open", ("jar",)), SWING),
    Taught("call", Key("open", ("jar",)), "swing('jar')"),
    Taught("call", Key("open", ("box",)), "swing('box', angle=2.0)"),
    Taught("call", Key("open", ("tin",)), "swing('tin')"),
)


# -- what lesions do to a lesson --------------------------------------------------------------------------------------


def test_no_entry_keeps_its_key_and_nothing_stays_general():
    for seed in range(10):
        shuffled = keys_shuffled(LESSON, random.Random(seed))
        assert [one.text for one in shuffled] == [one.text for one in LESSON]
        assert all(new.about.action != old.about.action for new, old in zip(shuffled, LESSON, strict=True))
        assert all(one.kind != "general" for one in shuffled)
    [alone] = keys_shuffled(LESSON[:1], random.Random(0))
    assert alone.about != LESSON[0].about


def test_nonsense_has_the_same_length_and_none_of_the_words():
    for new, old in zip(nonsense(LESSON, random.Random(0)), LESSON, strict=True):
        assert len(new.text) == len(old.text) and new.about == old.about
        assert not set(new.text.lower().split()) & {"pull", "arc", "doors", "swing", "turn_point"}


def test_the_opposite_negates_every_sentence_and_has_no_template():
    told = opposite(LESSON, random.Random(0))
    assert told[0].text == "Do not pull it in an arc. Pull straight."
    assert all(one.kind != "template" for one in told)


def test_a_reversed_arc_goes_the_other_way_but_still_probes_the_right_way():
    [reversed_] = arc_reversed(LESSON, random.Random(0))
    assert "turn_point(p, q, z, 0.1)" in reversed_.text and "turn_point(p, q, z, -(angle * s))" in reversed_.text
    ast.parse(reversed_.text)


def test_a_reversed_arc_path_goes_the_other_way():
    code = "def f(angle):\n    follow_path(arc_path(p, o, q, z, angle))\n    return arc_path(p, o, q, z, angle=angle)\n"
    [reversed_] = arc_reversed([Taught("template", Key("open", ("jar",)), code)], random.Random(0))
    assert reversed_.text.count("-angle") == 2


def test_a_lesioned_copy_needs_an_empty_book_and_a_known_lesion(tmp_path):
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore()) as book:
        feedback = book.record_feedback("swing it", "ana", subtask="OPEN(jar)")
        book.add_lessons(feedback, "OPEN(jar)", ["Pull it in an arc."], ["Doors swing."])
        with pytest.raises(UnknownName, match="did you mean"):
            lesioned_copy(book, book, "keys-shufled")
        with pytest.raises(InvalidArgument, match="not empty"):
            lesioned_copy(book, book, "nonsense")
        with Skillbook("sqlite://", FakeEmbedder(), FakeStore()) as copy:
            lesioned_copy(book, copy, "intact")
            assert [(e.kind, e.key, e.text) for e in copy.entries()] == [
                (e.kind, e.key, e.text) for e in book.entries()
            ]


# -- what lesions do to functions -------------------------------------------------------------------------------------


def test_a_failing_function_raises_at_once_and_is_otherwise_the_same():
    [changed] = [
        new for new, old in zip(functions_failing(LEARNT, random.Random(0)), LEARNT, strict=True) if new != old
    ]
    with pytest.raises(RuntimeError):
        exec(f"{changed.text}\nswing('jar')")
    lines = [line for line in changed.text.splitlines() if "raise" not in line]
    assert lines == SWING.splitlines() and read_function(changed.text) == read_function(SWING)


def test_no_call_stays_under_its_key_and_nothing_else_moves():
    for seed in range(10):
        shuffled = calls_shuffled(LEARNT, random.Random(seed))
        assert sorted(one.text for one in shuffled) == sorted(one.text for one in LEARNT)
        moved = [(new.about, old.kind) for new, old in zip(shuffled, LEARNT, strict=True) if new.text != old.text]
        assert moved == [(one.about, "call") for one in LEARNT[4:]]
    assert calls_shuffled(LEARNT[:5], random.Random(0)) == list(LEARNT[:5])


def test_a_function_alone_has_its_first_call_and_without_its_notes_keeps_those_of_other_keys():
    assert function_only(LEARNT, random.Random(0)) == list(LEARNT[3:5])
    assert no_function_notes(LEARNT, random.Random(0)) == list(LEARNT[1:])


def test_without_functions_each_call_is_a_template_with_its_arguments():
    without = no_functions(LEARNT, random.Random(0))
    calls = [one for one in LEARNT if one.kind == "call"]
    assert [(one.about, one.text) for one in without if one.kind == "template"][-len(calls) :] == [
        (one.about, as_template(SWING, one.text)) for one in calls
    ]
    assert not [one for one in without if one.kind in ("call", "function")]


@pytest.fixture(scope="module")
def merged():
    """A book with one function of two keys, one note of both, and the scenes in which they were taught."""
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore()) as book:
        for thing in ("jar", "box"):
            said = book.record_feedback(
                "swing it", "ana", subtask=f"OPEN({thing})", scene_graph=f"scene of the {thing}"
            )
            book.add_lessons(said, f"OPEN({thing})", ["Pull it in an arc."])
            approval = book.record_feedback("", "ana", subtask=f"OPEN({thing})", kind="approval")
            book.add_template(approval, f"OPEN({thing})", SWING.replace("swing(door", f"swing(door='{thing}'"))
        assert len(merge_programs(book, ())) == 1 and len(merge_notes(book)) == 1
        yield book


def test_an_intact_copy_calls_the_same_function_under_every_key_of_the_book(merged):
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore()) as copy:
        lesioned_copy(merged, copy, "intact")
        [function], [copied] = functions_of(merged), functions_of(copy)
        assert copied.entry.text == function.entry.text
        assert [(one.key, one.text) for one in copied.calls] == [(one.key, one.text) for one in function.calls]
        notes = [(str(one.key), copy.feedback(one.feedback).scene_graph) for one in copy.entries("correction")]
        assert notes == [("OPEN(jar)", "scene of the jar"), ("OPEN(box)", "scene of the box")]


@pytest.mark.parametrize("lesion", LESIONS)
def test_no_lesion_makes_a_note_of_a_program(merged, lesion):
    with Skillbook("sqlite://", FakeEmbedder(), FakeStore()) as copy:
        lesioned_copy(merged, copy, lesion)
        notes = [one.text for kind in ("correction", "general") for one in copy.entries(kind)]
        assert not [text for text in notes if "def " in text or "(" in text]
        assert bool(copy.entries("call")) == bool(copy.entries("function"))


# -- what lesions do to a scene ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def experiment():
    return load_experiment(Registry(), None, ["run.video=off", "run.repairs=0", "run.repeats=1"], SECTIONS, None, SEED)


def hinges_of(task: Task) -> list[Hinge]:
    return [body.joint for body, _ in task.scene(generator(SEED, "scene")).walk() if isinstance(body.joint, Hinge)]


def test_a_mirrored_scene_is_a_mirror_image_and_twice_is_the_scene(experiment):
    for task in tasks_of(experiment):
        scene = task.scene(generator(SEED, "scene"))
        image = mirrored(scene)
        for (body, _), (other, _) in zip(scene.walk(), image.walk(), strict=True):
            x, y, z = body.pose.position
            assert other.pose.position == (x, -y, z)
        assert mirrored(image) == scene


@pytest.mark.sim
def test_a_mirrored_door_opens_to_the_mirrored_side(experiment):
    """Seen through physics: a door pushed to one angle has its handle where the mirror shows it."""
    demo = experiment.choice("suite").backend.demo
    task = task_of(experiment, demo.taught)
    where = {}
    for name, one in (("plain", task), ("mirrored", VariedTask(task, mirrored, "mirrored"))):
        with environment_of(experiment, one, SEED) as world:
            handle = next(node for node in world.look().nodes if node.label.split()[-1] == "handle")
            where[name] = np.asarray(handle.pose.position)
    assert where["mirrored"] == pytest.approx(where["plain"] * [1, -1, 1], abs=1e-3)
    plain, image = hinges_of(task)[0], hinges_of(VariedTask(task, mirrored, "mirrored"))[0]
    assert image.range == plain.range and image.axis == (-plain.axis[0], plain.axis[1], -plain.axis[2])
