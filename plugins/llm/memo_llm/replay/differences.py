"""Describing in a few lines how an unrecorded question differs from the closest recorded one."""

from __future__ import annotations

import difflib
from collections.abc import Sequence

from memo_core.plugin import Message, Request
from memo_llm.replay.recording import Call

MOST_LINES = 6
MOST_COMPARED = 12  # recorded questions that are compared line by line
WIDTH = 160


def describe(request: Request, calls: Sequence[Call]) -> str:
    """Names the most similar recorded question, and the message, section and line that differ."""
    if not calls:
        return "the recording holds no call at all"
    order = {id(call): number for number, call in enumerate(calls, start=1)}
    same_phase = [call for call in calls if call.request.phase == request.phase] or list(calls)
    likely = sorted(same_phase, key=lambda call: _roughly(request, call.request), reverse=True)[:MOST_COMPARED]
    nearest = max(likely, key=lambda call: _alike(request, call.request))
    return f"the nearest is call {order[id(nearest)]} ({nearest.request.phase}), and " + _first(
        request, nearest.request
    )


def _roughly(one: Request, other: Request) -> tuple[int, float]:
    """Cheap: messages in common, then the share of common words of the last."""
    same = sum(a.text == b.text for a, b in zip(one.messages, other.messages, strict=False))
    a, b = (set(r.messages[-1].text.split()) if r.messages else set() for r in (one, other))
    return same, len(a & b) / max(1, len(a | b))


def _alike(one: Request, other: Request) -> float:
    a, b = ("\n".join(m.text for m in r.messages).splitlines() for r in (one, other))
    return difflib.SequenceMatcher(None, a, b, autojunk=False).ratio()


def _first(asked: Request, recorded: Request) -> str:
    for number, (one, other) in enumerate(zip(asked.messages, recorded.messages, strict=False), start=1):
        where = f"message {number} ({one.role})"
        if one.role != other.role:
            return f"{where} was recorded as of {other.role}"
        if one.text != other.text:
            return where + _lines(one, other)
        if [i.digest for i in one.images] != [i.digest for i in other.images]:
            return f"{where} comes with other pictures ({len(one.images)}, recorded {len(other.images)})"
    if len(asked.messages) != len(recorded.messages):
        more = [*asked.messages, *recorded.messages][min(len(asked.messages), len(recorded.messages)) :]
        last = " ".join(more[0].text.split())[:WIDTH] if more else ""
        return f"this question has {len(asked.messages)} messages, that one {len(recorded.messages)}: {last!r}"
    if asked.seed != recorded.seed:
        return f"the seed differs: asked {asked.seed}, recorded {recorded.seed}"
    return "the schema of the answer differs"


def _lines(one: Message, other: Message) -> str:
    asked, recorded = one.text.splitlines(), other.text.splitlines()
    changes = [
        change
        for change in difflib.SequenceMatcher(None, recorded, asked, autojunk=False).get_opcodes()
        if change[0] != "equal"
    ]
    if not changes:
        return " differs in its line breaks"
    _, start, end, first, last = changes[0]
    section = next((line.strip() for line in reversed(asked[: first + 1]) if line.startswith("#")), "")
    told = [f"- recorded: {line[:WIDTH]}" for line in recorded[start:end][: MOST_LINES // 2]]
    told += [f"+ asked:    {line[:WIDTH]}" for line in asked[first:last][: MOST_LINES // 2]]
    more = f" ({len(changes) - 1} more places differ)" if len(changes) > 1 else ""
    place = f", section {section!r}" if section else ""
    return f"{place}, line {first + 1} differs{more}:\n" + "\n".join(told)
