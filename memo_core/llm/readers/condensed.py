"""The answer to a cluster's prompt: which notes are kept, merged and dropped."""

from __future__ import annotations

from typing import Any

from memo_core.llm.readers.json_objects import json_objects, object_list, whole_number
from memo_core.llm.readers.notes import MAX_NOTE
from memo_core.llm.readers.unreadable import Unreadable
from memo_core.skillbook.consolidation.rules import Cluster, Condensed, Dropped, Merged, problem_with

PHASE = "cluster"


def read_condensed(text: str, cluster: Cluster) -> Condensed:
    """A model's answer as a proposal that may be committed. Raises ``Unreadable`` with what is wrong with it."""
    found = next((value for value in json_objects(text) if "entries" in value), None)
    if found is None:
        raise Unreadable(PHASE, 'it is no JSON object with the keys "entries" and "dropped"', text)
    proposal = Condensed(
        tuple(_merged(item, text) for item in object_list(PHASE, found, "entries", text)),
        tuple(_dropped(item, cluster, text) for item in object_list(PHASE, found, "dropped", text)),
    )
    longest = longest_entry(cluster)
    for position, one in enumerate(proposal.entries, start=1):
        if len(one.text) > longest:
            raise Unreadable(PHASE, f"entry {position} has {len(one.text)} characters; at most {longest}", text)
    problem = problem_with(cluster, proposal)
    if problem:
        raise Unreadable(PHASE, problem, text)
    return proposal


def longest_entry(cluster: Cluster) -> int:
    """Maximum number of characters of an entry: the limit of a note, or the longest note where that is longer."""
    return max([MAX_NOTE, *(len(member.text) for member in cluster.members)])


def _merged(item: dict[str, Any], text: str) -> Merged:
    said, numbers = item.get("text"), item.get("from")
    if not isinstance(said, str):
        raise Unreadable(PHASE, 'an entry has no "text"', text)
    numbers = numbers if isinstance(numbers, list) else [numbers]
    return Merged(
        " ".join(said.split()), tuple(_number(one, f'"from" of the entry {said[:40]!r}', text) for one in numbers)
    )


def _dropped(item: dict[str, Any], cluster: Cluster, text: str) -> Dropped:
    number = _number(item.get("number"), '"number" in "dropped"', text)
    given = item.get("template")
    if given is None and len(cluster.templates) == 1:
        given = 1
    reason = item.get("reason")
    why = " ".join(reason.split())[:MAX_NOTE] if isinstance(reason, str) else ""
    covered = item.get("covered") is True
    return Dropped(number, _number(given, f'"template" of the dropped number {number}', text), why, covered)


def _number(value: Any, where: str, text: str) -> int:
    number = whole_number(value)
    if number is None:
        raise Unreadable(PHASE, f"{where} is {value!r}, not a whole number", text)
    return number
