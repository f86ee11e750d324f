"""What a remark comes down to, said in words that are surely read.

The rules read a sentence word by word and ask where a word is left over. Where they do, what was learnt from many
sentences (``learnt.py``) may still tell what is asked for; ``gist.yaml`` says it in plain words, with the amounts that
the person named.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache

import attrs

from memo_llm.offline.learnt import Learnt
from memo_llm.offline.spelling import in_figures
from memo_llm.offline.vocabulary import Vocabulary, read_yaml

LIKELY = 0.3  # probability from which on it is worth asking whether that is meant
_PLAN = "plan"
# What was said to be too much of, which nobody asks for more of.
_FAULTS = {
    "left": r"\b(?:off|too far|drift\w*|veer\w*)\b[^.!?]*\bleft\b",
    "right": r"\b(?:off|too far|drift\w*|veer\w*)\b[^.!?]*\bright\b",
    "higher": r"\btoo high\b",
    "lower": r"\btoo low\b",
    "faster": r"\btoo (?:fast|quick)\w*",
    "slower": r"\btoo slow\w*",
    "firmer": r"\btoo (?:hard|tight|firm)\w*",
    "gentler": r"\btoo (?:loose|gent|soft)\w*",
}
_EXCEPTION = re.compile(r"\b(?:unless|except)\b|^(?:what|why|who|how)\b[^.!]*\?\s*$")  # or nothing but a question
_PART = re.compile(r"\b(?:button|switch|pedal|key)\b")
_LENGTH = "(?:cm|mm|inch|m)"
_UNITS = {"{amount} {gap}": _LENGTH, "{angle}": "degrees", "{seconds}": "seconds"}


@attrs.frozen
class Gist:
    """``text`` says all that is asked for; "" where that is about the plan."""

    text: str
    probability: float
    about_plans: bool = False


def gist_of(
    words: str, objects: Sequence[str], kind: str, vocabulary: Vocabulary, screwed: bool = False
) -> Gist | None:
    """What a remark about a subtask of this kind, with these objects, is likely to come down to; None where that cannot
    be told, or cannot be said of such a subtask. ``screwed``: whether what is opened or closed has no door."""
    names, probability = Learnt.load().asked_for(words, objects, kind)
    if not names or probability < LIKELY or _EXCEPTION.search(words.lower()):
        return None
    if any(re.search(_FAULTS[name], words.lower()) for name in names & _FAULTS.keys()):
        return None
    if names == {_PLAN}:
        return Gist("", probability, about_plans=True)
    kinds = ({"close": "screw on", "open": "screw off"}.get(kind, kind) if screwed else kind, kind)
    said = [next(filter(None, (_said(name, one) for one in kinds)), "") for name in sorted(names)]
    if not all(said):
        return None
    plain = in_figures(" ".join(words.lower().replace("’", "'").split()))
    if not _each_number_has_its_place(plain, said):
        return None
    slots = _slots(plain, vocabulary) | {"place": objects[1] if len(objects) > 1 else ""}
    if not all(slots[name] for name in ("turn", "part") if any(f"{{{name}}}" in text for text in said)):
        return None
    if sum("{amount}" in text for text in said) > 1:
        slots["amount"] = ""
    text = " ".join(re.sub(r" +", " ", text.format(**slots)).replace(" .", ".") for text in said)
    return Gist(text, probability)


def is_no_plan(words: str, objects: Iterable[str], kind: str) -> bool:
    """Whether a remark more likely asks for something that no plan could change."""
    names, probability = Learnt.load().asked_for(words, objects, kind)
    return bool(names) and _PLAN not in names and probability >= 0.5


def _each_number_has_its_place(plain: str, said: list[str]) -> bool:
    """Whether it is clear which of the requests each number of a remark belongs to."""
    for slots, unit in _UNITS.items():
        found = re.findall(rf"\d {unit}\b", plain)
        if len(found) > 1 or (found and sum(slot in text for slot in slots.split() for text in said) != 1):
            return False
    units = "|".join(_UNITS.values())
    return re.search(r"\d", re.sub(rf"[\d.]+ (?:{units}|(?:more )?times)\b", "", plain)) is None


def _slots(plain: str, vocabulary: Vocabulary) -> dict[str, str]:
    amount, angle, seconds = vocabulary.amount(plain), vocabulary.angle(plain), vocabulary.seconds(plain)
    part, turned = _PART.search(plain), f"by {angle:g} degrees" if angle is not None else ""
    return {
        "amount": amount.words if amount else "",
        "gap": amount.words if amount and amount.exact else "3 cm",
        "angle": turned,
        "turn": turned or ("by 45 degrees" if re.search(r"\bcorners?\b", plain) else ""),
        "seconds": f"{seconds:g} seconds" if seconds is not None else "a moment",
        "count": str(vocabulary.count(plain)),
        "part": part.group() if part else "",
        "pull": "Grip" if re.search(r"\b(?:grip|grab|hold|squeez|slip|slid)", plain) else "Pull",
    }


def _said(name: str, kind: str) -> str:
    said = _sentences().get(name, "")
    return said if isinstance(said, str) else str(said.get(kind, ""))


def plain_requests(kind: str) -> dict[str, str]:
    """How each request that can be made of such a subtask is said, by its name, with amounts for an example."""
    example = {"amount": "2 cm", "gap": "2 cm", "angle": "by 45 degrees", "turn": "by 45 degrees"}
    example |= {"seconds": "2 seconds", "count": "3", "part": "button", "place": "mug", "pull": "Pull"}
    return {name: said.format(**example) for name in _sentences() if (said := _said(name, kind))}


@cache
def _sentences() -> Mapping[str, str | Mapping[str, str]]:
    return read_yaml("", "gist.yaml", "llm.vocabulary")
