"""What a remark comes down to, said in words that are surely read.

The rules read a sentence word by word and ask where a word is left over. Beside them, what was learnt from many
sentences (``learnt.py``) tells what a remark as a whole asks for; ``gist.yaml`` says it in plain words, with the
amounts that the person named. ``hearing.hear`` decides which of the two is followed.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache

import attrs

from memo_llm.offline.learnt import Learnt
from memo_llm.offline.spelling import in_figures
from memo_llm.offline.surroundings import Surroundings
from memo_llm.offline.vocabulary import Vocabulary, read_yaml

SEVERAL = 0.5  # what is left of a probability where more than one thing is asked for, and it is below the next
SURE_OF_SEVERAL = 0.7
DOUBT = 0.6  # what is left of a probability where two names exclude each other
FEWEST = 3  # words of which a gist can be told
EVIDENT = 0.08  # probability of its likeliest name by itself, below which nothing speaks for a gist
LIKELY = 0.3  # probability from which on it is worth asking whether that is meant
_PLAN, _OTHER, _NOTHING = "plan", "other", "nothing"
_NOT = r"(?:\b(?:not|no|never|stop|without|instead of)\b|n't\b)"
# What was said to be too much of, which nobody asks for more of.
_FAULTS = {
    "left": r"\b(?:off|too far|drift\w*|veer\w*)\b[^.!?]*\bleft\b",
    "right": r"\b(?:off|too far|drift\w*|veer\w*)\b[^.!?]*\bright\b",
    "higher": r"\b(?:too|so) high\b|\bmiles? (?:up|above)\b|\bfrom (?:so|that|way) (?:far |high )?up\b",
    "lower": r"\btoo (?:low|deep|far down)\b|\b(?:went|gone|go|came|come) down (?:\w+ )?too (?:far|much)\b",
    "faster": r"\btoo (?:fast|quick)\w*|\bquiet\w*",
    "slower": r"\b(?:too|so|that) slow\b|\btoo slowly\b|\ball the speed\b",
    "nearer": r"\b(?:to|towards?|for) (?:me|us|my)\b",  # where the person is, is not known
    "away": r"^(?!.*\bforwards?\b).*\b(?:from|of) (?:me|us|my)\b",
    "from-side": r"\bother side\b",  # which one, is not known
    "circles": rf"{_NOT}(?: \w+){{0,2}} circl\w+",
    "arc": rf"{_NOT}(?: \w+){{0,3}} (?:swing\w*|arcs?|curv\w+|circl\w+|hinges?)\b",
    "straight": rf"{_NOT}(?: \w+){{0,3}} straight\b",
    "less-far": r"^stop \w+ing\b(?!.*\b(?:far|much|earlier|sooner|wide)\b)",  # in that way
    "to-angle": r"\byou(?:'ve| have)?(?: only| just)? (?:\w+ed|did|got|went|left)\b[^.!?]*\bhalf",  # so far it went
    "firmer": r"\btoo (?:hard|tight|firm)\w*",
    "gentler": r"\btoo (?:loose|gent|soft)\w*|(?:n't|not|no need to)(?: \w+){0,3} (?:so|that|too) (?:gentle|careful)",
}
_PLACES = frozenset(["higher", "lower", "left", "right", "nearer", "away"])
_BELONGS = re.compile(r"\b(?:go|goes|belongs?|lives?) on the (?:left|right)\b")
_LIFTED = re.compile(r"\blift\w*|\brais(?:e|ed|ing)\b|\bpicked (?:it )?up\b|\boff the (?:table|counter|floor|shelf)\b")
_TAKEN = re.compile(
    r"\b(?:take|took|taken|taking|get|got|getting) (?:a )?hold\b|\bpicked (?:it )?up\b|\bgr(?:ab|ip|asp)\w*"
)
_DEEPER = re.compile(r"\bdeep(?:er)?\b|\b(?:further|farther|right) (?:in|down)\b(?!.*\bback\b)")
_DROPPED = re.compile(r"\bdrop (?:it|them|that)\b|\blet (?:it|them|that) (?:fall|drop)\b")
_IN_THINGS = re.compile(r"\bby (?:about |around |roughly )?half an? \w+")  # how far, measured in something
_TO_SIDE = re.compile(  # a side that is asked for
    r"\b(?:more|bit|little|further|farther|over|shift|move|go|come|nudge|slide)\b"
    r"(?: (?:it|them|that|a bit|a little|over|more|further|farther))* (?:to|towards) (?:the|your) (left|right)\b"
)
_TOUCHED = re.compile(  # a side on which something touches what it should not, or sticks out
    r"\b(?:stick\w* out|overhang\w*|hang\w*|past (?:it|them)|clipp\w*|bump\w*|brush\w*|hit|caught|catch\w*|scrap\w*|"
    r"lean\w*)\b"
    r"[^.!?,;]*\bon (?:the|your) (left|right)\b"
)
_TO_ANGLE, _ALL_THE_WAY = "to-angle", "all-the-way"
_HOW_FAR = frozenset(["further", "less-far", _ALL_THE_WAY])
_COUNTED = frozenset(["shake", "repeat"])
_SHARES = {r"\b(?:past|beyond|more than|over) half": 60.0, r"\bhalf\b|\bhalf-?way\b": 45.0, r"\ba third\b": 30.0}
_TURNS = {
    r"\bcorners?\b|\bpoint(?:y|s)\b|\bdiagonal\w*": 45,
    r"\b(?:a bit|a little|slightly|a touch|a tad|somewhat)\b": 30,
    "": 90,
}  # of the hand
_LAST_BIT = re.compile(  # which is no amount to go
    r"\blast (?:few|couple of|\w+) (?:cm|mm|centimet\w+|inch\w*)\b|"
    r"\b(?<=still open) (?:by |about |around |maybe )*(?:an?|one|two|three|four|[\d.]+) (?:cm|mm|centimet\w+|inch\w*)\b"
)
_RIVALS = (  # of which one remark means only one, and names the other for contrast
    ["left", "right"],
    ["higher", "lower"],
    ["nearer", "away"],
    ["slower", "faster"],
    ["gentler", "firmer"],
    ["further", "less-far"],
    ["clockwise", "counterclockwise"],
    ["hold-on", "release-now"],
    ["open-wider", "open-less"],
    ["upright", "lay-flat", "upside-down"],
    ["circles", "gather", "straight"],
    ["arc", "straight"],
    ["way-push", "way-pull", "way-lift", "way-down", "way-left", "way-right", "way-turn"],
    ["shake", "repeat"],
    ["at-middle", "at-top", "at-bottom", "at-rim", "at-neck", "at-handle"],
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
    objects: Sequence[str],
    kind: str,
    vocabulary: Vocabulary,
    around: Surroundings | None = None,
    beside: str = "",
) -> Gist | None:
    """What a remark about a subtask of this kind, with these objects, is likely to come down to; None where that cannot
    be told, or cannot be said of such a subtask. ``beside``: the thing, if any, that what is put down goes beside."""
    asked = Learnt.load().asked_for(words, objects, kind)
    names, probability = asked.names, asked.probability
    evidence = max(asked.likely[name] for name in names)
    if len(words.split()) < FEWEST or probability < LIKELY or evidence < EVIDENT or _EXCEPTION.search(words.lower()):
        return None
    slides = around is not None and around.slides_out
    names = _as_the_subtask_says(names, words.lower(), kind, around)
    names = _sides_as_said(names, words.lower(), kind)
    if not names or any(re.search(_FAULTS[name], words.lower()) for name in names & _FAULTS.keys()):
        return None
    if names & _COUNTED:
        names -= _HOW_FAR  # how often says how much
    likeliest = _without_rivals(names, asked.likely)
    names, probability = likeliest, probability * (1.0 if likeliest == names else DOUBT)
    about_plans, names = _PLAN in names, names - {_PLAN}
    if about_plans and not names:
        if _SOMEBODY_ELSE.search(words.lower().replace("’", "'")):
            return None
        return Gist("", probability, about_plans)
    if len(names) > 1 and probability < SURE_OF_SEVERAL:
        probability *= SEVERAL
    if any("{place}" in _said(name, kind) for name in names) and (about_plans or not beside):
        return None  # beside what, is not said
    if _OTHER in names:  # a part of what is asked for can only be offered in a question
        names, probability = names - {_OTHER}, min(probability, LIKELY)
    plain = in_figures(_LAST_BIT.sub(" last bit", " ".join(words.lower().replace("’", "'").split())))
    shared = kind == "turn" or (kind == "open" and not slides)  # how far may be said as a share of a right angle
    slots = _slots(plain, shared, vocabulary) | {"place": beside}
    if "further" in names and re.search(r"\bto (?:about |around )?[\d.]+ degrees\b", plain):
        names |= {_TO_ANGLE}
    half = _TO_ANGLE in names and kind == "open" and slides and re.search(r"\bhalf\b|\bhalf-?way\b", plain) is not None
    if half:  # of its way
        names = names - _HOW_FAR - {_TO_ANGLE}
    elif _TO_ANGLE in names and slots["angle"]:  # it says better how far
        names -= _HOW_FAR
    elif _TO_ANGLE in names:
        names = names - {_TO_ANGLE} | {name for name in _HOW_FAR if asked.likely.get(name, 0.0) > 0.5}
    if not (names or half):
        return None
    if kind == "place" and len(names) > 1:
        names -= {_ALL_THE_WAY}  # "right to the back": what is put down goes to its place anyway
    screws = around is not None and not around.may_swing
    kinds = ({"close": "screw on", "open": "screw off"}.get(kind, kind) if screws else kind, kind)
    said = list(
        dict.fromkeys([*(["Go half as far."] if half else []), *(_said(name, *kinds) for name in sorted(names))])
    )
    if not all(said):
        return None
    if _IN_THINGS.search(plain) or not _each_number_has_its_place(plain, said):
        return None
    if not slots["part"] and any("{part}" in text for text in said):
        return None
    if sum("{amount}" in text for text in said) > 1:
        slots["amount"] = ""
    text = " ".join(re.sub(r" +", " ", text.format(**slots)).replace(" .", ".") for text in said)
    return Gist(text, probability, about_plans, evidence)


def is_of_the_grip(words: str, kind: str) -> bool:
    """Whether a remark made while something was put down or poured may be about how it was picked up."""
    return kind in ("place", "pour") and _TAKEN.search(words.lower()) is not None


def asks_for_nothing(words: str, objects: Sequence[str], kind: str) -> bool:
    """Whether a remark only approves, or complains without saying of what."""
    asked = Learnt.load().asked_for(words, objects, kind)
    return asked.names == {_NOTHING} and asked.probability >= 0.5


def _as_the_subtask_says(names: frozenset[str], plain: str, kind: str, around: Surroundings | None) -> frozenset[str]:
    """The names as they are meant at such a subtask; none where no edit says that, or where they may be about an
    earlier one."""
    if names & _PLACES and is_of_the_grip(plain, kind):
        return frozenset()
    if kind == "pick" and "straight" in names and not re.search(r"\bup(?:wards?)?\b|\blift", plain):
        return frozenset()  # straight out of something, which no edit says of what is picked up
    if kind == "place" and "release-sooner" in names and _DROPPED.search(plain):
        return frozenset()  # from where, is not known
    if kind == "stir" and "gentler" in names and re.search(r"\bpress|\bscra(?:tch|p)", plain):
        return frozenset()  # how hard it presses is not in its hand
    if kind == "place" and names <= {"left", "right"} and _BELONGS.search(plain):
        return frozenset([_PLAN])  # "forks go on the left": of what, the planner sees
    if kind == "pick" and "higher" in names and _LIFTED.search(plain):
        return names - {"higher"} | {"carry-higher"}
    if kind == "place" and "away" in names and around is not None and around.goal_is_deep and _DEEPER.search(plain):
        return names - {"away"} | {"lower"}
    return names


def _sides_as_said(names: frozenset[str], plain: str, kind: str) -> frozenset[str]:
    """With the side that is asked for in so many words for "left" and "right", or the one opposite to the fault."""
    sides = frozenset(["left", "right"])
    if not names & (sides | {"line-up"}):
        return names
    faults = {side for side in sides if re.search(_FAULTS[side], plain)}
    wished = {match.group(1) for match in _TO_SIDE.finditer(plain)} - faults
    if len(wished) == 1:
        return names - sides | wished
    if not faults and kind in ("pick", "place"):
        faults = {match.group(1) for match in _TOUCHED.finditer(plain)}
    return names - sides | (sides - faults) if len(faults) == 1 else names


def _without_rivals(names: frozenset[str], likely: Mapping[str, float]) -> frozenset[str]:
    """Of names that exclude each other the likeliest only."""
    for rivals in _RIVALS:
        there = sorted(names & set(rivals), key=likely.__getitem__)
        names -= set(there[:-1])
    return names


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
