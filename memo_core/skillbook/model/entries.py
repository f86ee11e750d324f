"""The contents of the book as values: feedback as it was given, and the entries made from it."""

from __future__ import annotations

import ast
import re
from functools import lru_cache
from typing import Literal

import attrs

from memo_core.errors import InvalidArgument
from memo_core.skillbook.model.functions import LONGEST_CALL
from memo_core.skillbook.model.keys import Key
from memo_core.text.reading_limits import LONGEST_CODE, LONGEST_WORDS

EntryKind = Literal["correction", "general", "template", "function", "call"]
NOTE_KINDS = ("correction", "general")
PROGRAM_KINDS = ("template", "call")  # of which each key has one for each way its things are built
KINDS = (*NOTE_KINDS, "template", "function", "call")
FeedbackKind = Literal["correction", "approval", "edit"]  # edit: the text that somebody put in place of an entry's
Status = Literal["pending", "processed", "parked", "kept"]  # kept: nothing is to be made of it (a run of memo-s)
Outcome = Literal["accepted", "reworded", "struck"]

_SENTENCE = re.compile(r".+?[.!?](?=\s+[A-Z]|$)|.+")
_WORD = re.compile(r"[^\W\d]+")
_FUNCTION = re.compile(r'def (\w+)\([^()"\'#]*\)(?: -> \w+)?:\n\s+"""([^"\\]*)"""\s*\n')

GLOBAL_KEY = Key("", ())  # all general statements share it


@attrs.frozen
class Feedback:
    """What a person said, verbatim, with what they were looking at. An approval may have no words."""

    id: int
    kind: str  # FeedbackKind
    words: str
    who: str
    time: float  # s since the epoch
    task: str
    subtask: str
    scene: str  # the scene's label
    scene_graph: str
    code: str
    run: str
    status: str  # Status
    reason: str  # why it is parked or kept


@attrs.frozen
class Note:
    """One note to be stored, with its key; the notes of one remark may belong to several subtasks. General statements
    have ``GLOBAL_KEY``."""

    key: Key
    text: str = attrs.field()

    @text.validator
    def _not_empty(self, attribute: attrs.Attribute[str], value: str) -> None:
        if not value.strip():
            raise InvalidArgument(
                "general" if self.key == GLOBAL_KEY else "correction", "an entry without text", "a text"
            )


@attrs.frozen
class Reaction:
    """A person's reaction to a note that was read back to them: accepted, reworded (``text``), or struck."""

    entry: int
    outcome: Outcome = attrs.field(validator=attrs.validators.in_(("accepted", "reworded", "struck")))
    text: str = ""

    def __attrs_post_init__(self) -> None:
        if self.outcome == "reworded" and not self.text.strip():
            raise InvalidArgument("text", "a note is reworded to nothing", "the new wording, or outcome 'struck'")


@attrs.frozen
class KeptReadBack:
    """A stored read-back. ``entry`` is None if that entry was deleted."""

    feedback: int
    entry: int | None
    who: str
    time: float  # s since the epoch
    outcome: Outcome
    note: str  # as it was read back
    text: str  # as it was reworded; "" otherwise


@attrs.frozen
class Entry:
    """One correction, general statement, template, function, or call of a function. ``revision`` added it,
    ``superseded_by`` is the revision that retired it."""

    id: int
    kind: str  # EntryKind
    key: Key  # GLOBAL_KEY for general statements and functions
    text: str
    scene: str  # label of the scene it was taught in
    feedback: int | None  # where it came from
    revision: int
    superseded_by: int | None
    uses: int  # times it was served to code that ran
    confirmed_uses: int  # times that code was approved
    created: float  # s since the epoch


def longest_entry(kind: str) -> int:
    """The most characters of an entry that goes into a prompt."""
    if kind == "call":
        return LONGEST_CALL
    return LONGEST_CODE if kind in ("template", "function") else LONGEST_WORDS


def headline(kind: str, text: str) -> str:
    """One line of an entry for a list: for a template or function, its name and the first sentence of its docstring."""
    if kind not in ("template", "function"):
        return " ".join(text.split())
    try:
        functions = [node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        functions = []
    if not functions:
        return (text.strip().splitlines() or [""])[0]
    said = (ast.get_docstring(functions[0]) or "").strip().partition("\n\n")[0]
    sentence = _SENTENCE.match(" ".join(said.split()))
    return f"{functions[0].name}: {sentence[0]}" if sentence else functions[0].name


@lru_cache(maxsize=20_000)
def spoken(kind: str, text: str) -> str:
    """The text of an entry for comparison with other texts: for a template or function, its name and docstring, or
    else its code; for a call, its words."""
    if kind == "call":
        return " ".join(_WORD.findall(text.replace("_", " ")))
    if kind not in ("template", "function"):
        return text
    if plain := _FUNCTION.match(text):  # as templates usually begin; parsing takes twenty times as long
        return " ".join([plain[1].replace("_", " "), *plain[2].split()])
    try:
        functions = [node for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        functions = []
    if not functions:
        return text
    return " ".join([functions[0].name.replace("_", " "), *(ast.get_docstring(functions[0]) or "").split()])


@attrs.frozen
class Stats:
    """Counts of a book."""

    feedback: int
    pending: int
    parked: int
    people: int
    keys: int
    corrections: int
    general: int
    templates: int
    functions: int
    calls: int
    superseded: int
    characters: int  # of the valid entries
    generation: int
    embedder: str
    bytes: int  # of the database file; 0 where there is none


@attrs.frozen
class Forgotten:
    """What ``forget`` removed. ``rewritten`` and ``deleted`` are files outside the book; ``unreached`` has one line for
    each place where words may remain."""

    who: str
    feedback: int
    entries: int
    keys: int
    rewritten: tuple[str, ...] = ()
    deleted: tuple[str, ...] = ()
    unreached: tuple[str, ...] = ()


def key_label(key: Key) -> str:
    """The key as shown in prompts and tables; all general statements share one."""
    return str(key) if key.objects else "*"


def same_words(text: str) -> str:
    """A text without case, spaces and the last full stop, for comparing notes."""
    return " ".join(text.casefold().split()).rstrip(". ")
