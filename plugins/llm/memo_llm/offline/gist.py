"""What a remark comes down to, said in words that are surely read.

The rules read a sentence word by word and ask where a word is left over. Beside them, what was learnt from many
sentences (``learnt.py``) tells what a remark as a whole asks for; ``gist.yaml`` says it in plain words, with the
amounts that the person named. ``hearing.hear`` decides which of the two is followed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache

import attrs

from memo_llm.offline.asked import HOW_FAR, PLAN, asked_names
from memo_llm.offline.learnt import Asked
from memo_llm.offline.spelling import in_figures
from memo_llm.offline.surroundings import Surroundings
from memo_llm.offline.vocabulary import Vocabulary, read_yaml

FEWEST = 3  # words of which a gist can be told
EVIDENT = 0.08  # probability of its likeliest name by itself, below which nothing speaks for a gist
LIKELY = 0.3  # probability from which on it is worth asking whether that is meant
_OTHER = "other"
_IN_THINGS = re.compile(r"\bby (?:about |around |roughly )?half an? \w+")  # how far, measured in something
_TO_ANGLE, _ALL_THE_WAY = "to-angle", "all-the-way"
_HALF = r"\bhalf\b|\bhalf-?way\b"
_SHARES = {r"\b(?:past|beyond|more than|over) half": 60.0, _HALF: 45.0, r"\ba third\b": 30.0}
_TURNS = {
    r"\bcorners?\b|\bpoint(?:y|s)\b|\bdiagonal\w*": 45,
    r"\b(?:a bit|a little|slightly|a touch|a tad|somewhat)\b": 30,
    "": 90,
}  # of the hand
_LAST_BIT = re.compile(  # which is no amount to go
    r"\blast (?:few|couple of|\w+) (?:cm|mm|centimet\w+|inch\w*)\b|"
    r"\b(?<=still open) (?:by |about |around |maybe )*(?:an?|one|two|three|four|[\d.]+) (?:cm|mm|centimet\w+|inch\w*)\b"
)
_EXCEPTION = re.compile(r"\b(?:unless|except)\b|^(?:what|why|who|how)\b[^.!]*\?\s*$")  # or nothing but a question
_SOMEBODY_ELSE = re.compile(r"\b(?:i'll|i will|let me|i'm going to)\b")
_PART = re.compile(r"\b(?:button|switch|pedal|key)\b")
_LENGTH = "(?:cm|mm|inch|m)"
_UNITS = {"{amount} {gap}": _LENGTH, "{angle}": "degrees", "{seconds}": "seconds"}


@attrs.frozen
class Gist:
    """``text`` says what is asked for of the motion; "" where nothing is."""

    text: str
    probability: float
    about_plans: bool = False
    evidence: float = 1.0  # the probability of its likeliest name by itself


def gist_of(
    words: str,
    asked: Asked,
    kind: str,
    vocabulary: Vocabulary,
    around: Surroundings | None = None,
    beside: str = "",
) -> Gist | None:
    """What a remark about a subtask of this kind is likely to come down to; None where that cannot be told, or cannot
    be said of such a subtask. ``asked``: what the classifier makes of it. ``beside``: the thing, if any, that what is
    put down goes beside."""
    if len(words.split()) < FEWEST or asked.probability < LIKELY or asked.evidence < EVIDENT:
        return None
    names, probability = asked_names(words, asked, kind, around)
    if not names or _EXCEPTION.search(words.lower()):
        return None
    about_plans, names = PLAN in names, names - {PLAN}
    straight_quotes = " ".join(words.lower().replace("’", "'").split())
    if about_plans and not names:
        return None if _SOMEBODY_ELSE.search(straight_quotes) else Gist("", probability, about_plans)
    if any("{place}" in _said(name, kind) for name in names) and (about_plans or not beside):
        return None  # beside what, is not said
    if _OTHER in names:  # a part of what is asked for can only be offered in a question
        names, probability = names - {_OTHER}, min(probability, LIKELY)
    plain = in_figures(_LAST_BIT.sub(" last bit", straight_quotes))
    slides = around is not None and around.slides_out
    shared = kind == "turn" or (kind == "open" and not slides)  # how far may be said as a share of a right angle
    slots = _slots(plain, shared, vocabulary) | {"place": beside}
    half = _TO_ANGLE in names and kind == "open" and slides and re.search(_HALF, plain) is not None  # of its way
    names = names - HOW_FAR - {_TO_ANGLE} if half else _how_far(names, plain, bool(slots["angle"]), asked)
    if kind == "place" and len(names) > 1:
        names -= {_ALL_THE_WAY}  # "right to the back": what is put down goes to its place anyway
    screws = around is not None and not around.may_swing
    kinds = ({"close": "screw on", "open": "screw off"}.get(kind, kind) if screws else kind, kind)
    said = ["Go half as far."] if half else []
    said = list(dict.fromkeys([*said, *(_said(name, *kinds) for name in sorted(names))]))
    if not (said and all(said)) or _IN_THINGS.search(plain) or not _each_number_has_its_place(plain, said):
        return None
    if not slots["part"] and any("{part}" in text for text in said):
        return None
    if sum("{amount}" in text for text in said) > 1:
        slots["amount"] = ""
    text = " ".join(re.sub(r" +", " ", text.format(**slots)).replace(" .", ".") for text in said)
    return Gist(text, probability, about_plans, asked.evidence)


def _how_far(names: frozenset[str], plain: str, angle: bool, asked: Asked) -> frozenset[str]:
    """Of an angle and "further" that which says better how far. ``angle``: whether one is named."""
    if "further" in names and re.search(r"\bto (?:about |around )?[\d.]+ degrees\b", plain):
        names |= {_TO_ANGLE}
    if _TO_ANGLE not in names:
        return names
    if angle:
        return names - HOW_FAR
    return names - {_TO_ANGLE} | {name for name in HOW_FAR if asked.likely.get(name, 0.0) > 0.5}


def _each_number_has_its_place(plain: str, said: list[str]) -> bool:
    """Whether it is clear which of the requests each number of a remark belongs to."""
    for slots, unit in _UNITS.items():
        found = re.findall(rf"\d {unit}\b", plain)
        if len(found) > 1 or (found and sum(slot in text for slot in slots.split() for text in said) != 1):
            return False
    units = "|".join(_UNITS.values())
    return re.search(r"\d", re.sub(rf"[\d.]+ (?:{units}|(?:more )?times)\b", "", plain)) is None


def _slots(plain: str, shared: bool, vocabulary: Vocabulary) -> dict[str, str]:
    amount, angle, seconds = vocabulary.amount(plain), vocabulary.angle(plain), vocabulary.seconds(plain)
    if angle is None and shared:
        angle = next((degrees for share, degrees in _SHARES.items() if re.search(share, plain)), None)
    more = re.search(r"\bmore times\b|\banother \w+ times\b", plain) is not None  # than the once that it was done
    part, turned = _PART.search(plain), f"by {angle:g} degrees" if angle is not None else ""
    return {
        "amount": amount.words if amount else "",
        "gap": amount.words if amount and amount.exact else "3 cm",
        "angle": turned,
        "turn": turned or f"by {next(angle for said, angle in _TURNS.items() if re.search(said, plain))} degrees",
        "seconds": f"{seconds:g} seconds" if seconds is not None else "a moment",
        "count": str(vocabulary.count(plain) + more),
        "part": part.group() if part else "",
        "pull": "Grip" if re.search(r"\b(?:grip|grab|hold|squeez|slip|slid)", plain) else "Pull",
    }


def _said(name: str, *kinds: str) -> str:
    """How a request is said of a subtask of the first of these kinds that it can be said of."""
    said = _sentences().get(name, "")
    if isinstance(said, str):
        return said
    return next((str(said[kind]) for kind in (*kinds, "any") if kind in said), "")


def plain_requests(kind: str) -> dict[str, str]:
    """How each request that can be made of such a subtask is said, by its name, with amounts for an example."""
    example = {"amount": "2 cm", "gap": "2 cm", "angle": "by 45 degrees", "turn": "by 45 degrees"}
    example |= {"seconds": "2 seconds", "count": "3", "part": "button", "place": "mug", "pull": "Pull"}
    return {name: said.format(**example) for name in _sentences() if (said := _said(name, kind))}


@cache
def _sentences() -> Mapping[str, str | Mapping[str, str]]:
    return read_yaml("", "gist.yaml", "llm.vocabulary")
