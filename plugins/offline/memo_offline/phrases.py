"""The ways of saying things that are understood, from ``phrases.yaml``, and how amounts are said."""

from __future__ import annotations

import re
from functools import cache
from importlib import resources
from typing import Any

import attrs
import yaml

OFFERED = 90  # characters of the names that a question offers
UNITS = {"cm": 0.01, "mm": 0.001, "m": 1.0, "inch": 0.0254}  # of lengths, in metres
_DROPPED = frozenset(["the", "a", "an", "your", "my", "its", "their", "this", "please", "just", "really", "very"])
_PRONOUNS = {"them": "it", "they": "it", "that": "it", "those": "it", "these": "it"}


@attrs.frozen
class Amount:
    """An amount as it was said. ``unit`` is cm (``value`` in metres), degrees, percent, seconds, times, or rough (a
    word such as "a bit": ``value`` in metres and the ``factor`` of a path's length)."""

    said: str
    unit: str
    value: float
    factor: float = 1.0


@attrs.frozen
class Phrase:
    """One way of doing something differently; ``phrases.yaml`` explains the fields."""

    name: str
    matter: str
    value: str
    say: str
    words: tuple[str, ...]
    takes: tuple[str, ...] = ()
    of: tuple[str, ...] = ()
    general: str = ""
    lesson: frozenset[tuple[str, ...]] = frozenset()


@attrs.frozen
class Tokens:
    """A text's words without articles; ``starts`` are the indices at which a clause begins; amounts stand as ``#``."""

    words: tuple[str, ...]
    starts: frozenset[int]
    amounts: tuple[Amount, ...]

    def clause(self, index: int) -> int:
        """The index at which the clause of a word begins."""
        return max((start for start in self.starts if start <= index), default=0)


@attrs.frozen(eq=False)
class Phrases:
    """The data of ``phrases.yaml``, ready to be searched: keywords as tuples of words, the longest first."""

    all: tuple[Phrase, ...]
    keywords: tuple[tuple[tuple[str, ...], Phrase | None], ...]  # None: passed over
    praise: tuple[tuple[str, ...], ...]
    negations: tuple[tuple[str, ...], ...]
    conditions: tuple[tuple[str, ...], ...]
    relations: tuple[tuple[str, ...], ...]
    amounts: re.Pattern[str]
    data: dict[str, Any]

    def named(self, name: str) -> Phrase:
        """The phrase of a name."""
        return next(phrase for phrase in self.all if phrase.name == name)

    def offers(self, kind: str) -> str:
        """The names of what is worth saying of a kind of subtask, as many as a question has room for."""
        names = ", ".join(one.name for one in self.all if not one.of or kind in one.of)
        return names if len(names) <= OFFERED else f"{names[:OFFERED].rpartition(',')[0]}, …"

    def tokens(self, text: str) -> Tokens:
        """A text taken apart, with its amounts."""
        plain = (
            text.lower().replace("’", "'").replace("anti-clock", "anticlock").replace("counter-clock", "counterclock")
        )
        found: list[Amount] = []

        def kept(match: re.Match[str]) -> str:
            found.append(self._amount(match))
            return " # "

        plain = self.amounts.sub(kept, plain.replace("#", " "))
        words: list[str] = []
        starts = {0}
        for token in re.findall(r"[^\W_]+(?:'[^\W_]+)*|[#.,;:!?]", plain):
            if not re.match(r"[\w#]", token):
                starts.add(len(words))
                continue
            if token in ("and", "but", "then"):
                starts.add(len(words))
            if token not in _DROPPED:
                words.append(_PRONOUNS.get(token, token))
        return Tokens(tuple(words), frozenset(starts), tuple(found))

    def _amount(self, match: re.Match[str]) -> Amount:
        said = " ".join(match.group().split())
        if match.group("rough"):
            metres, factor = self.data["rough"][match.group("rough")]
            return Amount(said, "rough", float(metres), float(factor))
        if match.group("angle"):
            return Amount(said, "degrees", float(self.data["angles"][match.group("angle")]))
        number = match.group("number").replace(",", ".")
        value = float(self.data["numbers"].get(number, 0.0) or number)
        unit = next(name for name, spelt in self.data["units"].items() if match.group("unit") in spelt)
        return Amount(said, "cm", value * UNITS[unit]) if unit in UNITS else Amount(said, unit, value)


@cache
def load() -> Phrases:
    """The built-in phrases."""
    data = yaml.safe_load(resources.files(__package__).joinpath("phrases.yaml").read_text("utf-8"))
    phrases = Phrases((), (), (), (), (), (), _amounts(data), data)

    def spelt(words: list[str]) -> tuple[tuple[str, ...], ...]:
        found = {tuple("#" if word == "amount" else word for word in phrases.tokens(one).words) for one in words}
        return tuple(sorted(found, key=len, reverse=True))

    every = []
    keywords: list[tuple[tuple[str, ...], Phrase | None]] = [(words, None) for words in spelt(data["passed over"])]
    for name, entry in data["phrases"].items():
        lists = {key: tuple(entry[key]) for key in ("words", "takes", "of") if key in entry}
        texts = {key: entry.get(key, "") for key in ("matter", "value", "say", "general")}
        phrase = Phrase(name, **(texts | lists), lesson=frozenset(spelt(entry.get("lesson", []))))
        every.append(phrase)
        keywords += [(words, phrase) for words in spelt(entry["words"])]
    keywords.sort(key=lambda pair: len(pair[0]), reverse=True)
    return attrs.evolve(
        phrases,
        all=tuple(every),
        keywords=tuple(keywords),
        praise=spelt(data["praise"]),
        negations=spelt(data["negations"]),
        conditions=spelt(data["conditions"]),
        relations=spelt(data["relations"]),
    )


def _amounts(data: dict[str, Any]) -> re.Pattern[str]:
    def any_of(words: Any) -> str:
        return "|".join(re.escape(str(one)) for one in sorted(words, key=lambda one: -len(str(one))))

    units = any_of(spelling for spellings in data["units"].values() for spelling in spellings)
    number = rf"(?P<number>\d+(?:[.,]\d+)?|(?<![\w'])(?:{any_of(data['numbers'])})(?= ))"
    about = r"(?<![\w'])(?:(?:by|about|around|some|another) )*"
    return re.compile(
        rf"{about}(?:(?P<angle>{any_of(data['angles'])})|(?P<rough>{any_of(data['rough'])})"
        rf"|{number} ?(?P<unit>{units}))(?!\w)(?! time\b)"
    )
