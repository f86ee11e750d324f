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
    Taught,
    VariedTask,
    arc_reversed,
    keys_shuffled,
    lesioned_copy,
    mirrored,
    nonsense,
    opposite,
)
from memo_core.interfaces.task import Task
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, task_of, tasks_of
from memo_core.runs.sections import SECTIONS
from memo_core.scene.description import Hinge
from memo_core.skillbook.book import Skillbook
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
