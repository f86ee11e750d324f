"""What the rules read in a remark of one or more sentences."""

from __future__ import annotations

import re
from collections.abc import Iterable

import attrs

from memo_core.scene.graph import SceneGraph
from memo_llm.offline.editing import apply
from memo_llm.offline.edits import GENTLE, Edit, Reading
from memo_llm.offline.prompt import Prompt
from memo_llm.offline.questions import OF_DOORS, what_is_missing, which_is_meant
from memo_llm.offline.reading import read_sentence
from memo_llm.offline.recipe import Habits, Recipe
from memo_llm.offline.relative import LENGTHS
from memo_llm.offline.rendering import render
from memo_llm.offline.surroundings import Surroundings
from memo_llm.offline.vocabulary import Vocabulary
from memo_llm.offline.wording import ONLY_WAY

# Edits that say how something is to be: following one changes nothing where it is so already.
_STATES = frozenset(
    [
        "straight",
        "arc",
        "hold-at",
        "approach",
        "release",
        "hold-on",
        "open-first",
        "close-first",
        "centre",
        "stiff-hand",
        "fingers",
        "look",
        "tilt",
        "turn-hand",
        "back-off",
        "finger-width",
        "turn-thing",
        "way",
        "line-up",
        "over-place",
        "strokes",
    ]
)
_AMOUNT_ALONE = re.compile(
    r"[.!] (?P<amount>(?:(?:about|around|roughly|maybe|say|just|like|by|only) )*"
    r"(?:an?|one|two|three|four|five|six|eight|ten|half an?|a couple of|a few|\d+) "
    r"(?:cm|mm|(?:centi|milli)met(?:er|re)s?|inch(?:es)?)(?: or so)?)(?=[.!]|$)",
    re.I,
)
_PLACED = frozenset(["hold-at", "centre", "offset", "approach", "beside"])
_WAS_THERE = re.compile(
    r"(?:please )?don't (?:stick|put) your fingers?\b|"
    r"(?:you(?:'ve|'re| were| are)?|it(?:'s| was)|that(?:'s| was))(?: \w+){0,3} too (?:close|near|far|high|low)\b"
)
_JUST_PUSHED = re.compile(r"(?:push|press|shove) (?:it|that|this|them)")
_ASIDE = "does it slide out towards the robot, or to which side? You said: {}"


@attrs.frozen
class Heard:
    """What was made of a person's words. ``question``: what has to be asked before anything follows from them."""

    recipe: Recipe | None  # the plain way to do what was spoken of; None for a verb that is not known
    sentences: tuple[str, ...]
    readings: tuple[Reading, ...]
    edits: tuple[Edit, ...]
    question: str
    about_plans: bool = False  # whether it surely is about what is to be done, and not only how
    also_moves: bool = False  # whether it is about the motion as well
    likewise: Heard | None = None  # the same in the plain words of the gist

    @property
    def kind(self) -> str:
        return "" if self.recipe is None else self.recipe.kind

    @property
    def not_understood(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(part for reading in self.readings for part in reading.not_understood))


def read_remark(words: str, prompt: Prompt, scene: SceneGraph, habits: Habits, vocabulary: Vocabulary) -> Heard:
    """What the rules read in a person's words of the prompt's subtask."""
    action, objects = prompt.subtask
    known = [*(node.label for node in scene.nodes), *objects, action]
    recipe = habits.recipe(action, objects)
    kind = recipe.read_as if recipe is not None else ""
    joined = _AMOUNT_ALONE.sub(r", \g<amount>", words.strip())  # "to the left. Like a centimetre."
    sentences = tuple(one for one in re.split(r"(?<=[.!?])\s+|\n+", joined) if one.strip())
    others = others_in(scene, objects)
    around = Surroundings.of(scene, recipe.thing if recipe is not None else "", None)
    readings: tuple[Reading, ...] = ()
    for sentence in sentences:
        asked = any(one.edits for one in readings)
        readings += (read_sentence(sentence, vocabulary, known, kind, others, asked),)
    readings = tuple(_without_repeats(one, [other for other in readings if other is not one]) for one in readings)
    edits = _settled([edit for reading in readings for edit in reading.edits], kind)
    if kind in ("", "push"):  # nothing is gripped: what is to be firm or gentle is the pressing
        edits = [_pressing(edit) for edit in edits]
        readings = tuple(attrs.evolve(one, edits=tuple(_pressing(edit) for edit in one.edits)) for one in readings)
    if kind in ("open", "close") and recipe is not None and not around.may_swing:
        edits = _settled(_screwed(edits, recipe, vocabulary), kind)
        readings = tuple(attrs.evolve(one, edits=tuple(_screwed(one.edits, recipe, vocabulary))) for one in readings)
    done = recipe or habits.recipe("push", objects)  # what is done for a verb that is not known
    aside = recipe is not None and recipe.kind == "open" and around.handle_near_an_edge and _slides(words, edits)
    effective = done is not None and _effective(edits, done, habits, prompt, scene)
    ambiguous = (
        _ASIDE.format(" ".join(words.split())[:200])
        if aside
        else which_is_meant(words, edits, recipe, vocabulary, around.may_swing)
    )
    question = ambiguous or what_is_missing(words, readings, edits, recipe, effective, vocabulary)
    return Heard(recipe, sentences, readings, tuple(edits), question)


