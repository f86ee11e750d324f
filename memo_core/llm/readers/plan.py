"""Phase 1's answer: the next subtask, or DONE."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterator, Sequence
from typing import Any

from memo_core.llm.readers.json_objects import json_objects
from memo_core.llm.readers.unreadable import Unreadable, missing, spoken
from memo_core.skillbook.model.action_relations import default_actions
from memo_core.skillbook.model.keys import Key, NotAKey

WANTED = "answer with one line, ACTION(object), ACTION(object, place) or DONE"
NOT_IN_A_TABLE = frozenset(("table", "floor", "robot", "arm", "hand", "gripper"))  # there without being listed
MOST_NAMES = 12  # listed in a complaint

_DONE = re.compile(r"[\"'\[(<]*done(?:\(\s*\))?[\"'\])>]*[.!]?", re.IGNORECASE)
_SAYS_DONE = re.compile(r"\bDONE\b")
_NOT_YET = re.compile(r"\b(?:not|n't|never|until|unless|before|when|once|if|or)\b")
_CALL = re.compile(r"(?<![A-Za-z_])_*+([A-Za-z][A-Za-z_]*+(?:[ -][A-Za-z_]++){0,3})[ \t]*+\(([^()\n]++)\)")
_LONGEST_ACTION = 200  # characters
_LONGEST_NORMALISED = 2_000  # characters of a line; Unicode's normalisation may take the square of its length
_BETWEEN = re.compile(r"[\s,;.|&>+-]*(?:(?:->|=>|\u2192|then|and|next|DONE)[\s,;.|&>+-]*)*", re.IGNORECASE)
_LEAD = re.compile(
    r"^(?:the )?(?:next |current |following )?(?:sub-?task|step|action|plan|answer|output)s?\b[^:(]{0,30}:\s*", re.I
)


def read_plan(text: str, names: Sequence[str] | None = None) -> Key | None:
    """The next subtask, or None for DONE. ``names`` are the labels in the scene: an object named by a part of a label
    that no other label shares gets that label; an unknown object is refused with the closest names. Raises
    ``Unreadable``."""
    said = spoken("plan", text, WANTED)
    key = _first_subtask(said, text)
    return key if key is None or names is None else _in_scene(key, names, text)


def _first_subtask(said: str, text: str) -> Key | None:
    lines = [_bare_line(line) for line in said.splitlines() if not re.match(r"\s*(?:```|~~~)", line)]
    lines = [line for line in lines if line]
    problem = "it names no subtask"
    for line in lines:
        if _DONE.fullmatch(line):
            return None
        calls = list(_CALL.finditer(line))
        if calls and not _BETWEEN.sub("", _CALL.sub("", line).rstrip(".;")):
            try:  # a line of subtasks and nothing else: the first is the next
                return _key(calls[0], whole=True)
            except NotAKey as error:
                problem = str(error)
    for value in json_objects(said):
        try:
            key = _from_json(value)
        except NotAKey as error:
            problem = str(error)
            continue
        if key is not None:
            return key
    # Only where no line is an answer by itself, one within a sentence counts, the last: models think first.
    for line in reversed(lines):
        calls = list(_CALL.finditer(line))
        begins = calls and calls[0].start() == 0 and _is_shouted(calls[0].group(1))
        for call in calls[:1] if begins else reversed(calls):
            try:
                return _key(call, whole=False)
            except NotAKey as error:
                problem = str(error) if problem.startswith("it names") else problem
        if _SAYS_DONE.search(line) and not _not_done(line):
            return None
    raise missing("plan", problem, text, WANTED)


def _not_done(line: str) -> bool:
    """Whether a part of a sentence says something like "not DONE"."""
    for part in re.split("[.;]", line):
        said = [match.start() for match in _SAYS_DONE.finditer(part)]
        if said and _NOT_YET.search(part, 0, said[-1]):
            return True
    return False


def _bare_line(line: str) -> str:
    """A line without bullets, numbering, emphasis and a lead-in such as ``Next subtask:``."""
    bare = unicodedata.normalize("NFKC", line) if len(line) <= _LONGEST_NORMALISED else line
    bare = bare.replace("**", "").replace("`", "")
    bare = re.sub(r"^\s*(?:[-*+>#]+|\(?\d+[.):])\s+", "", bare).strip()
    bare = _LEAD.sub("", bare)
    return bare.strip("*_ \t")


def _is_shouted(action: str) -> bool:
    return bool(re.fullmatch(r"[A-Z][A-Z_]+(?:[ -][A-Z_]+)*", action))


def _key(call: re.Match[str], whole: bool) -> Key:
    """The subtask in a call expression. Within a sentence (not ``whole``) its action must be in capitals or a known
    verb, because the words before it may belong to the sentence. Raises ``NotAKey``."""
    action, inner = call.groups()
    if len(action) > _LONGEST_ACTION:
        raise NotAKey(call.group()[:_LONGEST_ACTION], "its action is no verb")
    if not whole and not _is_shouted(action):
        shouted = re.search(r"[A-Z][A-Z_]+(?:[ -][A-Z_]+)*$", action)
        action = shouted.group() if shouted else _known_verb(action, call.group())
    return Key.make(action, *_arguments(inner), source=call.group())


def _known_verb(action: str, source: str) -> str:
    words = re.split(r"[ _-]+", action.lower())
    for start in range(len(words)):
        verb = " ".join(words[start:])
        if verb in default_actions().groups:
            return verb
    raise NotAKey(source, "it is a remark in brackets")


def _arguments(inner: str) -> list[str]:
    """Objects as a model lists them: also quoted, named (``object="cup"``) and with arrows."""
    parts = re.split(r",|->|=>|\u2192|;", inner)
    return [re.sub(r"^\s*[A-Za-z_]+\s*[=:]\s*", "", part).strip(" \t\"'[]{}") for part in parts]


def _from_json(value: dict[str, Any]) -> Key | None:
    """``{"action": "OPEN", "object": "jar"}`` and similar forms; None for anything else. Raises ``NotAKey``."""
    lower = {str(key).lower().replace(" ", "_"): item for key, item in value.items()}
    action = next((lower[name] for name in ("action", "verb", "skill") if isinstance(lower.get(name), str)), "")
    if not action or "(" in action:
        return None
    objects: list[str] = []
    for name, item in lower.items():
        if re.fullmatch(r"objects?\d*|place|target|destination|arguments|args|parameters|where|to", name):
            items = item.values() if isinstance(item, dict) else item if isinstance(item, list) else [item]
            objects += [one for one in items if isinstance(one, str) and one.strip()]
    return Key.make(action, *objects)


# -- names ------------------------------------------------------------------------------------------------------------


def _in_scene(key: Key, names: Sequence[str], text: str) -> Key:
    """The key with the names used in the scene. Raises ``Unreadable``, with the closest names, for an unknown
    object."""
    known = dict(_spelt(names))
    found = []
    for name in key.objects:
        called = [name] if name in known or name in NOT_IN_A_TABLE else _called(name, known)
        if len(called) != 1:
            raise Unreadable("plan", _not_there(name, called, known), text)
        found.append(called[0])
    return Key(key.action, tuple(found))


def _spelt(names: Sequence[str]) -> Iterator[tuple[str, str]]:
    """(as a key spells it, as the scene does)."""
    for name in names:
        try:
            yield Key.make("see", name).objects[0], name
        except NotAKey:
            continue


def _called(name: str, known: dict[str, str]) -> list[str]:
    """The labels that contain all words of ``name``, those that end with it first; a number may be omitted."""
    words = name.split()
    ending = [label for label in known if label.split()[-len(words) :] == words]
    if len(ending) == 1:
        return ending
    return [label for label in known if set(words) <= set(label.split())]


def _not_there(name: str, called: Sequence[str], known: dict[str, str]) -> str:
    if called:
        return f"{name!r} may be {_listed([known[c] for c in called])}: use one of these names; {WANTED}"
    close = difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
    close += [label for label in known if set(label.split()) & set(name.split()) and label not in close]
    if close:
        problem = f"nothing in the scene is called {name!r}; the closest names are {_listed([known[c] for c in close])}"
    else:
        problem = f"nothing in the scene is called {name!r}; there are {_listed(list(known.values()))}"
    return f"{problem}. What cannot be seen may be inside something closed, which must be opened first; {WANTED}"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return (", ".join(repr(name) for name in names[:MOST_NAMES]) or "no things at all") + more
