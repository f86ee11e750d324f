"""Condensing notes by keywords: what a note asks for is read like a remark, what a template does from its docstring.

A note contradicts a template when both state the same matter with different values. A note repeats another when
everything it asks for, and each of its other content words, is also in the other. The rest is kept as it is.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Sequence

import attrs

from memo_core.plugin import Prompt
from memo_offline.reading import Edit, read

_NOTE = re.compile(r"^(\d+)\. (.*?)(?: \[(said of code .*?)\])?$", re.M)
_TEMPLATE = re.compile(r"^Template (\d+) \[([^\]\n]*)\][^\n]*\n```(?:python)?\n(.*?)^```", re.M | re.S)
_THIRD_PERSON = re.compile(r"\b(take|pull|push|lead|lift|turn|swing|hold|grip|tilt|approach)(?:s|es)\b", re.I)
_UNIVERSAL = re.compile(r"\b(?:always|never|everything|anything|any|every|all)\b")
_NOUN = re.compile(r"\b(door|drawer|lid)s?\b")
_LIGHT_WORDS = """
it is are be to of with by at in on and then so always should must need have can do does no ok there here for i say you
open pull lead handle door drawer out about around go move me way hold take grip grab draw use
"""
_LIGHT = frozenset(_LIGHT_WORDS.split())


@attrs.frozen
class _Note:
    number: int
    text: str
    edits: tuple[Edit, ...]
    rest: frozenset[str]  # words of weight that are in no keyword
    words: frozenset[str]
    numbers: frozenset[str]
    fixed: bool  # said of code that was written with a template

    @property
    def wants(self) -> frozenset[tuple[object, ...]]:
        return frozenset((edit.phrase.name, edit.amount and round(edit.amount.value, 4)) for edit in self.edits)


@attrs.frozen
class _Template:
    number: int
    key: str
    text: str
    does: dict[str, str]  # matter -> value


def condense(prompt: Prompt) -> str:
    """Entries and dropped numbers as JSON. Raises ``UnreadablePrompt`` naming what the prompt lacks."""
    about = prompt.section("about")
    key = "*" if about.startswith("*") else about
    notes = [_note(int(one[1]), one[2], bool(one[3])) for one in _NOTE.finditer(prompt.section("notes"))]
    templates = [
        _Template(int(number), name, text.lower(), _does(text))
        for number, name, text in _TEMPLATE.findall(prompt.section("templates") + "\n")
    ]
    may_cover = '"covered"' in prompt.section("limits", "answer")
    kept: list[_Note] = []
    dropped: list[dict[str, object]] = []
    for note in notes:
        if may_cover and (number := _covering(note, key, templates)):
            reason = "the template does all of that"
            dropped.append({"number": note.number, "template": number, "reason": reason, "covered": True})
        elif against := _against(note, key, templates):
            dropped.append({"number": note.number, "template": against[0], "reason": against[1]})
        else:
            kept.append(note)
    groups = sorted(_groups(kept), key=lambda group: min(note.number for note in group))
    entries = [{"text": group[0].text, "from": sorted(note.number for note in group)} for group in groups]
    return json.dumps({"entries": entries, "dropped": dropped}, ensure_ascii=False)


def _against(note: _Note, key: str, templates: Sequence[_Template]) -> tuple[int, str] | None:
    """The number of a template that the whole of a note contradicts, and why. General statements are contradicted only
    by all templates that they are about."""
    if note.fixed or note.rest or not note.edits:
        return None
    if key == "*":
        noun = _NOUN.search(note.text.lower())
        if not noun and not _UNIVERSAL.search(note.text.lower()):
            return None
        meant = [one for one in templates if not noun or noun.group(1) in one.text]
    else:
        meant = [one for one in templates if one.key == key]  # another thing may work in another way
    concerned = [one for one in meant if any(edit.phrase.matter in one.does for edit in note.edits)]
    against = [one for one in concerned if all(_disputes(edit, one) for edit in note.edits)]
    if not against or (key == "*" and len(against) < len(concerned)):
        return None
    first = against[0]
    matter = note.edits[0].phrase.matter
    return first.number, f"the template has {matter}: {first.does[matter]}"


def _disputes(edit: Edit, template: _Template) -> bool:
    return template.does.get(edit.phrase.matter, edit.phrase.value) != edit.phrase.value


def _covering(note: _Note, key: str, templates: Sequence[_Template]) -> int:
    """The number of a template with exactly this key that does everything a note asks for; 0 without one."""
    if note.fixed or not note.edits or note.numbers:
        return 0
    for one in templates:
        done = all(one.does.get(edit.phrase.matter) == edit.phrase.value for edit in note.edits)
        if one.key == key and done and all(word in one.text for word in note.rest):
            return one.number
    return 0


def _does(text: str) -> dict[str, str]:
    """Read what a template's docstring says that it does, by matter; empty for what does not parse."""
    try:
        function = next((node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)), None)
    except (SyntaxError, ValueError, RecursionError):
        function = None
    said = _THIRD_PERSON.sub(r"\1", ast.get_docstring(function) or "") if function is not None else ""
    sentences = re.split(r"(?<=[.!?])\s+|\n+", said)
    return {edit.phrase.matter: edit.phrase.value for one in sentences for edit in read(one).edits}


def _groups(notes: Sequence[_Note]) -> list[list[_Note]]:
    """Notes that say the same; of each group first the one whose text says all of it."""
    fullest = sorted(notes, key=lambda n: (-len(n.wants), -_weight(n), -len(n.numbers), len(n.text), n.number))
    groups: list[list[_Note]] = []
    for note in fullest:
        group = next((one for one in groups if _repeats(note, one[0])), None)
        if group is None:
            groups.append([note])
        else:
            group.append(note)
    return groups


def _weight(note: _Note) -> int:
    return len(note.rest if note.edits else note.words)


def _repeats(one: _Note, other: _Note) -> bool:
    """Whether the other note says all that the one says."""
    if not one.numbers <= other.numbers or bool(one.edits) != bool(other.edits):
        return False
    if one.edits:
        return one.wants <= other.wants and one.rest <= other.words
    return len(one.words) > 1 and one.words <= other.words and not (other.words - one.words) & {"not", "don't", "never"}


def _note(number: int, text: str, fixed: bool) -> _Note:
    reading = read(text)
    words = frozenset(re.findall(r"[\w']+", text.lower())) - {"the", "a", "an", "please"}
    numbers = frozenset(re.findall(r"\d+(?:[.,]\d+)?", text))
    rest = frozenset(reading.rest) - _LIGHT
    return _Note(number, text, reading.edits, rest, words, numbers, fixed)
