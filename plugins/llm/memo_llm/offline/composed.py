"""Edits of clauses that are composed of known parts, and when they stand in place of what phrases say."""

from __future__ import annotations

import re

from memo_llm.offline.clauses import Mood, time_part
from memo_llm.offline.composition import TIMES
from memo_llm.offline.coverage import Context
from memo_llm.offline.edits import GENTLE, Edit
from memo_llm.offline.meaning import Meant, meaning
from memo_llm.offline.vocabulary import Vocabulary

_SIDED = ("force", "speed")
# What only a composition of parts says.
_COMPOSED_ONLY = frozenset(["travel", "retreat", "slow-end", "ease-open", "pose", "set-down", "finger-width", "beside"])


def composed_edits(clause: str, mood: Mood, context: Context) -> list[Edit] | None:
    """Edits of a clause that is made up of known parts throughout; None where it is not, or where they mean nothing."""
    if mood not in ("request", "told"):
        return None
    vocabulary, kind, own = context.vocabulary, context.kind, context.own
    parts = vocabulary.lexicon.parts(
        re.sub(r"^so (?=\w+ (?:it|the|your|that|up|down)\b)", "", clause), own, context.others
    )
    if not parts:
        return None
    meant = meaning(parts, kind)
    if meant is not None and "lever" in own and any(one.kind == "turn-thing" for one in meant):
        return None  # which way a lever's end goes is not which way round it is turned
    normal = kind == "place" and any(part.said in ("goes", "go", "belongs", "belong", "should go") for part in parts)
    if normal and meant is not None and [one.kind for one in meant] == ["beside"]:
        return [_as_edit(one, clause, vocabulary, kind) for one in meant]  # "forks go to the left of the plate"
    tells = any(part.kind in ("verb", "thing", "pronoun", "be", "other", "not") for part in parts)
    if meant is None or (mood == "told" and tells and not any(part.kind in ("too", "enough") for part in parts)):
        return None
    return [_as_edit(one, clause, vocabulary, kind) for one in meant]


def only_when(clause: str, context: Context) -> bool:
    """Whether a clause only says when what follows it is to be done: "when you have let go"."""
    if time_part(clause) != 0:
        return False
    parts = context.vocabulary.lexicon.parts(clause, context.own, context.others) or []
    return bool(parts) and all(part.kind in TIMES for part in parts)


def preferred(composed: list[Edit], said: list[Edit], doubtful: bool) -> bool:
    """Whether a clause's reading as a composition of parts stands in place of what its phrases say."""
    if not said:
        return True
    if not composed:  # it asks for nothing: in place of what nothing would follow from
        return all(edit.negated or (edit.kind == "tilt" and not edit.value and edit.degrees is None) for edit in said)
    if doubtful or any(edit.kind in _COMPOSED_ONLY for edit in composed):
        return True
    kinds, phrased = {edit.kind for edit in composed}, {edit.kind for edit in said}
    if phrased == {"farther"} and "offset" in kinds:
        return True  # "lower it 2 cm": which way is said, too
    if phrased == {"straight"} and kinds == {"tilt"}:
        return True  # "keep it straight", of what is carried
    if phrased == {"offset"} and kinds <= {"farther", "all-the-way"}:
        return True  # "down until it goes no further"
    if kinds == phrased == {"offset"} and {edit.value for edit in composed} != {edit.value for edit in said}:
        return True  # "you went down too far"
    return kinds < phrased or (
        kinds == phrased and any(_senses(composed, kind) != _senses(said, kind) for kind in _SIDED)
    )


def _senses(edits: list[Edit], kind: str) -> set[bool]:
    """Which ends of a scale the edits of a kind ask for: gentle or slow is the low one."""
    return {edit.value in GENTLE or edit.value.startswith("slow") for edit in edits if edit.kind == kind}


def _as_edit(one: Meant, clause: str, vocabulary: Vocabulary, kind: str) -> Edit:
    phrases = [p for p in vocabulary.phrases if p.edit == one.kind and p.value in ("", one.value) and not p.flip]
    phrase = next((p for p in phrases if kind in p.only), None) or next((p for p in phrases if not p.only), None)
    return Edit(
        one.kind,
        one.value,
        vocabulary.amount(one.amount),
        vocabulary.angle(one.amount) if one.amount else vocabulary.angle(one.value),
        vocabulary.seconds(one.amount),
        verb=one.verb,
        said=f"lift {clause}" if one.lifted else clause,
        phrase=phrase,
        degree=True,
    )
