"""What a person means: the rules' reading of a remark and its gist, weighed against each other."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable

import attrs

from memo_core.scene.graph import SceneGraph
from memo_llm.offline.agreement import opposed, wanted
from memo_llm.offline.asked import is_of_the_grip
from memo_llm.offline.edits import Edit
from memo_llm.offline.gist import gist_of
from memo_llm.offline.learnt import Learnt
from memo_llm.offline.prompt import Prompt
from memo_llm.offline.questions import OF_DOORS
from memo_llm.offline.recipe import Habits
from memo_llm.offline.remark import Heard, others_in, read_remark
from memo_llm.offline.surroundings import Surroundings
from memo_llm.offline.vocabulary import Vocabulary
from memo_llm.offline.wording import said_plainly

# How sure of a gist one must be to follow it: where the rules read the same with doubts; something else with doubts;
# nothing, or surely something else, and where a longer remark left them with nothing; a part of it, or more than it.
# Then: where a remark is short and the rules surely read something else, or it has few words; where it contradicts
# itself; where nothing was read and it is about the plan; where a motion was read with doubts and it is about the plan.
# Last, to ask whether it is meant.
_AGREED, _DESPITE_DOUBTS, _SURE, _SURE_OF_MORE, _SURE_OF_PARTS = 0.4, 0.6, 0.55, 0.65, 0.6
_SURE_OF_FEW, _CERTAIN, _OF_PLANS, _OF_PLANS_INSTEAD, _WORTH_ASKING = 0.7, 0.85, 0.7, 0.75, 0.5
_OTHERS = re.compile(r"\b(?:others?|rest|next one|neighbou?rs?|each other|the two|them)\b")
_EVIDENT = 0.6  # how likely it and its likeliest name must be to question what the rules surely read in a short remark
_FEW = 5  # words of which a gist says little
_SHORT = 9  # words of a remark that the rules may read alone
_SAID_OUTRIGHT = frozenset([("force", "firmly"), ("straight", "")])  # what the rules do not read into other words
_UNNAMED = frozenset(  # edits that no gist is about
    [
        "between",
        "pivot",
        "clear-first",
        "close-first",
        "open-first",
        "back-off-before",
        "settle-grip",
        "beside",
        "ease",
        "look",
    ]
)


def hear(words: str, prompt: Prompt, scene: SceneGraph, habits: Habits, vocabulary: Vocabulary) -> Heard:
    """What a person means who said ``words`` of the prompt's subtask: what the rules read where the gist says the same
    or cannot be told of few words, the gist where that is sure, and else a question."""
    quoted, short = " ".join(words.split())[:200], len(words.split()) <= _SHORT
    heard = _with_own_doubts(words, read_remark(words, prompt, scene, habits, vocabulary), quoted, vocabulary)
    special = any(edit.kind in _UNNAMED for edit in heard.edits) or _from_several_sides(heard)
    if special and not heard.question:
        return heard
    objects, kind = prompt.subtask[1], heard.kind
    around = Surroundings.of(scene, objects[0] if objects else "", objects[1] if len(objects) > 1 else None)
    beside = _beside(words, around)
    asked = Learnt.load().asked_for(words, objects, kind)
    gist = gist_of(words, asked, kind, vocabulary, around, beside)
    if gist is not None and gist.about_plans and not gist.text:
        return _about_plans(heard, gist.probability, quoted)
    if gist is not None and not (beside and beside in gist.text):
        gist = None if _beside_another(words, others_in(scene, objects)) else gist
    if gist is None and not heard.question and len(words.split()) >= _FEW and asked.asks_for_nothing:
        return _asked(heard, heard.edits, quoted)
    meant = read_remark(gist.text, prompt, scene, habits, vocabulary) if gist is not None else None
    if gist is None or meant is None or meant.question:
        return heard if heard.question or short or _measured(heard) else _asked(heard, heard.edits, quoted)
    meant = attrs.evolve(meant, about_plans=gist.about_plans, also_moves=gist.about_plans)
    read, told = wanted(edit for edit in heard.edits if not edit.negated), wanted(meant.edits)
    if heard.question:
        if gist.probability >= _least(words, heard, meant, special, vocabulary):
            return meant
        return heard if special else _asked(heard, meant.edits, quoted)
    if read and read == told:
        return attrs.evolve(heard, likewise=meant)
    if _swung(heard, meant):
        return heard
    if read & told:
        said_outright = set() < read - told <= _SAID_OUTRIGHT
        return meant if gist.probability >= _SURE_OF_PARTS and not said_outright else heard
    if short and read and (min(gist.probability, gist.evidence) < _EVIDENT or _measured(heard)):
        return heard
    against = opposed(heard.edits, meant.edits, vocabulary)
    if gist.probability >= (_SURE_OF_FEW if short and read else _SURE) and not against:
        return meant
    return _asked(heard, meant.edits if gist.probability >= _SURE else heard.edits, quoted)


def _with_own_doubts(words: str, heard: Heard, quoted: str, vocabulary: Vocabulary) -> Heard:
    """What the rules read, with a question where it contradicts itself or may be about an earlier step."""
    said = [edit for edit in heard.edits if not edit.negated]
    if heard.question or not said:
        return heard
    if opposed(said, said, vocabulary) or _from_several_sides(heard):
        return _asked(heard, said, quoted)
    if is_of_the_grip(words, heard.kind) and {edit.kind for edit in said} == {"offset"}:
        return attrs.evolve(heard, question=f"is that about how it was picked up, or {_suggestion(said, quoted)}")
    return heard


def _from_several_sides(heard: Heard) -> bool:
    return len({edit.value for edit in heard.edits if edit.kind == "approach" and not edit.negated}) > 1


def _least(words: str, heard: Heard, meant: Heard, special: bool, vocabulary: Vocabulary) -> float:
    """The probability from which on a gist is followed instead of what the rules read with doubts. ``special``: whether
    that is about something that no gist is about."""
    same = wanted(heard.edits) == wanted(meant.edits)
    if special or (not same and opposed(heard.edits, heard.edits, vocabulary)):
        return _CERTAIN
    if len(words.split()) < _FEW or re.search(r"\bthen\b", words.lower()):
        return _SURE_OF_FEW
    if same or heard.edits:
        return _AGREED if same else _DESPITE_DOUBTS
    return _SURE if len(words.split()) <= _SHORT else _SURE_OF_MORE


def _about_plans(heard: Heard, probability: float, quoted: str) -> Heard:
    """Of words whose gist is that the plan is to be another one."""
    if heard.question:
        return attrs.evolve(heard, about_plans=probability >= (_OF_PLANS_INSTEAD if heard.edits else _OF_PLANS))
    if probability >= _CERTAIN:
        return attrs.evolve(heard, about_plans=True)
    asked = f"is something else to be done, or {_suggestion(heard.edits, quoted)}"
    return attrs.evolve(heard, question=asked if probability >= _WORTH_ASKING else "")


def _beside(words: str, around: Surroundings) -> str:
    """What something is put down beside: what the subtask names, or the person, or the nearest of "the others".
    "" where there is no such thing."""
    if around.goal is not None and around.goal_stands:
        return around.goal.label
    own = {node.label for node in (around.thing, around.goal) if node is not None}
    seen = [node for node in around.scene.nodes if node.kind == "object" and node.label not in own]
    named = [node for node in seen if re.search(rf"\b{re.escape(node.label.lower())}\b", words.lower())]
    middle = around.goal or around.thing
    if named or middle is None or not _OTHERS.search(words.lower()):
        return next((node.label for node in named), "")
    nearest = sorted(seen, key=lambda node: math.dist(node.pose.position, middle.pose.position))
    return next((node.label for node in nearest), "")


def _beside_another(words: str, others: Iterable[str]) -> bool:
    """Whether a distance to another thing is spoken of, which no direction of the hand is."""
    named = "|".join(map(re.escape, others)) or "(?!)"
    near = r"\b(?:away|apart|clear|further|farther|closer|nearer) (?:from|of|to) (?:the |that |my )?"
    return re.search(rf"{near}(?:{named})\b", words.lower()) is not None


def _measured(heard: Heard) -> bool:
    """Whether how far is said in figures."""
    return any(edit.degrees or (edit.amount is not None and edit.amount.exact) for edit in heard.edits)


def _swung(heard: Heard, meant: Heard) -> bool:
    """Whether what was read says more than the way of the gist: "it folds down", "push it in and it pops open"."""
    kinds = {edit.kind for edit in meant.edits}
    if kinds == {"reverse"} and any(edit.kind == "way" for edit in heard.edits):
        return False
    swings = any(edit.kind in (*OF_DOORS, "first-in", "first-up") for edit in heard.edits)
    return swings and kinds <= {"way", "reverse"}


def _asked(heard: Heard, edits: Iterable[Edit], quoted: str) -> Heard:
    return attrs.evolve(heard, question=_suggestion(edits, quoted))


def _suggestion(edits: Iterable[Edit], quoted: str) -> str:
    said = " ".join(dict.fromkeys(said for edit in edits if (said := said_plainly(edit, None, None))))
    return f"is this what you mean: {said} You said: {quoted}"
