"""``memo bench quirks-serving``: is the lesson that a held-out quirk needs served at its decisive subtask, and where?

The eight training lessons of the suite "quirks" are in a book, each as somebody taught it on the training task, with
the scene as it was seen then; asked for are the held-out tasks' decisive subtasks as a planner may word them, in their
scenes. Once with nothing else in the book, once beside other people's notes. Compared are ours, the paper's settings,
its formula with our tables, and the cosine of key and text.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import attrs

from memo_benchmarks.labelled_notes import Note, people
from memo_benchmarks.retrieval_quality import BY_KEY, OURS, PAPER, PLAIN
from memo_core.config import Experiment
from memo_core.interfaces.embedder import Embedder
from memo_core.interfaces.task import Task
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.runs.factories import environment_of, task_of
from memo_core.scene.graph import SceneGraph
from memo_core.scene.scene_table import scene_table
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.keys import Key
from memo_core.skillbook.retrieval import RetrievalSettings, as_text
from memo_core.skillbook.scene_context import SubtaskContext

FIRST = 20  # as many places as are served by default


@attrs.frozen
class Quirk:
    """One kind of quirk: the lesson as taught and the scene it was taught in, and the held-out task's subtask in
    several wordings, with what its scene shows."""

    lesson: Note
    scene: SceneGraph
    task: str
    asked: tuple[tuple[Key, SubtaskContext], ...]


def quirks(tasks: Sequence[Task], look: Callable[[str], SceneGraph]) -> list[Quirk]:
    """From the tasks of the suite "quirks"; ``look``: what is seen when a task begins."""
    taught = {task.trick: task for task in tasks if task.split == "training"}
    found = []
    for task in tasks:
        if task.split == "training":
            continue
        teaching, scene = taught[task.trick], look(task.name)
        keys = [Key.parse(wording) for wording in task.needed_at]
        lesson = Note(Key.parse(teaching.needed_at[0]), teaching.lesson)
        asked = tuple((key, SubtaskContext.of(key, scene)) for key in keys)
        found.append(Quirk(lesson, look(teaching.name), task.name, asked))
    return found


def first_look(experiment: Experiment, name: str) -> SceneGraph:
    """What is seen when a task begins, with seed 0."""
    with environment_of(experiment, task_of(experiment, name), 0) as world:
        return world.look()


def bench_quirks_serving(
    found: Sequence[Quirk],
    embedder: Embedder,
    make_store: Callable[[], VectorStore],
    settings: RetrievalSettings | None = None,
) -> dict[str, Any]:
    """Places of the right lessons (0: not served) by contender, alone and beside other people's notes. The embedder is
    open."""
    ours, others = settings or RetrievalSettings(), list(people("choose").notes)
    contenders = {OURS: ours, BY_KEY: attrs.evolve(ours, ranking="key", newest=False), "paper": PAPER}
    rows = []
    for (name, chosen), beside in itertools.product(contenders.items(), ([], others)):
        with Skillbook("sqlite://", embedder, make_store(), chosen) as book:
            _fill(book, found, beside)
            for quirk in found:
                for key, context in quirk.asked:
                    served = [one.text for one in book.retrieve(key, context).corrections]
                    place = 1 + served.index(quirk.lesson.text) if quirk.lesson.text in served else 0
                    rows.append(_row(name, quirk, key, beside, place))
    for beside in ([], others):
        notes = [quirk.lesson for quirk in found] + beside
        sentences = embedder.embed([f"{as_text(note.key)}: {note.text}" for note in notes])
        for quirk in found:
            for key, _ in quirk.asked:
                likeness = sentences @ embedder.embed([as_text(key)])[0]
                place = 1 + int((likeness > likeness[notes.index(quirk.lesson)]).sum())
                rows.append(_row(PLAIN, quirk, key, beside, place if place <= FIRST else 0))
    groups = itertools.product((*contenders, PLAIN), (0, len(others)))
    return {"embedder": embedder.name, "rows": rows, "summary": [_summary(rows, *group) for group in groups]}


def _fill(book: Skillbook, found: Sequence[Quirk], beside: Sequence[Note]) -> None:
    lessons = [(quirk.lesson, scene_table(quirk.scene)) for quirk in found]
    for note, scene in [*lessons, *((note, "") for note in beside)]:
        said = book.record_feedback("no, not like that", "bench", subtask=str(note.key), scene_graph=scene)
        book.add_lessons(said, note.key, [note.text])


def _row(contender: str, quirk: Quirk, key: Key, beside: Sequence[Note], place: int) -> dict[str, Any]:
    about = {"task": quirk.task, "subtask": str(key)}
    return {"contender": contender, "others": len(beside), **about, "place": place}


def _summary(rows: Sequence[Mapping[str, Any]], contender: str, others: int) -> dict[str, Any]:
    """``tasks_in_all_wordings``: of which the lesson is served however the planner words the subtask."""
    mine = [row for row in rows if row["others"] == others and row["contender"] == contender]
    tasks = {row["task"] for row in mine}
    complete = [task for task in tasks if all(row["place"] for row in mine if row["task"] == task)]
    return {
        "contender": contender,
        "others": others,
        "wordings": len(mine),
        "served": sum(row["place"] > 0 for row in mine),
        "first": sum(row["place"] == 1 for row in mine),
        "first_three": sum(0 < row["place"] <= 3 for row in mine),
        "tasks": len(tasks),
        "tasks_in_all_wordings": len(complete),
    }
