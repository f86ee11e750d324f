"""A book of the lessons that a suite's training tasks come with, and whether a run was served the right one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument
from memo_core.interfaces.task import Task
from memo_core.runlog.log_file import read_lines
from memo_core.runlog.log_history import read_history
from memo_core.runs.factories import book_of, environment_of, tasks_of
from memo_core.scene.scene_table import scene_table
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.action_relations import default_actions
from memo_core.skillbook.model.keys import Key

WHO = "lessons"  # who said them, by the book


def make_lesson_book(experiment: Experiment, file: Path) -> None:
    """Fill ``file`` with one correction a training task that has a lesson: its sentence, under the subtask that needs
    it, with the scene as it is seen at the beginning. No model is asked. What is in the file already is taken away.
    Raises ``InvalidArgument`` for a suite without lessons, ``MemoError``."""
    taught = [task for task in tasks_of(experiment) if task.split == "training" and task.lesson and task.needed_at]
    if not taught:
        suite = experiment.choice("suite").backend.name
        problem = f"no training task of the suite {suite!r} has a `lesson` and the subtask that needs it, `needed_at`"
        raise InvalidArgument("evaluation.books", problem, "a book's file, or `empty`")
    file.parent.mkdir(parents=True, exist_ok=True)
    for left in file.parent.glob(file.name + "*"):
        left.unlink()
    with book_of(experiment, str(file), read_only=False) as book:
        for number, task in enumerate(taught, start=1):
            with environment_of(experiment, task, experiment.seed) as world:
                scene = scene_table(world.look())
            under = Key.parse(task.needed_at[0])
            said = book.record_feedback(
                task.lesson, WHO, task=task.instruction, subtask=str(under), scene_graph=scene, when=float(number)
            )
            book.add_lessons(said, under, [task.lesson])


@attrs.frozen
class LessonServed:
    """``needed``: how often the book was asked at a subtask that needs the task's lesson; ``served``: how often it then
    gave something that was said of a training task with the same trick."""

    needed: int = 0
    served: int = 0


def lesson_served(experiment: Experiment, task: Task, run: Path, book: Skillbook) -> LessonServed:
    """Of a run of a task with a trick, by its log; ``book`` (open) is the one that it asked."""
    same = {one.instruction for one in tasks_of(experiment) if one.split == "training" and one.trick == task.trick}
    asked = [
        effect.value["served"]
        for effect in read_history(run, read_lines(run).records).replayed
        if effect.name == "retrieve" and effect.value and needs_lesson(task, Key.parse(effect.about))
    ]
    return LessonServed(len(asked), sum(_right(book, served, same) for served in asked))


def needs_lesson(task: Task, subtask: Key) -> bool:
    """Whether a subtask is the one at which the task's lesson is needed: the verb of one of ``needed_at``, or one that
    means the same, and one of the things named there."""
    actions = default_actions()
    known = [actions.about(Key.parse(wording)) for wording in task.needed_at]
    verbs = {key.action.split()[0] for key in known}
    things = {name for key in known for name in key.objects}
    asked = actions.about(subtask)
    return asked.action.split()[0] in verbs and not things.isdisjoint(asked.objects)


def _right(book: Skillbook, served: Sequence[dict[str, Any]], instructions: set[str]) -> bool:
    return any(book.feedback(said).task in instructions for said in book.sources([row["entry"] for row in served]))
