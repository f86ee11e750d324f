"""Which actions mean the same and which undo each other: a relation of its own, because no cosine tells them apart."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import resources

import attrs

from memo_core.errors import InvalidArgument
from memo_core.skillbook.keys import Key

_OUTCOMES = {"open": "open", "shut": "close", "closed": "close", "on": "", "off": "", "out": "", "apart": ""}


def _normal(verb: str) -> str:
    return Key.make(verb, "object").action


@attrs.frozen
class Actions:
    """Synonym groups and opposite pairs. The relation is symmetric and irreflexive."""

    groups: dict[str, str]  # verb -> the verb that stands for its group
    opposites: frozenset[frozenset[str]]

    @classmethod
    def build(cls, synonyms: Mapping[str, Iterable[str]], pairs: Iterable[Iterable[str]]) -> Actions:
        """From tables as in ``actions.toml``. Raises ``InvalidArgument`` for a verb in two groups, a pair that is not
        two different groups, and ``NotAKey`` for what is no verb."""
        groups: dict[str, str] = {}
        for head, others in synonyms.items():
            for verb in (head, *others):
                normal = _normal(verb)
                if groups.setdefault(normal, _normal(head)) != _normal(head):
                    problem = f"{normal!r} stands under {groups[normal]!r} and under {head!r}"
                    raise InvalidArgument("retrieval.synonyms", problem, "one group a verb")
        opposites = set()
        for pair in pairs:
            verbs = [groups.get(_normal(v), _normal(v)) for v in pair]
            if len(verbs) != 2 or verbs[0] == verbs[1]:
                problem = f"{list(pair)} is no pair of opposites"
                raise InvalidArgument("retrieval.opposites", problem, "two verbs of different groups")
            opposites.add(frozenset(verbs))
        return cls(groups, frozenset(opposites))

    def extended(self, synonyms: Mapping[str, Iterable[str]], pairs: Iterable[Iterable[str]]) -> Actions:
        """These tables with more of both. A verb named anew leaves its old group."""
        table: dict[str, list[str]] = {}
        moved = {_normal(v) for others in synonyms.values() for v in others}
        for verb, head in self.groups.items():
            if verb not in moved:
                table.setdefault(head, []).append(verb)
        for head, others in synonyms.items():
            table.setdefault(self.groups.get(_normal(head), _normal(head)), []).extend(others)
        return Actions.build(table, [*(tuple(pair) for pair in self.opposites), *pairs])

    def canonical(self, action: str) -> str:
        """The verb that stands for ``action``'s group; the action itself when it is in none.

        A longer spelling falls back on its first words, "pick up gently" stands under "pick", unless its last word says
        what becomes of the thing: "nudge shut" closes, "shut off" is no closing and stands for itself.
        """
        words = action.split()
        if action not in self.groups and len(words) > 1 and words[-1] in _OUTCOMES:
            return self.groups.get(_OUTCOMES[words[-1]], action)
        for length in range(len(words), 0, -1):
            found = self.groups.get(" ".join(words[:length]))
            if found is not None:
                return found
        return action

    def opposite(self, one: str, other: str) -> bool:
        """Whether one undoes the other."""
        return frozenset((self.canonical(one), self.canonical(other))) in self.opposites


@cache
def default_actions() -> Actions:
    """The shipped table ``actions.toml``."""
    table = tomllib.loads(resources.files("memo_core.skillbook").joinpath("actions.toml").read_text(encoding="utf-8"))
    return Actions.build(table["synonyms"], table["opposites"]["pairs"])
