"""Groups of programs and notes of several keys, and what may be made of them: functions, calls and fewer notes.

``problem_with`` enforces it whatever a model answers: every program and every note is accounted for, a function stands
for programs of at least two keys, amounts that people stated are kept, and characters never grow. So each program
stays one entry, its call; notes never become more; and there are at most half as many new functions as programs.
Whether a call does what its program did is not decided here, but by running it.
"""

from __future__ import annotations

import ast
import builtins
import re
from collections.abc import Collection, Iterator

import attrs

from memo_core.skillbook.consolidation.rules import amounts, words_of
from memo_core.skillbook.model.entries import Entry, key_label
from memo_core.skillbook.model.functions import (
    MOST_LINES,
    Function,
    NotACall,
    NotAFunction,
    problem_with_call,
    read_call,
    read_function,
)
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.model.template_rules import problem_with_template

MOST_BESIDE_NAMES = 80  # characters of a call, without those in its strings
LEAST_KEYS = 2  # that a function stands for
_AMOUNT_IN_CODE = re.compile(r"\d+(?:\.\d+)?")
_UNITS = (1.0, 100.0, 1000.0)  # an amount in cm or mm stands in code in m


@attrs.frozen
class Member:
    """A program that a function may stand for.

    Attributes:
        entry: a template, or a call of a function that is being refined.
        code: what runs: the template's text, or the function with the call (``as_program``).
        built: how the thing it acts on is built, in words; "" if unknown.
        tried: for each call that was tried for it before, "CALL failed: what was printed or raised".
    """

    entry: Entry
    code: str
    built: str = ""
    tried: tuple[str, ...] = ()

    @property
    def key(self) -> Key:
        return self.entry.key

    @property
    def calls(self) -> str:
        """The name of the function that the entry calls; "" for a template."""
        if self.entry.kind != "call":
            return ""
        try:
            return read_call(self.entry.text).function
        except NotACall:
            return ""


@attrs.frozen
class Group:
    """Programs of several keys that are generalised together, with the notes of these keys. ``functions`` are those in
    the book that are being refined; all their calls are among the members. Programs and notes are numbered from 1 in
    the order they have here."""

    members: tuple[Member, ...]
    notes: tuple[Entry, ...] = ()
    functions: tuple[Entry, ...] = ()

    @property
    def characters(self) -> int:
        """Characters of all entries. Of a call only its own text counts, and its function counts once."""
        entries = (*(member.entry for member in self.members), *self.notes, *self.functions)
        return sum(len(entry.text) for entry in entries)


@attrs.frozen
class NewFunction:
    """A function, and for each program it stands for the number of the program and the call that does its work."""

    code: str
    calls: tuple[tuple[int, str], ...]

    @property
    def name(self) -> str:
        """Raises ``NotAFunction``."""
        return read_function(self.code).name


@attrs.frozen
class Left:
    """A program that stays as it is."""

    number: int
    why: str = ""


@attrs.frozen
class MergedNote:
    """A note of the result and the numbers of the notes it derives from. It is kept for the keys of all of them."""

    text: str
    of: tuple[int, ...]


@attrs.frozen
class Generalised:
    """A model's proposal for a group, not yet checked.

    Attributes:
        functions: new functions, and those of the group that are written anew under the name they had.
        left: programs that stay as they are.
        notes: notes that are kept, merged or not.
        inside: for each note that says no more than a function does at every call, its number and the function's name.
    """

    functions: tuple[NewFunction, ...] = ()
    left: tuple[Left, ...] = ()
    notes: tuple[MergedNote, ...] = ()
    inside: tuple[tuple[int, str], ...] = ()

    def changes(self, group: Group) -> bool:
        """Whether anything would be different afterwards."""
        same = all(len(one.of) == 1 and group.notes[one.of[0] - 1].text == one.text for one in self.notes)
        return bool(self.functions or self.inside) or not same


def stays(group: Group, proposal: Generalised) -> tuple[Entry, ...]:
    """The functions of the group that stay as they are, because calls of them are left."""
    called = {group.members[one.number - 1].calls for one in proposal.left}
    return tuple(entry for entry in group.functions if name_of(entry) in called)


