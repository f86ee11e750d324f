"""Which names of ``gist.yaml`` a remark asks for: those that were learnt, mended by what it says in so many words.

A classifier sees which words stand in a remark, and little of how they belong together. What has one meaning only in
such words is read here: which side was too far, what is not wanted, what is about an earlier step.
"""

from __future__ import annotations

import re
from collections.abc import Mapping

from memo_llm.offline.learnt import SIDES, SIDEWAYS, Asked
from memo_llm.offline.surroundings import Surroundings

SEVERAL = 0.5  # what is left of a probability where more than one thing is asked for, and it is below the next
SURE_OF_SEVERAL = 0.7
DOUBT = 0.6  # what is left of a probability where two names exclude each other
PLAN = "plan"
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
_PLACES = SIDEWAYS | {"higher", "lower"}
_BELONGS = re.compile(r"\b(?:go|goes|belongs?|lives?) on the (?:left|right)\b")
_LIFTED = re.compile(r"\blift\w*|\brais(?:e|ed|ing)\b|\bpicked (?:it )?up\b|\boff the (?:table|counter|floor|shelf)\b")
_TAKEN = re.compile(
    r"\b(?:take|took|taken|taking|get|got|getting) (?:a )?hold\b|\bpicked (?:it )?up\b|\bgr(?:ab|ip|asp)\w*"
)
_DEEPER = re.compile(r"\bdeep(?:er)?\b|\b(?:further|farther|right) (?:in|down)\b(?!.*\bback\b)")
_DROPPED = re.compile(r"\bdrop (?:it|them|that)\b|\blet (?:it|them|that) (?:fall|drop)\b")
_TO_SIDE = re.compile(  # a side that is asked for
    r"\b(?:more|bit|little|further|farther|over|shift|move|go|come|nudge|slide)\b"
    r"(?: (?:it|them|that|a bit|a little|over|more|further|farther))* (?:to|towards) (?:the|your) (left|right)\b"
)
_TOUCHED = re.compile(  # a side on which something touches what it should not, or sticks out
    r"\b(?:stick\w* out|overhang\w*|hang\w*|past (?:it|them)|clipp\w*|bump\w*|brush\w*|hit|caught|catch\w*|scrap\w*|"
    r"lean\w*)\b"
    r"[^.!?,;]*\bon (?:the|your) (left|right)\b"
)
HOW_FAR = frozenset(["further", "less-far", "all-the-way"])
_COUNTED = frozenset(["shake", "repeat"])
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


def asked_names(words: str, asked: Asked, kind: str, around: Surroundings | None) -> tuple[frozenset[str], float]:
    """The names that a remark about such a subtask asks for, and how likely it is just these; none where what is meant
    cannot be said of it, or is the contrary of what was learnt."""
    plain = words.lower()
    names = _sides_as_said(_as_the_subtask_says(asked.names, plain, kind, around), plain, kind)
    if any(re.search(_FAULTS[name], plain) for name in names & _FAULTS.keys()):
        return frozenset(), 0.0
    if names & _COUNTED:
        names -= HOW_FAR  # how often says how much
    likeliest = _without_rivals(names, asked.likely)
    probability = asked.probability * (1.0 if likeliest == names else DOUBT)
    if len(likeliest - {PLAN}) > 1 and probability < SURE_OF_SEVERAL:
        probability *= SEVERAL
    return likeliest, probability


def is_of_the_grip(words: str, kind: str) -> bool:
    """Whether a remark made while something was put down or poured may be about how it was picked up."""
    return kind in ("place", "pour") and _TAKEN.search(words.lower()) is not None


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
    if kind == "place" and names <= SIDES and _BELONGS.search(plain):
        return frozenset([PLAN])  # "forks go on the left": of what, the planner sees
    if kind == "pick" and "higher" in names and _LIFTED.search(plain):
        return names - {"higher"} | {"carry-higher"}
    if kind == "place" and "away" in names and around is not None and around.goal_is_deep and _DEEPER.search(plain):
        return names - {"away"} | {"lower"}
    return names


def _sides_as_said(names: frozenset[str], plain: str, kind: str) -> frozenset[str]:
    """With the side that is asked for in so many words for "left" and "right", or the one opposite to the fault."""
    if not names & (SIDES | {"line-up"}):
        return names
    faults = {side for side in SIDES if re.search(_FAULTS[side], plain)}
    wished = {match.group(1) for match in _TO_SIDE.finditer(plain)} - faults
    if len(wished) == 1:
        return names - SIDES | wished
    if not faults and kind in ("pick", "place"):
        faults = {match.group(1) for match in _TOUCHED.finditer(plain)}
    return names - SIDES | (SIDES - faults) if len(faults) == 1 else names


def _without_rivals(names: frozenset[str], likely: Mapping[str, float]) -> frozenset[str]:
    """Of names that exclude each other the likeliest only."""
    for rivals in _RIVALS:
        there = sorted(names & set(rivals), key=likely.__getitem__)
        names -= set(there[:-1])
    return names
