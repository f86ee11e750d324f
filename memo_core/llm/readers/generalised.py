"""The answer to a group's prompt: functions, the calls that stand in for programs, and the notes that are kept."""

from __future__ import annotations

import re
from collections.abc import Collection
from typing import Any

from memo_core.llm.readers.blocks import code_blocks, left_open, outside_code, syntax_problem
from memo_core.llm.readers.json_objects import json_objects, object_list, whole_number
from memo_core.llm.readers.notes import MAX_NOTE
from memo_core.llm.readers.unreadable import Unreadable, missing, spoken
from memo_core.skillbook.consolidation.function_rules import (
    Generalised,
    Group,
    Left,
    MergedNote,
    NewFunction,
    problem_with,
)

PHASE = "generalise"
FORM = '{"functions": […], "left": […], "notes": […], "inside": […]}'
WANTED = f"answer with one Python code block for each function, then {FORM}"

_DEF = re.compile(r"^def (\w+)", re.MULTILINE)


def read_generalised(text: str, group: Group, skill_names: Collection[str], taken: Collection[str]) -> Generalised:
    """A model's answer as a proposal that may be tried.

    Args:
        text: the answer.
        group: what the question showed.
        skill_names: names of the robot's functions.
        taken: names of the functions in the book.

    Returns:
        A proposal in which ``problem_with`` finds nothing.

    Raises:
        Unreadable: with the first thing that is wrong, in words for the model.
    """
    said = spoken(PHASE, text, WANTED)
    found = next((value for value in json_objects(outside_code(said)) if "functions" in value), None)
    if found is None:
        cut = "; a code block is never closed" if left_open(said) else ""
        raise missing(PHASE, f'it holds no JSON object with the key "functions"{cut}', text, WANTED)
    codes = {name: block for block in code_blocks(said) for name in _DEF.findall(block)}
    proposal = Generalised(
        tuple(_function(item, codes, text) for item in object_list(PHASE, found, "functions", text)),
        tuple(_left(item, text) for item in object_list(PHASE, found, "left", text)),
        tuple(_note(item, text) for item in object_list(PHASE, found, "notes", text)),
        tuple(_inside(item, text) for item in object_list(PHASE, found, "inside", text)),
    )
    longest = max([MAX_NOTE, *(len(note.text) for note in group.notes)])
    for place, note in enumerate(proposal.notes, start=1):
        if len(note.text) > longest:
            raise Unreadable(PHASE, f"the kept note {place} has {len(note.text)} characters; at most {longest}", text)
    if problem := problem_with(group, proposal, skill_names, taken):
        raise Unreadable(PHASE, problem, text)
    return proposal


def _function(item: dict[str, Any], codes: dict[str, str], text: str) -> NewFunction:
    """The last of the code blocks that define a function of this name."""
    name, calls = item.get("name"), item.get("calls")
    if not isinstance(name, str) or name not in codes:
        there = f"code blocks define: {', '.join(codes)}" if codes else "there is no code block with a function"
        raise Unreadable(PHASE, f'"functions" names {name!r}, which no code block defines; {there}', text)
    if problem := syntax_problem(codes[name]):
        raise Unreadable(PHASE, f"the code of {name} does not parse: {problem}", text)
    if not isinstance(calls, dict) or not all(isinstance(call, str) for call in calls.values()):
        raise Unreadable(PHASE, f'"calls" of {name} must be an object with one call for each program\'s number', text)
    where = f'a key in "calls" of {name}'
    return NewFunction(codes[name], tuple((_number(key, where, text), call.strip()) for key, call in calls.items()))


def _left(item: dict[str, Any], text: str) -> Left:
    why = item.get("why")
    return Left(_number(item.get("program"), '"program" in "left"', text), _one_line(why)[:MAX_NOTE] if why else "")


def _note(item: dict[str, Any], text: str) -> MergedNote:
    said, numbers = item.get("text"), item.get("from")
    if not isinstance(said, str):
        raise Unreadable(PHASE, 'an object in "notes" has no "text"', text)
    numbers = numbers if isinstance(numbers, list) else [numbers]
    where = f'"from" of the note {said[:40]!r}'
    return MergedNote(_one_line(said), tuple(dict.fromkeys(_number(one, where, text) for one in numbers)))


def _inside(item: dict[str, Any], text: str) -> tuple[int, str]:
    name = item.get("function")
    if not isinstance(name, str):
        raise Unreadable(PHASE, 'an object in "inside" has no "function"', text)
    return _number(item.get("note"), '"note" in "inside"', text), name


def _number(value: Any, where: str, text: str) -> int:
    number = whole_number(value)
    if number is None:
        raise Unreadable(PHASE, f"{where} is {str(value)[:40]!r}, not a whole number", text)
    return number


def _one_line(value: Any) -> str:
    return " ".join(str(value).split())
