"""What has to be asked before anything is noted of a person's words."""

from __future__ import annotations

import re
from collections.abc import Iterable

from memo_llm.offline.edits import GENTLE, Edit, Reading
from memo_llm.offline.recipe import Recipe
from memo_llm.offline.vocabulary import Vocabulary
from memo_llm.offline.wording import ONLY_WAY, said_plainly

# Said of a motion it is slowly, of a grip with less force.
_GENTLY = r"(?:gent(?:ly|le|ler)|soft(?:ly)?|careful(?:ly)?|easy)\b"
_GRIPS = r"grip|grab|grasp|hold|squeez|fingers"
# What the other way is the other way of, where something is pulled.
_WAY_ROUND = re.compile(
    r"\b(?:a?round|about|swing\w*|direction|turn\w*|hinges?|arc|curve|side|edge|shut|clos\w+|tighten\w*|loos\w+)\b"
)
# "Only halfway": a wish, unless somebody tells what it did ("it's only half open").
_PARTLY = r"half|a quarter|a third|a little|a bit|a crack|slightly|a touch"
_ONLY_PARTLY = re.compile(rf"(?:only|just)(?: \w+){{0,3}}? (?:{_PARTLY})(?! (?:more|further))")
_TOLD_PARTLY = re.compile(
    r"(?:(?:\w+'s|is|was|are|were|still|got|came|went|moved|stands?|opened|turned|pulled|pushed|closed|stopped)"
    r"(?: (?:it|that|them|the \w+))?|^(?:it|that|this|they|you|the \w+)) $"
)
_PRESSED_PART = re.compile(r"\b(?:button|switch|lever|pedal|tab|trigger|catch|thing (?:\w+ )?there)\b")
_SHAKEN_OFF = re.compile(r"\bshake (?:the|your) hand\b|\b(?:stuck|stick(?:s|ing)|cling(?:s|ing))\b")
_UP_AND_BACK = re.compile(r"\bup(?:wards?)?,? (?:and|then)(?: then)? back(?:wards?)?\b")
# Praise with one of these is praise with a reservation.
_RESERVED = re.compile(
    r"\b(?:but|just|only|except|though|however|next|could|should|would|now|still|more|less|too|not|bit|little)\b"
)
_SURFACES = frozenset(
    ["table", "counter", "desk", "worktop", "board", "tray", "plate", "mat"]
)  # where "in" is no one way
# What may be said of each kind of subtask, for who does not know what can be understood; "": of others.
OFFERS = {
    "open": "pull it in an arc; pull it straight; open it further; push it in first; hold the handle lower",
    "close": "push it in an arc; push it further; push it harder; more slowly",
    "pick": "hold it at the top; 2 cm lower; come from the front; turn the hand by 90 degrees; grip it more gently; "
    "lift it higher; more slowly",
    "place": "3 cm to the left; 2 cm lower; in the middle; turn the hand by 90 degrees; put it down upright; "
    "let go slowly; carry it higher",
    "push": "press harder; 2 cm lower; press twice; hold it for two seconds",
    "pull": "pull it in an arc; pull it straight; further; push it in first; grip harder",
    "turn": "further; half a turn; clockwise; press it down while you turn; grip harder",
    "pour": "tip it further; tip it less far; tip it slowly; 5 cm higher; 2 cm to the left; shake it twice",
    "wipe": "press harder; press less hard; go round in circles; go round the edge as well; "
    "wipe from the edge to the middle",
    "stir": "go round the edge as well; go lower; more slowly; 2 cm to the left",
    "": "more slowly; 2 cm lower; 3 cm to the left; do it again",
}
OF_DOORS = frozenset({"arc", "pivot", "follow-hand"})
_OF_ANY_MOTION = frozenset({"offset", "speed", "force", "repeat"})


