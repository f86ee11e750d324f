"""Whatever is proposed for a group of programs and notes: nothing is lost, and the book never grows."""

from __future__ import annotations

import re

import attrs
import pytest

from memo_core.skillbook.consolidation.function_rules import (
    Generalised,
    Group,
    Left,
    MergedNote,
    NewFunction,
    problem_with,
    stays,
)
from tests.support.groups import CALLS, NOTES, OPENED, SKILLS, call, doors, entry, refinement, template

GROUP = doors()
FUNCTION = NewFunction(OPENED, tuple(enumerate(CALLS, start=1)))
MERGED = MergedNote("Lead the handle along an arc, by 85 degrees.", (1, 2))
GOOD = Generalised((FUNCTION,), (), (MERGED,), ((3, "open_hinged"),))


def problem(proposal: Generalised, group: Group = GROUP, taken: tuple[str, ...] = ("pour",)) -> str:
    return problem_with(group, proposal, SKILLS, taken)


def with_code(code: str) -> Generalised:
    return attrs.evolve(GOOD, functions=(attrs.evolve(FUNCTION, code=code),))


def with_calls(*calls: tuple[int, str], left: tuple[Left, ...] = ()) -> Generalised:
    return attrs.evolve(GOOD, functions=(attrs.evolve(FUNCTION, calls=calls),), left=left)


def without_notes(*functions: NewFunction, left: tuple[Left, ...] = ()) -> Generalised:
    return Generalised(functions, left)


def test_a_function_with_a_call_for_each_program_is_accepted():
    assert problem(GOOD) == "" and GOOD.changes(GROUP)


def test_leaving_everything_as_it_is_is_accepted():
    nothing = Generalised(
        left=(Left(1), Left(2), Left(3)), notes=tuple(MergedNote(text, (n,)) for n, (_, text) in enumerate(NOTES, 1))
    )
    assert problem(nothing) == "" and not nothing.changes(GROUP)


def test_programs_without_notes_become_a_function_and_calls():
    assert problem(without_notes(FUNCTION), doors(notes=False)) == ""


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("def open_hinged(door:\n", "does not parse"),
        (OPENED + "\n\ndef other(a):\n    '''x'''\n    look()\n", "single function"),
        ("def open_hinged(door, angle=85):\n    look()\n", "no docstring"),
        (OPENED.replace("get_position(door)", "[0.45, 0.1, 0.2]"), r"open_hinged: line 7: \[0.45, 0.1, 0.2\]"),
        (
            OPENED.replace("degrees.", "degrees." + "\n    more" * 8),
            "docstring of open_hinged has 11 lines; at most 10",
        ),
        (OPENED.replace("open_hinged", "look"), "name look belongs to a function of the robot"),
        (OPENED.replace("open_hinged", "print"), "name print belongs to a function of the robot or of Python"),
        (OPENED.replace("open_hinged", "pour"), "name pour belongs to another function learnt"),
    ],
)
def test_a_function_that_is_none_is_refused(code, said):
    assert re.search(said, problem(with_code(code)))


def test_two_functions_of_one_name_are_refused():
    assert "two functions open_hinged" in problem(attrs.evolve(GOOD, functions=(FUNCTION, FUNCTION)))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("open_hinged(door)", "program 3 cannot be used: an argument is not a literal"),
        ("open_hinged('oven door', angle=-1e999)", "program 3 cannot be used: an argument is not a finite number"),
        ("open_hinged('a'); look()", "does not parse"),
        ("open_other('a')", "it calls open_other"),
        ("open_hinged('a', side='left')", "cannot be called so: got an unexpected keyword argument 'side'"),
        ("open_hinged()", "missing a required argument: 'door'"),
        ("open_hinged(\n'a')", "several lines"),
        (f"open_hinged('a', angle=85.{'0' * 60})", "it has 86 characters beside names; at most 80"),
        (f"open_hinged('{'a' * 300}')", "at most 300"),
    ],
)
def test_a_call_that_is_none_is_refused(text, said):
    assert said in problem(with_calls((1, CALLS[0]), (2, CALLS[1]), (3, text)))


def test_a_long_name_may_make_a_call_longer():
    text = "open_hinged('door of the tall cabinet with the two round knobs on the left of the oven', angle=80)"
    assert len(text) > 80 and problem(with_calls((1, CALLS[0]), (2, CALLS[1]), (3, text))) == ""