def _without_repeats(reading: Reading, others: Iterable[Reading]) -> Reading:
    """Without doubts about what another sentence makes clear: words that were understood there ("upright! Keep it
    upright"), and where it was, if the other one says where it should be ("too close to the top. Take it lower")."""
    edits = [edit for one in others for edit in one.edits]
    said = {word for edit in edits for word in edit.said.split()}
    placed = any(edit.kind in _PLACED for edit in edits)
    unsure = [part for part in reading.unsure if not (set(part.split()) <= said or (placed and _WAS_THERE.match(part)))]
    return attrs.evolve(reading, unsure=tuple(unsure))


def _screwed(edits: Iterable[Edit], recipe: Recipe, vocabulary: Vocabulary) -> list[Edit]:
    """Edits of what has no door: to turn that is to screw it."""
    phrase = next(p for p in vocabulary.phrases if p.edit == "turn-thing" and not (p.value or p.lesson))
    way = "counterclockwise" if recipe.kind == "open" else "clockwise"
    return [
        attrs.evolve(edit, kind="turn-thing", value=way, phrase=phrase)
        if edit.kind == "angle" or (edit.kind == "arc" and re.search(r"\b(?:turn|twist|rotat|screw|spin)", edit.said))
        else edit
        for edit in edits
    ]


def _slides(words: str, edits: Iterable[Edit]) -> bool:
    """Whether "it slides" was said, and no more: what has its handle near an edge, as doors have, slides to a side,
    and what has it in the middle comes out."""
    if not any(edit.kind == "straight" and re.search(r"\bslides?$", edit.said.strip()) for edit in edits):
        return False
    return re.search(r"\b(?:out|straight|towards?|line|in and|pull\w*)\b", words.lower()) is None


def _pressing(edit: Edit) -> Edit:
    grips = re.search(r"\b(?:grip|hold|squeez|grab|grasp|finger)", edit.said)
    return attrs.evolve(edit, verb="press") if edit.kind == "force" and not (edit.verb or grips) else edit


def others_in(scene: SceneGraph, objects: Iterable[str]) -> list[str]:
    """Words for what is to be seen and neither is nor belongs to one of the objects."""
    names = [name.lower() for name in objects]
    names += [relation.subject.lower() for relation in scene.relations if relation.predicate == "held"]
    own = {word for name in names for word in name.split()}
    for node in scene.nodes:
        family = {node.label.lower(), (node.part_of or "").lower()}
        if family & set(names) or any(name and set(name.split()) < set(node.label.lower().split()) for name in names):
            own |= {word for label in family for word in label.split()}
    words = {word for node in scene.nodes for word in node.label.lower().split()}
    return sorted(words - own)


