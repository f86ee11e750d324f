"""A book of the suite's lessons, and whether the right one was served where it was needed."""

from __future__ import annotations

import pytest

from memo_core.config import load_experiment
from memo_core.errors import InvalidArgument
from memo_core.evaluation.lesson_book import make_lesson_book, needs_lesson
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import book_of, task_of, tasks_of
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook import raw_log
from memo_core.skillbook.model.keys import Key


def experiment(suite: str):
    return load_experiment(Registry(), None, [f"suite.backend={suite}"], SECTIONS, None, 0)


@pytest.mark.sim
def test_each_training_lesson_is_one_correction_under_the_subtask_that_needs_it(tmp_path):
    quirks = experiment("quirks")
    make_lesson_book(quirks, tmp_path / "lessons.db")
    with book_of(quirks, str(tmp_path / "lessons.db"), read_only=True) as book:
        kept = {(str(entry.key), entry.text) for entry in book.entries()}
        scenes = [said.scene_graph for said in raw_log.raw_log(book).feedback]
    training = [task for task in tasks_of(quirks) if task.split == "training"]
    assert kept == {(str(Key.parse(task.needed_at[0])), task.lesson) for task in training} and len(kept) == 8
    assert all("## Scene" in scene for scene in scenes)


def test_a_suite_without_lessons_is_refused(tmp_path):
    with pytest.raises(InvalidArgument, match=r"no training task of the suite 'tabletop' has .* `needed_at`"):
        make_lesson_book(experiment("tabletop"), tmp_path / "lessons.db")


@pytest.mark.parametrize(
    ("task", "subtask", "needed"),
    [
        ("open-the-safe", "PRESS(safe button)", True),
        ("open-the-safe", "PUSH_BUTTON(safe)", True),
        ("sugar-the-cake", "PICK_UP(sugar shaker)", False),
        ("sugar-the-cake", "SHAKE(sugar shaker, cake)", True),
        ("put-the-carton-on-the-board", "GRASP(carton)", True),
        ("open-the-wardrobe", "CLOSE(wardrobe)", False),
        ("open-the-wardrobe", "OPEN(freezer)", False),
    ],
)
def test_the_subtask_that_needs_a_lesson_is_known_in_a_planners_words(task, subtask, needed):
    assert needs_lesson(task_of(experiment("quirks"), task), Key.parse(subtask)) is needed


def test_held_out_quirks_share_a_trick_with_one_training_task_each():
    tasks = tasks_of(experiment("quirks"))
    training = [task.trick for task in tasks if task.split == "training"]
    assert sorted(training) == sorted(task.trick for task in tasks if task.split == "held-out")
    assert len(set(training)) == 8 and all(task.needed_at for task in tasks)