def which_is_meant(
    words: str, edits: list[Edit], recipe: Recipe | None, vocabulary: Vocabulary, doors: bool = True
) -> str:
    """What has to be asked because that which was read can be meant in more than one way; "" where it cannot."""
    if not edits:
        return ""
    quoted = " ".join(words.split())[:200]
    understood = _plainly(edits)
    if recipe is not None and recipe.kind == "pick" and any(edit.kind == "hold-for" for edit in edits):
        return f"wait when: once it is held, or before it is let go? You said: {quoted}"
    if (
        recipe is not None
        and recipe.kind == "pour"
        and any(edit.kind == "force" and not re.search(_GRIPS, edit.said) for edit in edits)
    ):
        return f"is it to be gripped, or shaken, that way: {understood} You said: {quoted}"
    bare = [edit for edit in edits if edit.kind == "offset" and edit.said.strip() in ("up", "down")]
    if bare and recipe is not None and recipe.kind in ("push", "open", "close", "pull"):
        return f"push that way, or push at another place: {understood} You said: {quoted}"
    if any(edit.kind == "hold-on" for edit in edits) and re.search(r"\bwh(?:ile|ilst|en) you\b", words.lower()):
        return f"is something else to be held meanwhile? You said: {quoted}"
    easy = all(edit.kind == "speed" and re.match(r"easy\b", edit.said.strip()) for edit in edits)
    gently = any(edit.kind == "force" and re.match(_GENTLY, edit.said.strip()) for edit in edits)
    if (recipe is None and gently) or (recipe is not None and recipe.kind == "pick" and easy):
        return f"is it to be done more slowly, or with less force? You said: {quoted}"
    if (
        recipe is not None
        and recipe.kind == "turn"
        and any(edit.kind == "force" and edit.value in GENTLE and re.search(r"\btight", edit.said) for edit in edits)
    ):
        return f"is it to be gripped less tightly, or turned less far? You said: {quoted}"
    if any(edit.kind == "offset" and edit.value == "out" for edit in edits):
        return f"is back away from the robot, or towards it? You said: {quoted}"
    turned = [edit for edit in edits if edit.kind == "reverse"]
    if turned and recipe is not None and recipe.kind not in ("open", "close", "pull", "turn"):
        return f"which way should the hand go? You said: {quoted}"
    if turned and recipe is not None and recipe.kind != "turn" and not _WAY_ROUND.search(words.lower()):
        return f"the other way round, or to another side? You said: {quoted}"
    inside = [edit for edit in edits if edit.kind == "offset" and edit.value == "away"]
    flat = recipe is not None and (recipe.kind == "pick" or (recipe.kind == "place" and recipe.place in _SURFACES))
    if flat and any(re.search(r"\b(?:in|inside)\b", edit.said) for edit in inside):
        return f"further in to which side, seen from the robot? You said: {quoted}"
    doubtful_way = any(edit.kind == "way" for edit in edits) and "instead of turning" not in words
    if recipe is not None and recipe.kind == "turn" and doubtful_way:
        return f"is it to be led that way, or turned, and then which way round? You said: {quoted}"
    if (
        recipe is not None
        and recipe.kind == "place"
        and any(edit.kind == "hold-on" and not edit.negated for edit in edits)
    ):
        return f"is it not to be let go at all, or when? You said: {quoted}"
    if recipe is not None and recipe.kind == "pour" and any(edit.kind == "tilt" and edit.value for edit in edits):
        return f"is that how far it is tipped, or how it is brought back? You said: {quoted}"
    if recipe is not None and recipe.kind in ("pick", "place") and any(edit.kind == "angle" for edit in edits):
        return f"what is to be turned that far, and about which axis? You said: {quoted}"
    aside = [
        edit
        for edit in edits
        if edit.kind == "offset" and (edit.value in ("left", "right") or ONLY_WAY.fullmatch(edit.said.strip()))
    ]
    if aside and recipe is not None and recipe.kind == "turn" and not any(e.amount and e.amount.exact for e in aside):
        way = said_plainly(aside[0], None, None)
        return f"is that clockwise or counterclockwise, as the hand looks at it: {way} You said: {quoted}"
    swung = [edit for edit in edits if edit.kind in OF_DOORS]
    led = [edit for edit in edits if edit.kind in ("straight", "way")]
    if led and recipe is not None and recipe.kind == "place":
        way = said_plainly(led[0], None, None)
        return f"where to, and how far: {way} What is put down is led nowhere. You said: {quoted}"
    if swung and recipe is not None and recipe.kind in ("pick", "place"):
        return f"what is to be turned, and how? {_offered(recipe)} You said: {quoted}"
    if swung and recipe is not None and (recipe.kind not in ("open", "close", "pull") or not doors):
        return f"which way should the hand go? {said_plainly(swung[0], None, None)} This is no door. You said: {quoted}"
    if recipe is not None and recipe.kind in ("pick", "place") and {"offset", "less-far"} <= {e.kind for e in edits}:
        return f"how far, and which way: {understood} You said: {quoted}"
    hand = recipe is not None and recipe.kind == "place" and _SHAKEN_OFF.search(words.lower())
    if recipe is not None and recipe.kind != "pour" and not hand and any(edit.kind == "shake" for edit in edits):
        return f"what is to be shaken, and why? You said: {quoted}"
    longer = [edit for edit in edits if edit.kind in ("farther", "all-the-way")]
    if longer and _wishes_part(words):
        return f"only so far, or is it to go further than that? You said: {quoted}"
    if any(edit.kind == "first-in" and _PRESSED_PART.search(edit.said) for edit in edits):
        return f"what is to be pressed, and where is it? You said: {quoted}"
    if _UP_AND_BACK.search(words.lower()) and any(edit.value == "towards" for edit in edits):
        return f"is back away from the robot, or towards it? You said: {quoted}"
    pressed = any(edit.kind == "press-part" for edit in edits)
    if pressed and any(edit.kind in ("hold-at", "offset") and not edit.negated for edit in edits):
        return f"what is to be pressed, and where is it? You said: {quoted}"
    if pressed and (besides := [edit for edit in edits if edit.kind in ("release", "all-the-way", "farther", "way")]):
        return f"is this before or after pressing: {said_plainly(besides[0], None, None)} You said: {quoted}"
    drawn = [
        edit for edit in edits if edit.kind == "farther" and re.search(r"\b(?:pull|open|draw|tug)\w*\b", edit.said)
    ]
    if drawn and recipe is not None and recipe.kind in ("pick", "place"):
        return f"what is to be opened further, and is that a step of its own? You said: {quoted}"
    slid = [edit for edit in edits if edit.kind == "straight" and "handle" in said_plainly(edit, None, None)]
    if slid and recipe is not None and recipe.kind not in ("open", "close", "pull", "push"):
        return f"which way should the hand go? You said: {quoted}"
    opposed = _opposed(edits, vocabulary)
    if opposed:
        return f"which of the two is meant: {opposed}? You said: {quoted}"
    return ""


