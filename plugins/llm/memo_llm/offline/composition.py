"""Clauses taken apart into what, where, how, how much and when.

A clause is a row of parts from the lexicon (``composition.yaml``): verbs, things, ways, manners, amounts, places,
times, and words that only lead up to a request or address somebody. Which parts follow each other is free; what
counts is that every word belongs to one. What the parts mean together is in ``meaning.py``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import attrs

NEUTRAL = frozenset(["lead", "vocative", "very", "comparison", "destination", "prep", "be", "vessel"])
_SAYS_NOTHING = NEUTRAL | {"pronoun", "hand", "not", "too", "again"}
_WISHES = frozenset(["manner", "dir", "side", "turning", "extent", "pose", "centre"])
TIMES = frozenset(["after_release", "before_release", "before_go", "before_down", "when_touch"])
_WORD_END = r"(?![\w'-])"
# Words in names of things that also say where something is, or are parts that something is held at.
_PLACES_TOO = frozenset(
    [
        "left",
        "right",
        "top",
        "bottom",
        "upper",
        "lower",
        "front",
        "back",
        "inside",
        "handle",
        "lid",
        "cap",
        "rim",
        "knob",
        "lever",
        "edge",
        "side",
        "middle",
        "open",
        "shut",
    ]
)
# What the subtask's action is called.
_ACTIONS = frozenset(
    [
        "up",
        "down",
        "on",
        "off",
        "in",
        "out",
        "over",
        "into",
        "pick",
        "place",
        "put",
        "open",
        "close",
        "turn",
        "take",
        "push",
        "pull",
        "press",
        "pour",
        "shake",
        "wipe",
        "stack",
        "set",
        "heat",
    ]
)
_WAYS_TOO = ("lower", "left", "close", "edge", "rest", "back", "level")  # verbs only before an object
_OBJECT = re.compile(r" (?:it|them|this|that|the|your|my|its|each|a|an|those|these)\b")
_NOT_THIS = ("left", "right", "other", "wrong", "another", "next", "second", "upper", "lower", "back", "front")

_ADVICE = re.compile(
    r"(?:(?:well|no|maybe|perhaps|i think|hm+|oh|please|hey)[, ]+)*if (?:you|it)(?: just| only| could)? (?P<how>.+?)"
    r"(?=,? (?:then )?(?:it|you|that|they|this|things|the \w+|nothing|we|i)"
    r"(?:'d| would| wouldn't| might| could| should| won't)\b)"
)
_GONE_WRONG = (
    r"break|burst|spill|fall|snap|tip|knock|hit|drop|crush|squash|scratch|hurt|lose|bump|slip|tear|bend|rip|smash|crack|"
    r"jam|get stuck|ruin|damage|topple|splash|burn"
)
_WARNING = re.compile(
    rf"\b(?:and |but |because |or )?if (?:you|it)\b[^.;!?]*?\b(?:you|it|they|that|the \w+)"
    r"(?:'ll| will|'s going to|'re going to)"
    rf"(?: just| only| all| probably)* (?:{_GONE_WRONG})\b[^.;,!?]*"
)


@attrs.frozen
class Part:
    """A piece of a clause. ``kind`` is a heading of the lexicon's parts, "verb", "thing", "place" or "other" (a thing
    that the subtask is not about); ``value`` what it stands for; ``classes`` those of a verb; ``past`` whether a verb
    tells of something done."""

    kind: str
    value: str
    said: str
    classes: frozenset[str] = frozenset()
    past: bool = False


@attrs.frozen(eq=False)
class Lexicon:
    """Patterns of the parts, and verbs by their forms."""

    patterns: tuple[tuple[str, str, re.Pattern[str]], ...]
    verbs: dict[str, tuple[frozenset[str], bool]]  # form -> (classes, past)
    verb: re.Pattern[str]
    bases: dict[str, str]  # past form -> base

    @classmethod
    def of(cls, data: Mapping[str, Any], groups: Mapping[str, str]) -> Lexicon:
        """From the mapping of ``composition.yaml``. ``groups``: patterns that may stand in braces."""
        parts: Mapping[str, Mapping[str, Sequence[str]]] = data["parts"]
        verbs: Mapping[str, Sequence[str]] = data["verbs"]
        irregular: Mapping[str, Sequence[str]] = data["irregular"]

        def filled(pattern: str) -> str:
            return re.sub(r"\{([a-z_]+)\}", lambda m: groups[m.group(1)], pattern)

        patterns = [
            (kind, value, re.compile(rf"(?:{filled(pattern)}){_WORD_END}"))
            for kind, values in parts.items()
            for value, alternatives in values.items()
            for several in alternatives
            for pattern in _alternatives(several)
        ]
        classes: dict[str, set[str]] = {}
        past: dict[str, bool] = {}
        before: dict[str, str] = {}
        for name, bases in verbs.items():
            for base in bases:
                for form, told in _inflected(base, irregular):
                    classes.setdefault(form, set()).add(name)
                    past[form] = past.get(form, True) and told
                    if told and " " not in form:
                        before.setdefault(form, base.split()[0])
        forms = {form: (frozenset(names), past[form]) for form, names in classes.items()}
        longest = "|".join(re.escape(form) for form in sorted(forms, key=len, reverse=True))
        return cls(tuple(patterns), forms, re.compile(rf"(?:{longest}){_WORD_END}"), before)

    def as_request(self, text: str) -> str:
        """Advice said as a condition, as a request: "if you held it lower, it wouldn't tip" as "you should hold it
        lower; it wouldn't tip". What would go wrong otherwise is left out: "if you push any harder you'll break it"."""
        text = _WARNING.sub(" ", text)
        advice = _ADVICE.match(text)
        if advice is None:
            return text
        words = [self._base(word) for word in advice.group("how").split()]
        return f"{' '.join(words)}; {text[advice.end('how') :].lstrip(', ')}"

    def _base(self, word: str) -> str:
        bare = word.rstrip(",")
        return self.bases.get(bare, bare) + word[len(bare) :]

    def pieces(self, words: str, own: frozenset[str], others: frozenset[str]) -> list[tuple[str, str]]:
        """Parts, and words that belong to none, each with its kind ("" for such a word)."""
        patterns = self._patterns(own, others)
        words = " ".join(words.split())
        found: list[tuple[str, str]] = []
        at = 0
        while at < len(words):
            part = self._longest(words, at, patterns)
            said = part.said if part is not None else words[at:].split()[0]
            found.append((part.kind if part is not None else "", said))
            at += len(said) + 1
        return found

    def begins_with_wish(self, clause: str) -> bool:
        """Whether a clause begins with how, where, which way or how far: "but loosely enough that it can swing"."""
        pieces = [kind for kind, _ in self.pieces(clause, frozenset(), frozenset()) if kind != "lead"]
        return bool(pieces) and pieces[0] in _WISHES

    def asks(self, clause: str) -> bool:
        """Whether some part of a clause could be a wish: what to do, where, how or how far."""
        return any(kind and kind not in _SAYS_NOTHING for kind, _ in self.pieces(clause, frozenset(), frozenset()))

    def _patterns(self, own: frozenset[str], others: frozenset[str]) -> list[tuple[str, str, re.Pattern[str]]]:
        return [
            *_nouns("other", others - _PLACES_TOO, frozenset()),
            *_nouns("thing", own - _PLACES_TOO - _ACTIONS, others),
            *self.patterns,
        ]

    def parts(self, clause: str, own: frozenset[str], others: frozenset[str]) -> list[Part] | None:
        """A clause's parts in their order; None where a word belongs to none. ``own`` and ``others`` are nouns for what
        the subtask is about and for what else is to be seen."""
        patterns = self._patterns(own, others)
        found: list[Part] = []
        at = 0
        while at < len(clause):
            if clause[at] == " ":
                at += 1
                continue
            part = self._longest(clause, at, patterns)
            if part is None:
                return None
            if (
                found
                and found[-1].kind in ("prep", "relation")
                and part.kind not in ("thing", "other", "pronoun", "hand", "vessel")
            ):
                return None
            if part.kind == "vessel" and (not found or found[-1].kind not in ("prep", "relation")):
                return None
            found.append(part)
            at += len(part.said)
        return None if found and found[-1].kind in ("prep", "relation") else found

    def _longest(self, clause: str, at: int, patterns: Iterable[tuple[str, str, re.Pattern[str]]]) -> Part | None:
        best: Part | None = None
        match = self.verb.match(clause, at)
        if match and (match.group() not in _WAYS_TOO or _OBJECT.match(clause, match.end())):
            classes, past = self.verbs[match.group()]
            best = Part("verb", match.group(), match.group(), classes, past)
        for kind, value, pattern in patterns:
            match = pattern.match(clause, at)
            if match and len(match.group()) > (len(best.said) if best else 0):
                best = Part(kind, value, match.group())
        return best


