"""The key of feedback about plans, one per task."""

from __future__ import annotations

import re

import attrs

from memo_core.skillbook.keys import Key

PLANNING = "plan"  # the action of such a key; no subtask is planned by this name
LONGEST = 70  # characters of the instruction that are kept


def for_plans(task: str) -> Key:
    """The key of what is said about the plan of a task: ``PLAN(set the table)``. Its object is the instruction, so that
    remarks about like tasks are found by the same score as any others."""
    words = " ".join(re.sub(r"[^\w\s'-]", " ", task.casefold()).split())
    return Key.make(PLANNING, words[:LONGEST].strip() or "task")


def is_of_plans(key: Key) -> bool:
    """Whether a key stands for plans and not for a subtask."""
    return key.action == PLANNING


@attrs.frozen
class PlanNote:
    """A note as the prompt for plans shows it."""

    task: str  # the instruction it was said of
    text: str