def problem_with(group: Group, proposal: Generalised, skill_names: Collection[str], taken: Collection[str]) -> str:
    """Why a proposal is refused, as one sentence for its author.

    Args:
        group: what it was made of.
        proposal: what is to replace it.
        skill_names: names of the robot's functions.
        taken: names of the functions in the book. A function of the group may be written anew under its name.

    Returns:
        The first problem; "" if there is none.
    """
    own = {name_of(entry) for entry in group.functions}
    return (
        _problem_with_functions(proposal, {*skill_names, *dir(builtins)}, {*taken} - own)
        or _problem_with_calls(proposal)
        or _problem_with_members(group, proposal)
        or _problem_with_coverage(group, proposal)
        or _problem_with_notes(group, proposal)
        or _problem_with_inside(group, proposal)
        or _problem_with_size(group, proposal)
    )


# -- functions and calls -----------------------------------------------------------------------------------------------


def _problem_with_functions(proposal: Generalised, of_robot: set[str], taken: set[str]) -> str:
    seen: set[str] = set()
    for one in proposal.functions:
        try:
            function = read_function(one.code)
        except NotAFunction as error:
            return str(error)
        name = function.name
        if problem := problem_with_template(one.code):
            return f"{name}: {problem}"
        lines = len(function.docstring.splitlines())
        if lines > MOST_LINES:
            return f"the docstring of {name} has {lines} lines; at most {MOST_LINES}"
        if name in of_robot:
            return f"the name {name} belongs to a function of the robot or of Python; choose another"
        if name in taken:
            return f"the name {name} belongs to another function learnt; choose another"
        if name in seen:
            return f"there are two functions {name}; give each a name of its own"
        seen.add(name)
    return ""


def _problem_with_calls(proposal: Generalised) -> str:
    for one in proposal.functions:
        function = read_function(one.code)
        for number, text in one.calls:
            if problem := _problem_with_call(function, text):
                return f"the call for program {number} cannot be used: {problem}"
    return ""


def _problem_with_call(function: Function, text: str) -> str:
    if len(text.strip().splitlines()) > 1:
        return "it has several lines; write it on one"
    try:
        if problem := problem_with_call(function, read_call(text)):
            return problem
    except NotACall as error:
        return str(error)
    beside = len(text.strip()) - _in_strings(text)
    if beside > MOST_BESIDE_NAMES:
        return (
            f"it has {beside} characters beside names; at most {MOST_BESIDE_NAMES}: what several calls give alike is "
            "better a default"
        )
    return ""


def _in_strings(call: str) -> int:
    values = [node.value for node in ast.walk(ast.parse(call.strip())) if isinstance(node, ast.Constant)]
    return sum(len(value) for value in values if isinstance(value, str))


# -- programs ----------------------------------------------------------------------------------------------------------


def _problem_with_members(group: Group, proposal: Generalised) -> str:
    seen: dict[int, str] = {}
    for number, where in _placed(proposal):
        if not 1 <= number <= len(group.members):
            return f"{where} names program {number}; there are programs 1 to {len(group.members)}"
        if number in seen:
            return f"program {number} stands twice, in {seen[number]} and in {where}; each program has one place"
        seen[number] = where
    missing = [str(number) for number in range(1, len(group.members) + 1) if number not in seen]
    if missing:
        return f'the programs {", ".join(missing)} have no call and are not in "left"; account for every program'
    names = {one.name for one in proposal.functions}
    for one in proposal.left:
        if (called := group.members[one.number - 1].calls) in names:
            return (
                f"program {one.number} is left, but is a call of {called}, which is written anew; give the call that "
                "does its work now, or give the new function another name"
            )
    return ""


def _placed(proposal: Generalised) -> Iterator[tuple[int, str]]:
    for one in proposal.functions:
        yield from ((number, f"the calls of {one.name}") for number, _ in one.calls)
    yield from ((one.number, '"left"') for one in proposal.left)