@lru_cache(maxsize=200)
def _nouns(kind: str, words: frozenset[str], apart: frozenset[str]) -> tuple[tuple[str, str, re.Pattern[str]], ...]:
    """Patterns for things; ``apart``: words before a noun that make it another thing."""
    if not words:
        return ()
    named = "|".join(re.escape(word) for word in sorted(words, key=len, reverse=True))
    other = "|".join(re.escape(word) for word in sorted({*apart, *_NOT_THIS}))
    the = r"(?:the|that|this|my|your|its|a|an|those|these|both|each|every|any|all|of the)"
    pattern = rf"(?:{the} )*(?:(?!(?:{other})\b)[a-z]+ )??(?:{named})s?(?: (?:{named})s?)*{_WORD_END}"
    return ((kind, "", re.compile(pattern)),)


def _alternatives(pattern: str) -> list[str]:
    """The alternatives of a regular expression, so that the longest that fits can be told."""
    found, depth = [""], 0
    for letter in pattern:
        depth += (letter == "(") - (letter == ")")
        if letter == "|" and depth == 0:
            found.append("")
        else:
            found[-1] += letter
    return found


def _inflected(base: str, irregular: Mapping[str, Sequence[str]]) -> list[tuple[str, bool]]:
    """Forms of a verb, particles behind it, each with whether it tells of something done."""
    word, _, particle = base.partition(" ")
    behind = f" {particle}" if particle else ""
    stem = word[:-1] if word.endswith("e") and not word.endswith("ee") else word
    doubled = stem + stem[-1] if re.search(r"[^aeiou][aeiou][bdgmnpt]$", word) else stem
    ending = "es" if re.search(r"(?:s|sh|ch|x|o)$", word) else "s"
    past = irregular.get(word) or [f"{doubled}ed"]
    forms = [(word, False), (f"{doubled}ing", False), (word + ending, False)]
    forms += [(form, form != word) for form in past]
    return [(form + behind, told) for form, told in dict(reversed(forms)).items()]
