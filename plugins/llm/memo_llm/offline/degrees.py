"""Remarks of degree: more or less of something that can be had more or less of, however it is put.

"Too high", "not so high", "less high", "lower" and "not low enough" are one request. The vocabulary's ``scales`` say
which words stand at which end of a scale; what makes a request of them is grammar and stands here.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import attrs

REFUSED = "refused"  # "no lower", "don't go any further": says where to stop, not where to go

_RATHER = r"(?:(?:much|way|far|a bit|a little|slightly|just|quite|clearly|still|even|really|a tad|somewhat) )*"
_TO = r"(?:(?:over |further |farther |far |more )*(?:to |towards? |on )(?:the |your |its )|far |much |over |further )?"
# "the lower end", "from the left", "on the right side" say where something is, not how much of something is wanted.
_NO_PLACE = (
    r"(?! (?:end|edge|side|part|rim|half|corner|hinge|hand|one|ones)\b| (?:of|as|on) (?:the|it|its|that)\b"
    r"| (?:from|apart|away|below|above|left|right|clockwise|it|them|your|its|the \w+)\b)"
)
_PARTS = {  # of the patterns below
    "NOT": r"(?:\w+n't|not|never|no|nor|without|hardly|barely|cannot)",
    "DONT": r"(?:don't|needn't|mustn't|shouldn't|wouldn't|not|never|no|without)",
    "RATHER": _RATHER,
    "TO": _TO,
}
_MORE = (
    "(?:AMOUNT )?RATHERCOMPARATIVE(?: (?:by |about )*AMOUNT)?(?: QUANTITY)?",
    "be (?:very |more |a bit |a little )*PLAIN",
    r"NOT\b(?:(?! (?:down|up|left|right|in|out)\b)[^;\x00]){0,25}? PLAIN enough(?: (?:to|on) (?:the|your) \w+)?",
)
_LESS = (
    "(?:by )?(?:AMOUNT )?RATHERtoo TOPLAIN(?: (?:by |about )*AMOUNT)?",
    r"DONT(?: \w+)?(?: (?:it|them|this|that|the \w+))?(?: all| quite)? (?:so|that|too|as|overly) TOPLAIN",
    "(?:AMOUNT )?less PLAIN(?: away)?(?: (?:by )?AMOUNT)?",
    r"(?:AMOUNT )?RATHERCOMPARATIVE than (?:it |you )?(?:should|necessary|needed|required|i want)\w*"
    "(?: be| have| to| been)*",
)
_NEITHER = (r"DONT(?: \w+){0,3}? (?:any )?COMPARATIVE",)
_MORE_OF = (
    r"(?:AMOUNT )?(?:more|increase|raise|greater) (?:the |your )?NOUN",
    r"NOT (?:\w+ )?enough NOUN",
    "too little NOUN",
)
_LESS_OF = (
    r"(?:AMOUNT )?(?:less|reduce|decrease|lessen|lower|limit) (?:the |your )?NOUN",
    "(?:much |way )?too much NOUN",
    r"NOT(?: \w+)? (?:so|that|too|as) much NOUN",
    "(?:go |be )?(?:easy|lightly|careful) (?:on|with) (?:the |your )?NOUN",
)


@attrs.frozen
class Scale:
    """What can be had more or less of. ``more`` and ``less`` are (edit, value), ``high`` and ``low`` the adjectives of
    either end in their plain form; ``nouns`` name the quantity itself. ``only``: kinds of subtask; none: all."""

    more: tuple[str, str]
    less: tuple[str, str]
    high: tuple[str, ...]
    low: tuple[str, ...]
    nouns: tuple[str, ...] = ()
    only: tuple[str, ...] = ()


@attrs.frozen
class Degree:
    """One request: where it stands in the clause, what it asks for, and the words it was read from."""

    start: int
    end: int
    edit: str
    value: str
    said: str


@attrs.frozen(eq=False)
class Degrees:
    """The patterns of all scales: (pattern, (edit, value), kinds of subtask)."""

    patterns: tuple[tuple[re.Pattern[str], tuple[str, str], tuple[str, ...]], ...]

    @classmethod
    def of(cls, scales: Iterable[Scale], amount: str) -> Degrees:
        """``amount``: a regular expression for what "3 cm" or "a bit" looks like."""
        found = []
        for scale in scales:
            for words, same, other in (
                (scale.high, scale.more, scale.less),
                (scale.low, scale.less, scale.more),
            ):
                if not words:
                    continue
                for patterns, wanted in ((_MORE, same), (_LESS, other), (_NEITHER, (REFUSED, ""))):
                    found += [
                        (_compile(pattern, words, amount, scale.nouns), wanted, scale.only) for pattern in patterns
                    ]
            for patterns, wanted in ((_MORE_OF, scale.more), (_LESS_OF, scale.less)):
                if scale.nouns:
                    found += [(_compile(p, scale.nouns, amount, scale.nouns), wanted, scale.only) for p in patterns]
        return cls(tuple(found))

    def read(self, clause: str, kind: str) -> list[Degree]:
        """What a clause asks for, in its order; of overlapping readings the longest counts."""
        readings = [
            Degree(match.start(), match.end(), *wanted, match.group())
            for pattern, wanted, only in self.patterns
            if not only or kind in only
            for match in pattern.finditer(clause)
        ]
        kept: list[Degree] = []
        for one in sorted(readings, key=lambda reading: (reading.start - reading.end, reading.start)):
            if all(one.end <= other.start or one.start >= other.end for other in kept):
                kept.append(one)
        return sorted(kept, key=lambda reading: reading.start)


def _compile(pattern: str, words: tuple[str, ...], amount: str, nouns: tuple[str, ...]) -> re.Pattern[str]:
    plain = "|".join(sorted({form for word in words for form in plain_forms(word)}, key=len, reverse=True))
    more = "|".join(sorted({form for word in words for form in comparatives(word)}, key=len, reverse=True))
    more = (
        rf"(?:{more})(?: a?round)?(?! (?:up|down|left|right|along)\b)"
        if "far" in words
        else f"(?:{more})(?: up| down| over| open)?"
    )
    parts = _PARTS | {
        "AMOUNT": amount,
        "NOUN": rf"(?:{'|'.join(words)})",
        "QUANTITY": rf"(?:{'|'.join(nouns) or '(?!)'})",
        "PLAIN": rf"(?:{plain}){_NO_PLACE}",
        "COMPARATIVE": rf"(?:(?:more|further|farther|even) {_TO}(?:{plain})|{more}){_NO_PLACE}",
    }
    filled = re.sub("|".join(sorted(parts, key=len, reverse=True)), lambda match: parts[match.group()], pattern)
    return re.compile(rf"(?<![\w-])(?<!the )(?<!from )(?:{filled})(?![\w-])")


def plain_forms(word: str) -> tuple[str, str]:
    """The word as an adjective and as an adverb: soft, softly; gentle, gently; easy, easily."""
    if word.endswith("le"):
        return word, f"{word[:-1]}y"
    return word, f"{word[:-1]}ily" if word.endswith("y") else f"{word}ly"


def comparatives(word: str) -> tuple[str, ...]:
    if word == "far":
        return tuple(
            f"{far}{way}" for far in ("further", "farther") for way in ("", " back", " in", " inside", " out", " open")
        )
    if re.search(r"[^aeiou][aeiou][gtdn]$", word):
        return (f"{word}{word[-1]}er",)
    return (f"{word[:-1]}ier" if word.endswith("y") else f"{word}r" if word.endswith("e") else f"{word}er",)