def what_is_missing(
    words: str,
    readings: Iterable[Reading],
    edits: list[Edit],
    recipe: Recipe | None,
    effective: bool,
    vocabulary: Vocabulary,
) -> str:
    """What has to be asked because nothing was read, or not all of it, or nothing would follow; "" else."""
    quoted = " ".join(words.split())[:200]
    readings = list(readings)
    if not edits:
        wishes = [
            part
            for reading in readings
            for part in reading.unsure
            if not vocabulary.praises(part) and vocabulary.lexicon.asks(part)
        ]
        if vocabulary.praises(words) and not wishes:
            return f"that sounds as if it was right as it was; was it? You said: {quoted}"
        return f"what should be different? {_offered(recipe)} Not understood: {quoted}"
    understood = _plainly(edits)
    if any(reading.praised for reading in readings) and not _RESERVED.search(words.lower()):
        return f"was it right as it was, or is this meant: {understood} You said: {quoted}"
    unsure = [part for reading in readings for part in reading.unsure]
    if unsure:
        return f"is this what you mean: {understood} It is not clear what this adds: {'; '.join(unsure)}"
    if recipe is None and not all(edit.kind in _OF_ANY_MOTION for edit in edits):
        return f"I do not know this action; which way should the hand move for: {understood} You said: {quoted}"
    if not effective and recipe is not None:
        return f"how would one do that here: {understood} Which way should the hand move? You said: {quoted}"
    return ""


def _plainly(edits: Iterable[Edit]) -> str:
    return " ".join(dict.fromkeys(said for edit in edits if (said := said_plainly(edit, None, None))))


def _offered(recipe: Recipe | None) -> str:
    offers = OFFERS.get("" if recipe is None else recipe.kind, OFFERS[""])
    return f"One can say, for example: {offers}; or what has to be done first, or with what else."


def _wishes_part(words: str) -> bool:
    """Whether somebody says "only halfway" without telling what happened."""
    plain = words.lower()
    found = _ONLY_PARTLY.search(plain)
    return found is not None and _TOLD_PARTLY.search(re.split(r"[.;,!?]\s*", plain[: found.start()])[-1]) is None


def _opposed(edits: list[Edit], vocabulary: Vocabulary) -> str:
    """Two edits that cannot both be meant, in words; "" where there are none."""
    for i, one in enumerate(edits):
        for other in edits[i + 1 :]:
            if one.kind != other.kind or one.negated or other.negated:
                continue
            opposite = vocabulary.opposites.get(one.value) == other.value != ""
            if opposite and one.kind in ("offset", "force", "speed", "pivot", "turn-thing"):
                return f"{said_plainly(one, None, None)} {said_plainly(other, None, None)}"
    return ""