def _problem_with_coverage(group: Group, proposal: Generalised) -> str:
    for one in proposal.functions:
        keys = _keys_of(group, one)
        if len(keys) < LEAST_KEYS:
            stands_for = f"is for {key_label(next(iter(keys)))} only" if keys else "stands for no program"
            return (
                f"the function {one.name} {stands_for}; a function stands for programs of at least {LEAST_KEYS} keys: "
                "leave these programs"
            )
    return ""


def _keys_of(group: Group, function: NewFunction) -> set[Key]:
    return {group.members[number - 1].key for number, _ in function.calls}


# -- notes -------------------------------------------------------------------------------------------------------------


def _problem_with_notes(group: Group, proposal: Generalised) -> str:
    seen: set[int] = set()
    sources = [(f"the kept note {place}", one.of) for place, one in enumerate(proposal.notes, start=1)]
    for where, numbers in [*sources, *(('"inside"', (number,)) for number, _ in proposal.inside)]:
        if not numbers:
            return f"{where} derives from no number; nothing may be added that nobody said"
        for number in numbers:
            if not 1 <= number <= len(group.notes):
                return f"{where} names note {number}; " + _how_many(len(group.notes))
            if number in seen:
                return f"note {number} stands twice, again in {where}; each note has one place"
            seen.add(number)
    missing = [str(number) for number in range(1, len(group.notes) + 1) if number not in seen]
    if missing:
        return f'the notes {", ".join(missing)} are neither in "notes" nor in "inside"; account for every note'
    return next((problem for place, one in enumerate(proposal.notes, 1) if (problem := _lossy(group, place, one))), "")


def _how_many(notes: int) -> str:
    return f"there are notes 1 to {notes}" if notes else "there are no notes"


def _lossy(group: Group, place: int, one: MergedNote) -> str:
    """Why a kept note loses what one of its sources says; "" if it does not."""
    if not one.text.strip():
        return f"the kept note {place} has no text"
    for number in one.of:
        said = group.notes[number - 1].text
        if one.text.split() == said.split():
            continue
        if not words_of(one.text) & words_of(said):
            return f"the kept note {place} has no word in common with note {number}"
        if lost := sorted(amounts(said) - amounts(one.text)):
            return f"the kept note {place} loses the amount {lost[0]} of note {number}"
    return ""


def _problem_with_inside(group: Group, proposal: Generalised) -> str:
    functions = {one.name: one for one in proposal.functions}
    for number, name in proposal.inside:
        note = group.notes[number - 1]
        if name not in functions:
            known = f"functions of this answer: {', '.join(functions)}" if functions else "this answer has no functions"
            return f'"inside" gives note {number} to {name}; {known}'
        if note.key not in _keys_of(group, functions[name]):
            return f"note {number} is about {key_label(note.key)}, for which {name} has no call; keep it as a note"
        if lost := _not_in_code(note.text, functions[name].code):
            return f"note {number} states {lost}, which does not stand in {name}; keep it as a note, or use it there"
    return ""


def _not_in_code(said: str, code: str) -> str:
    """The first amount of a note that code has neither as it is nor in metres; "" if it has all."""
    have = {float(number) for number in _AMOUNT_IN_CODE.findall(code)}
    for amount in sorted(amounts(said)):
        value = float(amount.replace(",", "."))
        if not any(abs(value / unit - number) <= 1e-9 for unit in _UNITS for number in have):
            return amount
    return ""


# -- size --------------------------------------------------------------------------------------------------------------


def _problem_with_size(group: Group, proposal: Generalised) -> str:
    texts = [
        *(one.code.strip() for one in proposal.functions),
        *(text for one in proposal.functions for _, text in one.calls),
        *(group.members[one.number - 1].entry.text for one in proposal.left),
        *(entry.text for entry in stays(group, proposal)),
        *(one.text for one in proposal.notes),
    ]
    characters = sum(map(len, texts))
    if characters > group.characters:
        return (
            f"functions, calls, what is left and notes have {characters} characters together, more than the "
            f"{group.characters} there were; write less"
        )
    return ""


def name_of(function: Entry) -> str:
    """The name of the function that an entry holds; "" if it holds none."""
    try:
        return read_function(function.text).name
    except NotAFunction:
        return ""
