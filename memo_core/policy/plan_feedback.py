"""The key of feedback about plans, one per task."""

from __future__ import annotations

import re

import attrs

from memo_core.skillbook.model.keys import Key

PLANNING = "plan"  # the action of such a key; no subtask is planned by this name
LONGEST = 70  # characters of the instruction that are kept


def for_plans(task: str) -> Key:
    """The key for remarks about the plan of a task: ``PLAN(set the table)``. Its object is the instruction, so that
    remarks about similar tasks are found with the usual score."""
    words = " ".join(re.sub(r"[^\w\s'-]", " ", task.casefold()).split())
    return Key.make(PLANNING, words[:LONGEST].strip() or "task")


def is_of_plans(key: Key) -> bool:
    """Whether a key belongs to plans and not to a subtask."""
    return key.action == PLANNING


@attrs.frozen
class PlanNote:
    """A note as shown in the planning prompt."""

    task: str  # the instruction it was said of
    text: str
    origin: str = ""  # who said it, and when in relation to the others; "" where the prompt does not say
