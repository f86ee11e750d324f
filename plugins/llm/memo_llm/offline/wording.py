"""How a note says an edit, and a person's sentence, in plain words."""

from __future__ import annotations

import re

from memo_llm.offline.edits import GENTLE, Edit
from memo_llm.offline.recipe import Recipe
from memo_llm.offline.relative import Attempted, than_that

ONLY_WAY = re.compile(r"(?:(?:go|move|push|try|just) )*(?:up|down)(?:wards?)?")  # no more than up or down
_FILLERS = re.compile(
    r"^(?:(?:no(?=[,!.]| no\b)|well|hm+|hey|ok(?:ay)?|please|and|so|but|then)[, ]+)+|[, ]+(?:please|ok(?:ay)?)$", re.I
)
_MUST = re.compile(
    r"^(?:you(?:'ve| have)? (?:got to|have to|need to|must|should|can|could|to)|you'd better|try to|i want you to) ",
    re.I,
)
_LINK = {
    "left": "to the left",
    "right": "to the right",
    "up": "higher",
    "down": "lower",
    "out": "towards the robot",
    "towards": "nearer to yourself",
    "away": "farther away",
}


def said_plainly(edit: Edit, recipe: Recipe | None, attempt: Attempted | None) -> str:
    """The edit in plain words, amounts as the person named them."""
    if edit.phrase is None or not edit.phrase.say:
        return ""
    if edit.kind == "less-far" and not edit.amount and "half as far" in edit.said:
        return "Go half as far."
    amount = edit.amount.words if edit.amount else ""
    angle = f"{edit.degrees:g} degrees" if edit.degrees is not None else ""
    seconds = f"{edit.seconds:g} seconds" if edit.seconds is not None else "a while"
    times = f"{edit.count} times"
    value = _LINK.get(edit.value, edit.value) if edit.kind == "offset" else edit.value
    if edit.kind == "way":
        value = {"towards": "towards yourself", "away": "away from yourself"}.get(value, value)
    if value == "side approach":
        value = "the side"
    if edit.kind == "pivot":
        value = {"up": "top", "down": "bottom"}.get(value, value)
    lifted = edit.kind == "offset" and edit.value in ("up", "down") and edit.said.startswith(("lift", "raise", "carry"))
    say = "Lift it {amount} {value}." if lifted else edit.phrase.say
    if edit.kind == "first-up" and recipe is not None and recipe.kind == "pull":
        say = say.replace("the handle", "it")
    if edit.kind == "straight" and recipe is not None and recipe.kind in ("close", "push"):
        say = "Push it straight, in one line."
    if edit.verb:
        hard = "hard" if edit.negated else "harder"
        say = f"{edit.verb.capitalize()} {'less hard' if edit.value in GENTLE else hard}."
    text = say.format(value=value, amount=amount, angle=angle, seconds=seconds, times=times)
    text = (
        re.sub(r"\s+(?=[.,])", "", " ".join(text.split()))
        .replace(" by.", ".")
        .replace(" from.", " from another side.")
        .replace(", away.", ".")
    )
    if edit.kind == "turn-hand" and edit.value:
        text = text.removesuffix(".") + f" {edit.value}."
    if edit.negated:
        text = "Do not " + text[0].lower() + text[1:]
    elif recipe is not None and attempt is not None and (than := than_that(edit, recipe, attempt)):
        if than.startswith(" than") and edit.kind == "offset" and text.endswith(("to the left.", "to the right.")):
            text = text.replace(" to the ", " further to the ").replace(" more further", " further")
        text = text.removesuffix(".") + than + "."
    return text


def sentence_plainly(sentence: str) -> str:
    text = " ".join(sentence.split()).strip(" .!?,")
    text = _MUST.sub("", _FILLERS.sub("", text)) or text
    text = re.sub(r"[\[(]\s*-?\d[^\])]*[\])]", "there", text)  # coordinates hold only for one scene
    return (text[0].upper() + text[1:] + ".")[:380] if text else ""
