"""Phase 3: a person's words as short notes. What is understood is said again plainly, the rest kept as it was."""

from __future__ import annotations

import json
import re

import attrs

from memo_llm.offline.prompt import Prompt
from memo_llm.offline.reading import Edit, read_sentence
from memo_llm.offline.vocabulary import Vocabulary

_EVERYWHERE = re.compile(r"\b(always|never|every time|whenever|in general|generally|anything|any \w+|all \w+s)\b")
_FILLERS = re.compile(
    r"^(?:(?:no|well|hm+|hey|ok(?:ay)?|please|and|so|but|then)[, ]+)+|[, ]+(?:please|ok(?:ay)?)$", re.I
)
_EXCLAIMED = re.compile(r"(?:(?:oh|no|nope|hey|wait|well|hm+|ok(?:ay)?|please)\b[,! ]*)+\.", re.I)
_MUST = re.compile(
    r"^(?:you(?:'ve| have)? (?:got to|have to|need to|must|should|can|could|to)|you'd better|try to|i want you to) ",
    re.I,
)
_LINK = {"left": "to the left", "right": "to the right", "up": "higher", "down": "lower", "out": "towards the robot"}


@attrs.frozen
class NotesAnswer:
    text: str  # JSON
    not_understood: tuple[str, ...]


def note(prompt: Prompt, vocabulary: Vocabulary) -> NotesAnswer:
    """Corrections and general statements. Raises ``LanguageModelError`` naming what the prompt lacks."""
    words = prompt.quoted("what the person said")
    scene = prompt.scene()
    _, objects = prompt.subtask
    known = [node.label for node in scene.nodes] + list(objects)
    corrections: list[str] = []
    general: list[str] = []
    missed: list[str] = []
    understood = False
    for sentence in re.split(r"(?<=[.!?])\s+|\n+", words.strip()):
        reading = read_sentence(sentence, vocabulary, known)
        missed += reading.not_understood
        notes = [said for edit in reading.edits if (said := _said(edit))]
        understood = understood or bool(notes)
        if not notes and sentence.strip():
            notes = [_plainly(sentence)]
        (general if _EVERYWHERE.search(sentence.lower()) and reading.edits else corrections).extend(notes)
        general += [edit.phrase.general for edit in reading.edits if edit.phrase is not None and edit.phrase.general]
    if not understood and not general:
        # The words themselves are kept by whoever asked; a note that nobody can follow would only be in the way.
        why = f"none of it is understood: {' '.join(words.split())[:300]}"
        answer = {"corrections": [], "general": [], "unclear": why}
        return NotesAnswer(json.dumps(answer, ensure_ascii=False), tuple(dict.fromkeys(missed)))
    if general and not corrections and not _EVERYWHERE.search(words.lower()):
        corrections = list(general)
    if len(corrections) + len(general) > 1:
        corrections = [said for said in corrections if not _EXCLAIMED.fullmatch(said)]
    answer = {"corrections": list(dict.fromkeys(corrections)), "general": list(dict.fromkeys(general)), "unclear": ""}
    return NotesAnswer(json.dumps(answer, ensure_ascii=False), tuple(dict.fromkeys(missed)))


def _said(edit: Edit) -> str:
    """The edit in plain words, amounts as the person named them."""
    if edit.phrase is None or not edit.phrase.say:
        return ""
    amount = edit.amount.words if edit.amount else ""
    angle = f"{edit.degrees:g} degrees" if edit.degrees is not None else ""
    value = _LINK.get(edit.value, edit.value) if edit.kind == "offset" else edit.value
    text = edit.phrase.say.format(value=value, amount=amount, angle=angle)
    text = (
        re.sub(r"\s+(?=[.,])", "", " ".join(text.split())).replace(" by.", ".").replace(" from.", " from another side.")
    )
    if edit.kind == "turn-hand" and edit.value:
        text = text.removesuffix(".") + f" {edit.value}."
    if edit.negated:
        text = "Do not " + text[0].lower() + text[1:]
    return text


def _plainly(sentence: str) -> str:
    text = " ".join(sentence.split()).strip(" .!?,")
    text = _MUST.sub("", _FILLERS.sub("", text)) or text
    text = re.sub(r"[\[(]\s*-?\d[^\])]*[\])]", "there", text)  # coordinates hold only for one scene
    return (text[0].upper() + text[1:] + ".")[:380] if text else ""
