"""Generalising programs of several keys: a language model proposes functions and calls in place of them."""

from __future__ import annotations

from typing import Any

from memo_core.skillbook.consolidation.function_rules import Group, name_of
from memo_core.skillbook.model.entries import key_label

PHASE = "generalise"


def prompt_context(group: Group, skills: str, subset: str) -> dict[str, Any]:
    """The values for the placeholders of a group's prompt.

    Args:
        group: programs, notes and functions to show.
        skills: documentation of the robot's functions.
        subset: the Python that the sandbox runs.

    Returns:
        Values by placeholder. Of a call whose function is shown anyway, only the call stands in the list of programs.
    """
    shown = {name_of(entry) for entry in group.functions}
    return {
        "skills": skills,
        "subset": subset,
        "programs": [
            {
                "key": key_label(member.key),
                "built": member.built,
                "code": member.entry.text.strip() if member.calls in shown else member.code.rstrip(),
                "tried": member.tried,
            }
            for member in group.members
        ],
        "functions": [{"text": entry.text.rstrip()} for entry in group.functions],
        "notes": [{"key": key_label(note.key), "text": " ".join(note.text.split())} for note in group.notes],
        "characters": group.characters,
    }
