"""The skillbook of the pilot on the suite ``house-rules``: what people said on its training tasks, among notes of other
people about other tasks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml
from memo_tabletop.house.containers import PutInItsPlace

from memo_core.cli.options import load
from memo_core.policy.plan_feedback import PLANNING, for_plans
from memo_core.runs.factories import book_of, environment_of, task_of
from memo_core.scene.scene_table import scene_table
from memo_core.skillbook.book import Skillbook

DAY_S = 86_400.0


def record_remarks(remarks: Path, file: Path, seed: int = 0) -> None:
    """Record what people said in the new book ``file``, a remark a day.

    Remarks of the suite ``house-rules`` are left for ``memo skillbook retry``, which has a model make notes of them.
    The others are stored as notes word for word.

    Args:
        remarks: YAML list of mappings: ``who``, ``words``, ``suite``, ``task`` and ``subtask`` (``plan`` for what is
            said of the plan); ``where`` for the containers that the robot had put things into, if not the nearest.
        file: SQLite file of the book.
        seed: of the scenes in which the words were said.
    """
    said = yaml.safe_load(remarks.read_text(encoding="utf-8"))
    experiment = load(None, [f"skillbook.url=sqlite:///{file}"])[1]
    with book_of(experiment, None, read_only=False) as book:
        for day, remark in enumerate(said, start=1):
            _record(book, remark, day * DAY_S, seed)


def _record(book: Skillbook, remark: dict[str, Any], when: float, seed: int) -> None:
    experiment = load(None, [f"suite.backend={remark['suite']}"])[1]
    task = task_of(experiment, remark["task"])
    with environment_of(experiment, task, seed) as world:
        scene = scene_table(world.look())
    plain = task.plain_attempt
    if isinstance(task, PutInItsPlace):
        plain = task.code(remark.get("where", task.natural), "None")
    subtask = str(for_plans(task.instruction)) if remark["subtask"] == PLANNING else remark["subtask"]
    ours = remark["suite"] == "house-rules"
    number = book.record_feedback(
        remark["words"],
        remark["who"],
        task=task.instruction,
        subtask=subtask,
        scene_graph=scene,
        code=plain if ours and remark["subtask"] != PLANNING else "",
        when=when,
    )
    if not ours:
        book.add_lessons(number, subtask, [remark["words"]])
