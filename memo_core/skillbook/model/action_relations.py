"""Synonymous and opposite actions, listed in a table because cosine similarity does not separate opposites."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from importlib import resources

import attrs

from memo_core.errors import InvalidArgument
from memo_core.skillbook.model.keys import Key

_OUTCOMES = {"open": "open", "shut": "close", "closed": "close", "on": "", "off": "", "out": "", "apart": ""}
_KEEPING = frozenset(("leave", "keep", "hold", "let"))  # "leave open" opens nothing
_WORDS_LIGHT = "do get give go have keep lay leave let make run set take"
_LIGHT = frozenset(_WORDS_LIGHT.split())  # mean what their complement says
_WORDS_WAY = """
about across against ahead along apart around aside away back backward backwards by clear closed completely down
downward downwards first flat forward forwards free from fully further half halfway in inside into inward left level
loose off on onto open out outside outward over partly past right round shut slightly straight through tight to together
toward towards up upright upward upwards with
"""
_WHERE_TO = frozenset(("into", "onto", "inside"))  # whatever the verb, the thing ends up in a place
_PARTICLES = frozenset(_WORDS_WAY.split())


def _normal(verb: str) -> str:
    return Key.make(verb, "object").action


@attrs.frozen
class Actions:
    """Synonym groups and opposite pairs. The relation is symmetric and irreflexive."""

    groups: dict[str, str]  # verb -> the verb that stands for its group
    opposites: frozenset[frozenset[str]]
    parts: dict[str, tuple[str, ...]] = attrs.field(factory=dict)  # visible part -> how it is usually worked
    phases: dict[str, tuple[str, ...]] = attrs.field(factory=dict)  # see ``action_relations.toml``

    @classmethod
    def build(cls, synonyms: Mapping[str, Iterable[str]], pairs: Iterable[Iterable[str]]) -> Actions:
        """From tables as in ``action_relations.toml``. Raises ``InvalidArgument`` for a verb in two groups and for a
        pair that does not name two different groups, ``NotAKey`` for text that is not a verb."""
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
        """A copy of these tables with additional groups and pairs. A verb that is listed again moves to the new
        group."""
        table: dict[str, list[str]] = {}
        moved = {_normal(v) for others in synonyms.values() for v in others}
        for verb, head in self.groups.items():
            if verb not in moved:
                table.setdefault(head, []).append(verb)
        for head, others in synonyms.items():
            table.setdefault(self.groups.get(_normal(head), _normal(head)), []).extend(others)
        built = Actions.build(table, [*(tuple(pair) for pair in self.opposites), *pairs])
        return attrs.evolve(built, parts=self.parts, phases=self.phases)

    def canonical(self, action: str) -> str:
        """The representative verb of ``action``'s group, or the action itself if it is in none. A longer spelling is
        reduced to its first words if the rest is a direction or manner ("pick up gently") or names an object ("grasp
        handle", see ``about``). It is not reduced if its last word changes the result ("shut off" is not closing;
        "nudge shut" is), if a state is only kept ("leave open"), or if the complement determines the verb's meaning
        ("set table", "get rid of"). A verb in no group counts as placing if it states a destination ("tuck into").
        """
        return self._take_apart(action)[0]

    def about(self, key: Key) -> Key:
        """The key with an object that is named in the action moved to the objects: GRASP_HANDLE(fridge) becomes
        GRASP(fridge handle)."""
        verb, noun = self._take_apart(key.action)
        if not noun:
            return key
        first, *others = key.objects
        named = first if set(noun.split()) <= set(first.split()) else f"{first} {noun}"
        return Key(verb, (named, *others))

    def _take_apart(self, action: str) -> tuple[str, str]:
        """Canonical verb, and the object that the action names, "" for none."""
        words = action.split()
        if action in self.groups or len(words) < 2:
            return self.groups.get(action, action), ""
        if words[-1] in _OUTCOMES:
            outcome = "" if words[0] in _KEEPING else _OUTCOMES[words[-1]]
            return self.groups.get(outcome, action), ""
        for length in range(len(words) - 1, 0, -1):
            found = self.groups.get(" ".join(words[:length]))
            if found is None:
                continue
            rest = [word for word in words[length:] if word not in _PARTICLES and not word.endswith("ly")]
            if rest and words[0] in _LIGHT:
                return action, ""
            return found, " ".join(rest)
        if words[-1] in _WHERE_TO and "place" in self.groups:
            return self.groups["place"], ""
        return action, ""

    def opposite(self, one: str, other: str) -> bool:
        """Whether one action undoes the other."""
        return frozenset((self.canonical(one), self.canonical(other))) in self.opposites


@cache
def default_actions() -> Actions:
    """The shipped table ``action_relations.toml``."""
    table = tomllib.loads(
        resources.files("memo_core.skillbook.model").joinpath("action_relations.toml").read_text(encoding="utf-8")
    )
    built = Actions.build(table["synonyms"], table["opposites"]["pairs"])
    parts = {part: tuple(verbs) for part, verbs in table["parts"].items()}
    return attrs.evolve(built, parts=parts, phases={name: tuple(words) for name, words in table["phases"].items()})
