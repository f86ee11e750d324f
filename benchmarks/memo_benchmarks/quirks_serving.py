"""``memo bench quirks-serving``: is the lesson that a held-out quirk needs served at its decisive subtask, and where?

The eight training lessons of the suite "quirks" are in a book, each as somebody taught it on the training task; asked
for are the held-out tasks' decisive subtasks as a planner may word them, with the parts that their scenes show. Once
with nothing else in the book, once beside other people's notes; beside ours the cosine of key and text is measured.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from importlib import resources
from typing import Any

import attrs
import numpy as np

from memo_benchmarks.labelled_notes import Note, people
from memo_core.interfaces.embedder import Embedder
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.scene.appearance import appearance
from memo_core.scene.description import SceneDescription
from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.bulk_adding import Lesson
from memo_core.skillbook.keys import Key
from memo_core.skillbook.retrieval import RetrievalSettings, as_text
from memo_core.skillbook.scene_context import SubtaskContext

FIRST = 20  # as many places as are served by default


@attrs.frozen
class Quirk:
    """One kind of quirk: the lesson as taught, and the held-out task's subtask in several wordings."""

    lesson: Note
    task: str
    asked: tuple[tuple[Key, SubtaskContext], ...]


def quirks(tasks: Sequence[Any]) -> list[Quirk]:
    """From the tasks of the suite "quirks", each with ``lesson`` and ``scene``."""
    text = resources.files("memo_benchmarks").joinpath("quirks_wordings.toml").read_text(encoding="utf-8")
    by_name = {task.name: task for task in tasks}
    found = []
    for row in tomllib.loads(text)["quirk"]:
        scene = labels_of(by_name[row["asked"]].scene(np.random.default_rng(0)))
        keys = [Key.parse(wording) for wording in row["wordings"]]
        lesson = Note(Key.parse(row["under"]), by_name[row["taught"]].lesson)
        found.append(Quirk(lesson, row["asked"], tuple((key, SubtaskContext.of(key, scene)) for key in keys)))
    return found


def labels_of(scene: SceneDescription) -> SceneGraph:
    """The things and parts that a look at a scene shows and what they look like, not where they are; the hand is
    empty."""
    nodes: list[Node] = []
    whole: dict[str, str | None] = {}  # of each body the object that it belongs to
    for body, parent in scene.walk():
        above = whole[parent.name] if parent is not None else None
        whole[body.name] = above or (body.name if body.label else None)
        if body.label:
            looks = appearance(body)
            nodes.append(Node(body.name, body.label, Pose(), (0.1, 0.1, 0.1), part_of=above, attributes=looks))
        for part in body.parts:
            owner, looks = whole[body.name], appearance(body, part)
            nodes.append(Node(part.id, part.label, Pose(), (0.1, 0.1, 0.1), owner, "part", attributes=looks))
    return SceneGraph(tuple(nodes), (), Observation(Pose(), 0.08, False))


def bench_quirks_serving(
    tasks: Sequence[Any],
    embedder: Embedder,
    make_store: Callable[[], VectorStore],
    settings: RetrievalSettings | None = None,
) -> dict[str, Any]:
    """Places of the right lessons (0: not served), ours and by plain cosine, alone and beside other people's notes."""
    embedder.open()
    found, others = quirks(tasks), list(people("choose").notes)
    rows = []
    for beside in ([], others):
        notes = [quirk.lesson for quirk in found] + beside
        sentences = embedder.embed([f"{as_text(note.key)}: {note.text}" for note in notes])
        with Skillbook("sqlite://", embedder, make_store(), settings or RetrievalSettings()) as book:
            book.add_many([Lesson("no, not like that", "bench", note.key, (note.text,)) for note in notes])
            for quirk in found:
                for key, context in quirk.asked:
                    served = [one.text for one in book.retrieve(key, context).corrections]
                    likeness = sentences @ embedder.embed([as_text(key)])[0]
                    plain = 1 + int((likeness > likeness[notes.index(quirk.lesson)]).sum())
                    place = 1 + served.index(quirk.lesson.text) if quirk.lesson.text in served else 0
                    rows.append(
                        {"task": quirk.task, "subtask": str(key), "others": len(beside), "place": place, "plain": plain}
                    )
    return {"embedder": embedder.name, "rows": rows, "summary": [_summary(rows, n) for n in (0, len(others))]}


def _summary(rows: Sequence[dict[str, Any]], others: int) -> dict[str, Any]:
    mine = [row for row in rows if row["others"] == others]
    tasks = {row["task"] for row in mine}
    complete = [task for task in tasks if all(row["place"] for row in mine if row["task"] == task)]
    return {
        "others": others,
        "wordings": len(mine),
        "served": sum(row["place"] > 0 for row in mine),
        "first": sum(row["place"] == 1 for row in mine),
        "tasks": len(tasks),
        "tasks_in_all_wordings": len(complete),
        "plain_in_20": sum(row["plain"] <= FIRST for row in mine),
        "plain_first": sum(row["plain"] == 1 for row in mine),
    }
