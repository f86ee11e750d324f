"""Words that a subtask and a note share, with verbs of one synonym group counted as one.

A sentence model puts "turn the knob" and "press the cap down while you turn it" far apart; that both are about turning
is in the words. Compared are terms: stems of nouns, and for verbs the group they belong to (``action_relations.toml``).
"""

from __future__ import annotations

import re
from functools import lru_cache

from memo_core.skillbook.model.action_relations import Actions
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.model.scene_context import SubtaskContext

GRIP = "~grip"  # the term of everything that says how a thing is held
_SEEN, GRIPPED, _ATTRIBUTE = 0.5, 0.5, 0.25  # weights beside the 1 of what the subtask names
_WORDS_STOP = """
a about after an and are as at be before but by do don't for from if in into is isn't it its no not of off on onto or
out over so than that the their them then there they this to too until up very was when where while with you your
"""
_STOP = frozenset(_WORDS_STOP.split())
WORD = re.compile(r"[^\W\d_]+(?:'t)?")
_SUFFIXES = ("ing", "ed", "es", "s", "ly")


Wanted = tuple[dict[str, float], float]  # terms of a subtask with their weights, and what counts as all of them


class Terms:
    """Terms of subtasks and of texts for one table of actions."""

    def __init__(self, actions: Actions) -> None:
        self._actions = actions
        single = {verb: head for verb, head in actions.groups.items() if " " not in verb}
        self._group = {_stem(verb): f"#{head}" for verb, head in single.items()}
        phases = actions.phases
        self._grasping = frozenset(phases.get("grasp", ()))
        self._grasp_first = frozenset(phases.get("grasp_first", ()))
        self._gripping = frozenset(_stem(word) for word in phases.get("gripping", ()))
        self._parts = frozenset(_stem(part) for part in actions.parts)
        self._releasing = re.compile("|".join(map(re.escape, phases.get("releasing", ()))) or "(?!)")  # "(?!)": never
        self.of_text = lru_cache(maxsize=20_000)(self._of_text)
        self.of_word = lru_cache(maxsize=20_000)(self._terms_of)  # of a large book few texts, but most words, recur

    def grips(self, action: str, context: SubtaskContext) -> bool:
        """Whether the hand will take hold of something in the course of an action."""
        head = self._actions.canonical(action)
        return head in self._grasping or (head in self._grasp_first and context.holding is False)

    def about_gripping(self, text: str) -> bool:
        """Whether a text says how to hold a thing, and not how to let go of it."""
        return GRIP in self.of_text(text) and not self.releases(text)

    def releases(self, text: str) -> bool:
        """Whether a text says how to let go of a thing."""
        return self._releasing.search(text.lower()) is not None

    def particular(self, text: str) -> bool:
        """Whether a text names an action or a part that things have, and so is about some subtasks only."""
        terms = self.of_text(text)
        return any(term.startswith("#") for term in terms) or not self._parts.isdisjoint(terms)

    def of_subtask(self, subtask: Key, context: SubtaskContext) -> Wanted:
        """Terms with their weights, and what counts as all of them: of the action and the things it names. What the
        scene shows and what the hand will do make further terms, by which a note can match beyond its words."""
        about = self._actions.about(subtask)
        named = {term: 1.0 for term in self.of_text(" ".join(about.objects))}
        named[f"#{self._actions.canonical(subtask.action)}"] = 1.0
        total = float(len(named))
        more: dict[str, float] = {}
        words = [word for name in about.objects for word in name.split()]
        for word in (*words, *context.parts):
            more |= {f"#{self._actions.canonical(verb)}": _SEEN for verb in self._actions.parts.get(word, ())}
        more |= {term: _SEEN for word in (*context.parts, *context.labels) for term in self.of_text(word)}
        more |= {term: _ATTRIBUTE for seen in context.attributes for term in self.of_text(seen)}
        if self.grips(subtask.action, context):
            more[GRIP] = GRIPPED
        return more | named, total

    def overlap(self, wanted: Wanted, text: str) -> float:
        """The share of a subtask's terms that a text has, 0 to 1."""
        weights, total = wanted
        there = self.of_text(text)
        return min(1.0, sum(weight for term, weight in weights.items() if term in there) / total)

    def _of_text(self, text: str) -> frozenset[str]:
        return frozenset().union(*map(self.of_word, WORD.findall(text.lower())))

    def _terms_of(self, word: str) -> frozenset[str]:
        if word in _STOP or len(word) < 2:
            return frozenset()
        stem = _stem(word)
        found = {self._group.get(stem, stem)}
        if stem in self._gripping:
            found.add(GRIP)
        if len(word) > 5 and word.endswith("er"):  # a shaker is for shaking
            doing = _stem(word[:-2])
            found.add(self._group.get(doing, doing))
        return frozenset(found)


def _stem(word: str) -> str:
    for suffix in _SUFFIXES:
        if word.endswith(suffix) and len(word) - len(suffix) >= 3:
            word = word[: -len(suffix)]
            if suffix in ("ing", "ed") and len(word) > 3 and word[-1] == word[-2] and word[-1] not in "ls":
                word = word[:-1]  # gripping
            break
    return word[:-1] if word.endswith("e") and len(word) > 3 else word
