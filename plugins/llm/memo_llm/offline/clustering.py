"""Condensing notes by rules: what a note asks for is read with the vocabulary, what a template does from its docstring,
its parameters and the functions it calls. Nothing but the prompt's text is looked at.

A note contradicts a template when both state the same property with different values. A note repeats another when
everything it asks for, and each of its other content words, is also in the other. What is not understood is kept as it
is.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence

import attrs

from memo_llm.offline.edits import Edit
from memo_llm.offline.prompt import Prompt
from memo_llm.offline.reading import read_sentence
from memo_llm.offline.template_behaviour import Conduct, claims, conduct_of, disputed, supported
from memo_llm.offline.vocabulary import Vocabulary

_NOTE = re.compile(r"^(\d+)\. (.*?)(?: \[(said of code .*?)\])?$", re.M)
_TEMPLATE = re.compile(r"^Template (\d+) \[([^\]\n]*)\][^\n]*\n```(?:python)?\n(.*?)^```", re.M | re.S)
_BREAK = re.compile(r"(\s*[;:.](?:\s+|$)|,?\s+(?:but|and then|then)\s+|,\s+(?:and\s+)?|\s+and\s+)")
_CONDITION = re.compile(r"\b(?:if|when|whenever|while|unless|once|until|before|after|as soon as)\b")
_UNIVERSAL = re.compile(r"\b(?:always|never|everything|anything|any|every|all|everywhere)\b")
_WHERE_WORDS = """
near nearest far farthest left right top bottom upper lower front back behind inside outside under over above below
beside between edge end corner side middle centre center hinge handle bar up down off before
after until first last only again
"""
_WHERE = frozenset(_WHERE_WORDS.split())
_LIGHT_WORDS = """
a an the this that it its it's them they you your please just do does is are be to of with by at in on and then so
always should must need have can not don't never no instead rather than but make sure ok there here for has
was were been while
"""
_LIGHT = frozenset(_LIGHT_WORDS.split())


@attrs.frozen
class CondensedAnswer:
    text: str  # JSON
    not_understood: tuple[str, ...]


@attrs.frozen
class _Note:
    """A parsed note, or what is left of one."""

    number: int
    text: str
    edits: tuple[Edit, ...]
    wants: frozenset[tuple[object, ...]]  # the same, whatever the words
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
    kept: list[_Note] = []
    dropped: list[dict[str, object]] = []
    may_drop_covered = '"covered"' in prompt.section("answer")
    for note in notes:
        covering = _covering(note, key, templates) if may_drop_covered else None
        if covering is not None:
            reason = "the template does all of that"
            dropped.append({"number": note.number, "template": covering, "reason": reason, "covered": True})
            continue
        against = None if note.fixed else _contradicted(note, key, templates, vocabulary)
        if against is None:
            kept.append(note)
            continue
        if against.left:
            kept.append(_note(note.number, against.left, False, vocabulary))
        dropped.append({"number": note.number, "template": against.template, "reason": against.why})
    groups = sorted(_groups(kept), key=lambda group: min(note.number for note in group))
    entries = [{"text": group[0].text, "from": sorted(note.number for note in group)} for group in groups]
    answer = {"entries": entries, "dropped": dropped}
    missed = tuple(dict.fromkeys(words for note in notes for words in note.not_understood))
    return CondensedAnswer(json.dumps(answer, ensure_ascii=False), missed)


# -- contradictions ---------------------------------------------------------------------------------------------------


@attrs.frozen
class _Against:
    """A note's contradiction to a template, and the rest of the note without the contradicting parts."""

    template: int
    why: str
    left: str


def _contradicted(note: _Note, key: str, templates: Sequence[_Template], vocabulary: Vocabulary) -> _Against | None:
    """Templates for other objects overrule only general statements that claim to apply to them, since nothing here can
    tell whether this object works in the same way."""
    if key == "*":
        return _contradicted_everywhere(note, templates)
    pieces = [_note(note.number, piece, False, vocabulary) for piece in _pieces(note.text)]
    for template in templates:
        if template.key != key:
            continue
        # What holds under a condition is about something else than what a template always does.
        against = [p for p in pieces if not p.conditions and disputed(p.edits, template.conduct)]
        if against:
            matter = disputed(against[0].edits, template.conduct)
            left = [p for p in pieces if p not in against and (p.edits or len(p.rest) > 1)]
            return _Against(template.number, f"the template {template.conduct.said(matter)}", _joined(left, note.text))
    return None


