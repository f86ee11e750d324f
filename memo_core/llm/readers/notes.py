"""Phase 3's answer: what a person's words teach, as short notes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import attrs

from memo_core.llm.readers.json_objects import json_objects
from memo_core.llm.readers.unreadable import Unreadable, missing, spoken
from memo_core.skillbook.model.keys import Key, NotAKey

MAX_NOTE = 400  # characters; a longer note is a story, not an instruction
MAX_NOTES = 12
FORM = '{"corrections": ["…"], "general": ["…"], "unclear": ""}'
WANTED = f"answer with {FORM} and nothing else"

_COORDINATES = re.compile(r"[\[(]\s*-?\d+(?:\.\d+)?\s*(?:,\s*-?\d+(?:\.\d+)?\s*){1,}[\])]")
_NOTHING = re.compile(r"\W*(?:none|nothing|n/?a|null|empty|-)?\W*", re.IGNORECASE)


@attrs.frozen
class Notes:
    """The result of phase 3: notes for the current subtask, general statements, notes for plans, and notes for other
    subtasks of the run. ``unclear`` is a question to the person if nothing could be learnt; then all lists are
    empty."""

    corrections: tuple[str, ...]
    general: tuple[str, ...]
    unclear: str = ""
    plan: tuple[str, ...] = ()
    elsewhere: tuple[tuple[Key, str], ...] = ()

    def __bool__(self) -> bool:
        return bool(self.corrections or self.general or self.plan or self.elsewhere)


def read_notes(text: str, subtasks: Sequence[Key] = ()) -> Notes:
    """Notes from JSON; ``subtasks`` are the other subtasks under which a note may be filed. Raises ``Unreadable``, also
    for notes with coordinates and for an answer with neither a note nor a reason."""
    said = spoken("feedback", text, WANTED)
    found = next((named for value in json_objects(said) if (named := _named(value))), None)
    if found is None:
        problem = 'it is no JSON object with the keys "corrections" and "general"'
        if "{" in said and said.count("{") > said.count("}"):
            problem = "the JSON object breaks off before its end"
        raise missing("feedback", problem, text, WANTED)
    notes = Notes(
        _strings(found, "corrections", text),
        _strings(found, "general", text),
        _unclear(found),
        _strings(found, "plan", text),
        _elsewhere(found, subtasks, text),
    )
    if notes:
        return attrs.evolve(notes, unclear="")
    if not notes.unclear:
        problem = 'both lists are empty, although the person said something; say in "unclear" why nothing can be learnt'
        raise Unreadable("feedback", f"{problem}, or {WANTED}", text)
    return notes


def _elsewhere(found: dict[str, Any], subtasks: Sequence[Key], text: str) -> tuple[tuple[Key, str], ...]:
    """Notes with the subtask that each belongs to. Raises ``Unreadable`` for a subtask that is not one of the run's."""
    value = found.get("elsewhere") or []
    items = [value] if isinstance(value, dict) else value
    notes = []
    for item in items if isinstance(items, list) else [items]:
        given = {str(name).lower(): one for name, one in item.items()} if isinstance(item, dict) else {}
        note = given.get("note", given.get("text"))
        if not isinstance(given.get("subtask"), str) or not isinstance(note, str):
            problem = f'"elsewhere" must be a list of {{"subtask": "\u2026", "note": "\u2026"}}, not of {item!r:.60}'
            raise Unreadable("feedback", problem, text)
        if _says_nothing(note):
            continue
        try:
            key = Key.parse(given["subtask"])
        except NotAKey as error:
            raise Unreadable("feedback", f'"elsewhere": {error}', text) from None
        if key not in subtasks:
            known = ", ".join(map(str, subtasks)) or "none: leave it empty"
            raise Unreadable("feedback", f'"elsewhere": {key} is no subtask of this run; these are: {known}', text)
        notes += [(key, one) for one in _strings({"elsewhere": [note]}, "elsewhere", text)]
    if len(notes) > MAX_NOTES:
        raise Unreadable("feedback", f'"elsewhere" has {len(notes)} notes; at most {MAX_NOTES}', text)
    return tuple(dict.fromkeys(notes))


def _named(value: dict[str, Any]) -> dict[str, Any]:
    """The lists of an object by their names in the prompt; models vary them."""
    found: dict[str, Any] = {}
    for key, item in value.items():
        word = re.sub(r"[^a-z]", "", str(key).lower())
        name = (
            "corrections"
            if re.fullmatch(r"(?:specific)?corrections?(?:notes?)?|specific(?:notes?)?", word)
            else "general"
            if re.fullmatch(r"generals?(?:statements?|notes?|guidance|rules?)?", word)
            else "plan"
            if re.fullmatch(r"plan(?:s|notes?|ning)?", word)
            else "elsewhere"
            if re.fullmatch(r"elsewhere|othersubtasks?", word)
            else "unclear"
            if word in ("unclear", "question")
            else ""
        )
        if name:
            found[name] = item
    return found if set(found) - {"unclear"} else {}


def _unclear(found: dict[str, Any]) -> str:
    value = found.get("unclear")
    said = " ".join(value.split())[:MAX_NOTE] if isinstance(value, str) else ""
    return "" if _says_nothing(said) else said


def _says_nothing(note: str) -> bool:
    return len(note) <= MAX_NOTE and _NOTHING.fullmatch(note) is not None


def _strings(found: dict[str, Any], name: str, text: str) -> tuple[str, ...]:
    value = found.get(name) or []
    value = [value] if isinstance(value, (str, dict)) else value
    if not isinstance(value, list):
        raise Unreadable("feedback", f'"{name}" must be a list of strings; {WANTED}', text)
    notes = []
    for item in value:
        if isinstance(item, dict) and len(item) == 1:  # {"text": "…"}
            item = next(iter(item.values()))
        if not isinstance(item, str):
            raise Unreadable("feedback", f'"{name}" must be a list of strings, not of {item!r:.60}; {WANTED}', text)
        note = " ".join(item.split())
        if not _says_nothing(note):
            notes.append(note)
    if len(notes) > MAX_NOTES:
        raise Unreadable("feedback", f'"{name}" has {len(notes)} notes; at most {MAX_NOTES}', text)
    for note in notes:
        if len(note) > MAX_NOTE:
            raise Unreadable("feedback", f'a note of "{name}" has {len(note)} characters; at most {MAX_NOTE}', text)
        if _COORDINATES.search(note):
            raise Unreadable("feedback", f"the note {note!r} holds coordinates, which hold only for this scene", text)
    return tuple(dict.fromkeys(notes))