def _settled(edits: list[Edit], kind: str) -> list[Edit]:
    """Without what another edit of the same remark says better: "further, to 90 degrees" is 90 degrees."""
    reversal = next((edit for edit in edits if edit.kind == "reverse"), None)
    edits = [edit for edit in edits if edit.kind != "reverse" or edit is reversal]  # said twice, meant once
    called = {edit.kind for edit in edits if edit.kind in ("force", "speed") and not _exclaimed(edit)}
    edits = [  # "easy! Hold it lightly"
        edit for edit in edits if not (_exclaimed(edit) and called and edit.kind not in called)
    ]
    kinds = {edit.kind for edit in edits}
    if "all-the-way" in kinds:
        edits = [edit for edit in edits if edit.kind != "farther" or edit.amount or edit.degrees]
    if kind == "place" and kinds == {"release"} and not any("afterwards" in edit.said for edit in edits):
        return []  # what it does anyway: where or when is not said
    if any(edit.kind == "extent" or (edit.kind == "angle" and edit.degrees is not None) for edit in edits):
        edits = [edit for edit in edits if edit.kind not in LENGTHS]
    if any(edit.kind in ("pivot", "turn-thing") and edit.value and not edit.negated for edit in edits):
        # the edge, or the way, says which way round
        edits = [edit for edit in edits if edit.kind != "reverse"]
    measured = {(edit.kind, edit.value) for edit in edits if edit.amount is not None and edit.amount.exact}
    edits = [
        edit
        for edit in edits
        if (edit.kind, edit.value) not in measured or (edit.amount is not None and edit.amount.exact)
    ]
    if kind in ("open", "close", "pull") and "way" in kinds:  # "pull it out towards you" is one way
        edits = [edit for edit in edits if edit.kind != "offset" or edit.value not in ("towards", "away")]
    forced = {edit.value in GENTLE for edit in edits if edit.kind == "force" and edit.verb}
    edits = [  # "you press so hard: lighter!" is about pressing, twice
        edit for edit in edits if edit.kind != "force" or edit.verb or (edit.value in GENTLE) not in forced
    ]
    if kind == "turn" and len(kinds) > 1:  # what is turned in place is led nowhere
        edits = [edit for edit in edits if edit.kind not in OF_DOORS]
    if any(edit.kind == "centre" and re.search(r"\bwait\b", edit.said) for edit in edits):
        # "too early! Wait until you are over it": where it is let go
        edits = [edit for edit in edits if edit.kind != "set-down" or not re.search(r"too (?:early|soon)", edit.said)]
    if "travel" in kinds:  # "up, across, then down"
        edits = [edit for edit in edits if edit.kind != "offset" or not ONLY_WAY.fullmatch(edit.said.strip())]
    if "set-down" in kinds:  # "reach right down and set it on the bottom"
        edits = [edit for edit in edits if edit.kind != "offset" or edit.value != "down" or edit.amount is not None]
    if "shake" in kinds:  # to shake harder is not to grip harder
        edits = [edit for edit in edits if edit.kind != "force" or re.search(r"grip|hold|squeez", edit.said)]
    if len(kinds) > 1:  # "push harder at the end"
        edits = [edit for edit in edits if edit.kind != "hold-at" or edit.said.strip() != "at the end"]
    if "press-turn" in kinds:
        edits = [edit for edit in edits if edit.kind != "first-in"]
    if kind == "pick" and any(edit.kind == "hold-at" and edit.value != "handle" for edit in edits):
        # "higher up, near the rim": the part says where
        edits = [edit for edit in edits if edit.kind != "offset" or edit.amount or edit.value not in ("up", "down")]
    if kind == "push" and len(kinds) > 1:  # "press it four times": to press is what it does anyway
        edits = [edit for edit in edits if edit.kind != "way" or not _JUST_PUSHED.fullmatch(edit.said.strip())]
    if "hold-for" in kinds and kind == "push":  # "hold it at the bottom for a second"
        edits = [edit for edit in edits if edit.kind != "hold-at"]
    if any(edit.kind == "hold-for" and edit.seconds is not None for edit in edits):
        edits = [edit for edit in edits if edit.kind != "hold-for" or edit.seconds is not None]
    if "fingers" in kinds:  # how they lie in the end; a turn said beside it is the way there
        edits = [edit for edit in edits if edit.kind != "turn-hand"]
    return edits


def _exclaimed(edit: Edit) -> bool:
    """Whether an edit was read from a mere call for care."""
    return re.fullmatch(r"(?:go )?easy(?: now| there)?|gently|careful", edit.said.strip()) is not None


def _effective(edits: list[Edit], recipe: Recipe, habits: Habits, prompt: Prompt, scene: SceneGraph) -> bool:
    """Whether the hand will do anything differently, or says how it does it already."""
    changed = recipe
    for edit in edits:
        changed = apply(changed, edit, habits.rough)
    if any(edit.kind in _STATES and not _idle(edit) for edit in edits):
        return True
    subtask = prompt.section("subtask")
    return render(changed, subtask, scene, prompt.task, []) != render(recipe, subtask, scene, prompt.task, [])


def _idle(edit: Edit) -> bool:
    """Whether nothing follows from an edit: "not from the left" does not say from where."""
    return edit.negated and edit.kind in ("hold-at", "release", "hold-on", "fingers", "centre", "approach")