@pytest.mark.parametrize(
    ("calls", "left", "said"),
    [
        ((1, 2), (), "the programs 3 have no call"),
        ((1, 2, 3), (3,), "program 3 stands twice"),
        ((1, 2, 3, 3), (), "program 3 stands twice, in the calls of open_hinged"),
        ((1, 2, 3, 4), (), "names program 4; there are programs 1 to 3"),
        ((1, 2, 0), (), "names program 0"),
        ((1,), (2, 3), "open_hinged is for OPEN(microwave) only"),
        ((), (1, 2, 3), "open_hinged stands for no program"),
    ],
)
def test_every_program_has_one_place_and_a_function_several_keys(calls, left, said):
    proposal = with_calls(*((n, CALLS[0]) for n in calls), left=tuple(map(Left, left)))
    assert said in problem(proposal)


def test_two_programs_of_one_key_make_no_function():
    group = Group((template(1, "oven"), template(2, "oven", 60)))
    function = NewFunction(OPENED, ((1, CALLS[1]), (2, CALLS[1])))
    assert "is for OPEN(oven) only; a function stands for programs of at least 2 keys" in problem(
        without_notes(function), group
    )


@pytest.mark.parametrize(
    ("notes", "inside", "said"),
    [
        ((MERGED,), (), "the notes 3 are neither"),
        ((MERGED, MergedNote(NOTES[2][1], (3,))), ((3, "open_hinged"),), "note 3 stands twice"),
        ((MERGED, MergedNote("Be gentle.", ())), ((3, "open_hinged"),), "kept note 2 derives from no number"),
        ((MERGED, MergedNote("Be gentle.", (4,))), ((3, "open_hinged"),), "names note 4; there are notes 1 to 3"),
        ((attrs.evolve(MERGED, text=" "),), ((3, "open_hinged"),), "kept note 1 has no text"),
        ((attrs.evolve(MERGED, text="Be gentle: 85."),), ((3, "open_hinged"),), "no word in common with note 1"),
        ((attrs.evolve(MERGED, text=NOTES[0][1]),), ((3, "open_hinged"),), "loses the amount 85 of note 2"),
        ((MERGED,), ((3, "pull"),), '"inside" gives note 3 to pull; functions of this answer: open_hinged'),
    ],
)
def test_every_note_has_one_place_and_keeps_its_amounts(notes, inside, said):
    assert said in problem(attrs.evolve(GOOD, notes=notes, inside=inside))


def test_a_note_inside_a_function_keeps_its_amount_as_it_is_or_in_metres():
    said = "note 3 states 2, which does not stand in open_hinged"
    assert said in problem(with_code(OPENED.replace("2 cm of room", "room").replace("0.02", "0.03")))
    assert problem(with_code(OPENED.replace("2 cm of room", "room"))) == ""
    assert problem(with_code(OPENED.replace("0.02", "ROOM"))) == ""


def test_a_note_about_something_else_than_the_calls_stays_a_note():
    group = attrs.evolve(GROUP, notes=(*GROUP.notes[:2], entry(9, "correction", "OPEN(jar)", NOTES[2][1])))
    assert "note 3 is about OPEN(jar), for which open_hinged has no call" in problem(GOOD, group)


def test_what_is_left_needs_room_and_characters_never_grow():
    long = OPENED + f"    # {'x' * GROUP.characters}\n"
    assert f"more than the {GROUP.characters} there were" in problem(with_code(long))
    room = GROUP.characters - sum(map(len, [OPENED.strip(), *CALLS, MERGED.text]))
    fits = OPENED + "    #" + "x" * (room - 6) + "\n"
    assert problem(with_code(fits)) == "" and problem(with_code(fits.replace("#x", "#xx"))) != ""


# -- functions written anew --------------------------------------------------------------------------------------------


def test_a_function_of_the_group_is_written_anew_under_its_name():
    assert problem(without_notes(FUNCTION), refinement(), ("open_hinged", "pour")) == ""


def test_a_call_of_a_function_that_is_written_anew_cannot_be_left():
    anew = without_notes(attrs.evolve(FUNCTION, calls=((1, CALLS[0]), (3, CALLS[2]))), left=(Left(2),))
    assert "program 2 is left, but is a call of open_hinged" in problem(anew, refinement())


def test_a_function_stays_and_counts_while_a_call_of_it_is_left():
    other = NewFunction(OPENED.replace("open_hinged", "swing"), ((1, "swing('a')"), (3, "swing('b')")))
    proposal = without_notes(other, left=(Left(2),))
    assert stays(refinement(), proposal) == refinement().functions
    assert stays(refinement(), without_notes(FUNCTION)) == ()
    assert "characters together" in problem(proposal, refinement())


def test_a_function_counts_once_however_many_calls_it_has():
    group = refinement()
    more = attrs.evolve(group, members=(*group.members, call(5, "OPEN(jar)", CALLS[0])))
    assert more.characters - group.characters == len(CALLS[0])