def _covering(note: _Note, key: str, templates: Sequence[_Template]) -> int | None:
    """The number of a template with exactly this key that does everything a note asks for and mentions everything else
    in it."""
    if note.fixed or note.conditions or note.not_understood or not note.edits:
        return None
    for template in templates:
        said = _stems(template.text)
        amounts = note.numbers <= frozenset(re.findall(r"\d+(?:[.,]\d+)?", template.text))
        done = all(supported([edit], template.conduct) for edit in note.edits)
        if template.key == key and done and amounts and note.rest <= said and note.words & said:
            return template.number
    return None


def _pieces(text: str) -> list[str]:
    """What can be followed without the rest; a condition goes with what it is about."""
    pieces: list[str] = []
    waiting = ""
    for piece in _BREAK.split(text)[::2]:
        if not piece.strip():
            continue
        whole = f"{waiting}, {piece.strip()}" if waiting else piece.strip()
        waiting = ""
        if _CONDITION.match(piece.strip().lower()):
            waiting = whole
        else:
            pieces.append(whole)
    if waiting and pieces:
        pieces[-1] = f"{pieces[-1]}, {waiting}"
    return pieces or [waiting]


def _contradicted_everywhere(note: _Note, templates: Sequence[_Template]) -> _Against | None:
    """Whether a general statement is dropped: every template to which it applies contradicts it."""
    noun, verb = note.scope
    if not (noun or verb or _UNIVERSAL.search(note.text.lower())) or (note.not_understood and not noun):
        return None
    meant = [t for t in templates if (not noun or noun in t.text.lower()) and t.key.lower().startswith(verb)]
    found = None
    for template in meant:
        matter = disputed(note.edits, template.conduct)
        if matter and found is None:
            found = _Against(template.number, f"the template {template.conduct.said(matter)}", "")
        elif not matter and supported(note.edits, template.conduct):
            return None
    return found


def _joined(pieces: Sequence[_Note], whole: str) -> str:
    text = ", ".join(piece.text.strip(" .,;") for piece in pieces)
    text = text[:1].upper() + text[1:] + "." if text else ""
    return text if len(text) <= len(whole) else ""


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
        return one.wants <= other.wants and one.rest <= other.words
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
        _wants(reading.edits),
        frozenset(word for word in words - taken if _weighs(word, reading.edits, vocabulary)),
        frozenset(words),
        frozenset(re.findall(r"\d+(?:[.,]\d+)?", plain)),
        _conditions(plain, reading.edits, vocabulary),
        vocabulary.scope(text),
        fixed,
        reading.not_understood,
    )


def _wants(edits: Iterable[Edit]) -> frozenset[tuple[object, ...]]:
    found: set[tuple[object, ...]] = set()
    for edit in edits:
        amount = round(edit.amount.metres, 4) if edit.amount and edit.amount.exact else None
        said = claims(edit) or [(edit.kind, edit.value)]
        found |= {(*one, edit.negated, amount) for one in said}
    return frozenset(found)


def _weighs(word: str, edits: Sequence[Edit], vocabulary: Vocabulary) -> bool:
    """Whether a word that is in no edit tells more than these do: not one that says the same by itself ("curve" beside
    an arc), nor one that says nothing, unless it says where or when."""
    if word in _WHERE:
        return True
    if word in vocabulary.fillers or f"{word}s" in vocabulary.fillers:
        return False
    alone = _wants(read_sentence(word, vocabulary).edits)
    return not (alone and alone <= _wants(edits))


def _conditions(text: str, edits: Iterable[Edit], vocabulary: Vocabulary) -> tuple[str, ...]:
    """Pieces that say when a note holds. "When you are done" says nothing of the sort, nor does what is part of what is
    to be done ("before you reach for it")."""
    for edit in edits:
        text = text.replace(edit.said, " ; ")
    found = (match.group() for match in re.finditer(_CONDITION.pattern + r"[^,;.]*", text))
    return tuple(one.strip() for one in found if set(re.findall(r"[\w'-]+", one)) - vocabulary.fillers)


def _stems(text: str) -> set[str]:
    words = re.findall(r"[\w'-]+", text.lower())
    return {re.sub(r"(?:ing|ed|s|ly)$", "", word) if len(word) > 4 else word for word in words if word not in _LIGHT}
