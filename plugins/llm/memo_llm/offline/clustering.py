"""Condensing notes by rules: what a note asks for is read with the vocabulary, what a template does from its docstring,
its parameters and the functions it calls. Nothing but the prompt's text is looked at.

A note contradicts a template when both speak of the same matter and differ. A note repeats another when all it asks
for, and every other word of weight in it, is in the other as well. What is not understood is kept as it is.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence

import attrs

from memo_llm.offline.conduct import Conduct, conduct_of, disputed, matter_of, supports
from memo_llm.offline.prompt import Prompt
from memo_llm.offline.reading import Edit, read_sentence
from memo_llm.offline.vocabulary import Vocabulary

_NOTE = re.compile(r"^(\d+)\. (.*?)(?: \[(said of code .*?)\])?$", re.M)
_TEMPLATE = re.compile(r"^Template (\d+) \[([^\]\n]*)\][^\n]*\n```(?:python)?\n(.*?)^```", re.M | re.S)
_BREAK = re.compile(r"(\s*[;:.](?:\s+|$)|,?\s+(?:but|and then|then)\s+|,\s+(?:and\s+)?|\s+and\s+)")
_CONDITION = re.compile(r"\b(?:if|when|whenever|while|unless|once|until|before|after|as soon as)\b")
_UNIVERSAL = re.compile(r"\b(?:always|never|everything|anything|any|every|all|everywhere)\b")
_LIGHT_WORDS = """
a an the this that it its it's them they you your please just do does is are be to of with by at in on and then so
always should must need have can not don't never no instead rather than but make sure ok there here
"""
_LIGHT = frozenset(_LIGHT_WORDS.split())


@attrs.frozen
class CondensedAnswer:
    text: str  # JSON
    not_understood: tuple[str, ...]


@attrs.frozen
class _Note:
    """A note, or what is left of one, as it was read."""

    number: int
    text: str
    edits: tuple[Edit, ...]
    rest: frozenset[str]  # words of weight that are in no edit
    words: frozenset[str]
    numbers: frozenset[str]
    conditions: tuple[str, ...]
    scope: tuple[str, str]
    fixed: bool  # said of code that was written with a template
    not_understood: tuple[str, ...]


@attrs.frozen
class _Template:
    number: int
    key: str
    text: str
    conduct: Conduct


def condense(prompt: Prompt, vocabulary: Vocabulary) -> CondensedAnswer:
    """Entries and dropped numbers as JSON. Raises ``LanguageModelError`` naming what the prompt lacks."""
    about = prompt.section("about")
    key = "*" if about.startswith("*") else about
    notes = [
        _note(int(match.group(1)), match.group(2), bool(match.group(3)), vocabulary)
        for match in _NOTE.finditer(prompt.section("notes"))
    ]
    templates = [
        _Template(int(number), name, text, conduct_of(text, vocabulary))
        for number, name, text in _TEMPLATE.findall(prompt.section("templates") + "\n")
    ]
    kept, dropped = [], []
    for note in notes:
        against = None if note.fixed else _contradicted(note, key, notes, templates, vocabulary)
        if against is None:
            kept.append(note)
            continue
        template, why = against
        left = _remainder(note, template.conduct, vocabulary)
        if left:
            kept.append(_note(note.number, left, False, vocabulary))
        else:
            dropped.append({"number": note.number, "template": template.number, "reason": why})
    groups = sorted(_groups(kept), key=lambda group: min(note.number for note in group))
    entries = [{"text": group[0].text, "from": sorted(note.number for note in group)} for group in groups]
    answer = {"entries": entries, "dropped": dropped}
    missed = tuple(dict.fromkeys(words for note in notes for words in note.not_understood))
    return CondensedAnswer(json.dumps(answer, ensure_ascii=False), missed)


# -- contradictions ---------------------------------------------------------------------------------------------------


def _contradicted(
    note: _Note, key: str, notes: Sequence[_Note], templates: Sequence[_Template], vocabulary: Vocabulary
) -> tuple[_Template, str] | None:
    """The template that a note contradicts, and in what."""
    if note.conditions and key != "*":
        return None  # it speaks of something else than what a template always does
    if key == "*":
        return _contradicted_everywhere(note, templates, vocabulary)
    for template in templates:
        matter = disputed(note.edits, template.conduct)
        if not matter:
            continue
        if template.key == key or _works_alike(note, matter, notes, template, templates, key):
            return template, f"the template {template.conduct.said(matter)}"
    return None


def _works_alike(
    note: _Note,
    matter: str,
    notes: Sequence[_Note],
    template: _Template,
    templates: Sequence[_Template],
    key: str,
) -> bool:
    """Whether another thing's template counts: this thing has none that speaks of the matter, and somebody said of this
    thing what that template does."""
    if any(own.key == key and own.conduct.speaks_of(matter) for own in templates):
        return False
    return any(supports(other.edits, matter, template.conduct) for other in notes if other is not note)


def _contradicted_everywhere(
    note: _Note, templates: Sequence[_Template], vocabulary: Vocabulary
) -> tuple[_Template, str] | None:
    """A general statement is given up where it claims to hold for what a template is about, and no template agrees."""
    noun, verb = note.scope
    if not (noun or verb or _UNIVERSAL.search(note.text.lower())) or (note.not_understood and not noun):
        return None
    meant = [t for t in templates if (not noun or noun in t.text.lower()) and t.key.lower().startswith(verb)]
    found = None
    for template in meant:
        matter = disputed(note.edits, template.conduct)
        if matter and found is None:
            found = template, f"the template {template.conduct.said(matter)}"
        elif not matter and any(supports((edit,), matter_of(edit), template.conduct) for edit in note.edits):
            return None
    return found


def _remainder(note: _Note, conduct: Conduct, vocabulary: Vocabulary) -> str:
    """What is left of a note without the pieces that contradict; "" when nothing of weight is."""
    pieces = _BREAK.split(note.text)
    left = []
    for piece in pieces[::2]:
        edits = read_sentence(piece, vocabulary).edits if piece.strip() else ()
        if edits and not disputed(edits, conduct):
            left.append(piece.strip(" .,;"))
    if not left:
        return ""
    text = ", ".join(left)
    text = text[0].upper() + text[1:] + "."
    return text if len(text) <= len(note.text) else ""


# -- repetitions ------------------------------------------------------------------------------------------------------


def _groups(notes: Iterable[_Note]) -> list[list[_Note]]:
    """Notes that say the same; of each group first the one whose text says all of it."""
    fullest = sorted(notes, key=lambda n: (-len(n.edits), -len(n.rest), -len(n.numbers), len(n.text), n.number))
    groups: list[list[_Note]] = []
    for note in fullest:
        for group in groups:
            if _repeats(note, group[0]):
                group.append(note)
                break
        else:
            groups.append([note])
    return groups


def _repeats(one: _Note, other: _Note) -> bool:
    """Whether the other note says all that the one says."""
    if one.scope != other.scope or one.conditions != other.conditions or not one.numbers <= other.numbers:
        return False
    if one.edits:
        return set(one.edits) <= set(other.edits) and one.rest <= other.words
    return not other.edits and len(one.words) > 1 and one.words <= other.words and _denies(one) == _denies(other)


def _denies(note: _Note) -> bool:
    return bool(re.search(r"\b(?:not|never|no|without|don't|avoid)\b", note.text.lower()))


# -- reading ----------------------------------------------------------------------------------------------------------


def _note(number: int, text: str, fixed: bool, vocabulary: Vocabulary) -> _Note:
    reading = read_sentence(text, vocabulary)
    plain = text.lower().replace("’", "'")
    taken = {word for edit in reading.edits for word in _stems(edit.said)}
    words = _stems(plain)
    return _Note(
        number,
        text,
        reading.edits,
        frozenset(words - taken),
        frozenset(words),
        frozenset(re.findall(r"\d+(?:[.,]\d+)?", plain)),
        tuple(re.findall(_CONDITION.pattern + r"[^,;.]*", plain)),
        vocabulary.scope(text),
        fixed,
        reading.not_understood,
    )


def _stems(text: str) -> set[str]:
    words = re.findall(r"[\w'-]+", text.lower())
    return {re.sub(r"(?:ing|ed|es|s|ly)$", "", word) if len(word) > 4 else word for word in words if word not in _LIGHT}
