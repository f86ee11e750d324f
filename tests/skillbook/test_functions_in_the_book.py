"""Functions with their calls in a book: stored as one revision, called by later approvals, edited and undone.

Functions here are made without a model, of templates that differ in defaults only.
"""

from __future__ import annotations

import attrs
import pytest

from memo_core.errors import InvalidArgument
from memo_core.skillbook import history
from memo_core.skillbook.functions import functions_of, merge_programs, program_behind, store
from memo_core.skillbook.model.functions import GeneralFunction, as_template
from memo_core.skillbook.track_record import evidence_of, note_trial, trials_of
from memo_core.skillbook.writing.functions import FUNCTIONS, GroupChange, GroupChanged, WiderNote
from tests.support.cluster_books import approve, new_book, teach
from tests.support.function_books import (
    FRIDGE,
    MICROWAVE,
    OVEN,
    active,
    approve_call,
    exported,
    merged,
    program,
    programs,
    teach_doors,
    tree,
)

MICROWAVE_CALL, OVEN_CALL, FRIDGE_CALL = (f"open_hinged('{thing} door')" for thing in ("microwave", "oven", "fridge"))


@pytest.fixture
def book():
    with new_book() as opened:
        yield opened


# -- storing -----------------------------------------------------------------------------------------------------------
def test_a_function_and_its_calls_are_one_revision_that_retires_the_templates(book) -> None:
    teach_doors(book)
    before, generation = programs(book), book.generation()
    [made] = merge_programs(book, ())
    assert (made.entries_before, made.entries_after) == (2, 3)
    assert made.characters_after == sum(len(text) for _, _, text in active(book)) < made.characters_before
    revision = history.revision(book, made.revision)
    assert revision.reason == FUNCTIONS and (revision.count("added"), revision.count("superseded")) == (3, 2)
    [learnt] = functions_of(book)
    assert [(str(call.key), call.text) for call in learnt.calls] == [(MICROWAVE, MICROWAVE_CALL), (OVEN, OVEN_CALL)]
    assert programs(book) == before and book.generation() > generation and not book.problems()
    assert [e.id for e in history.difference(book, made.revision).removed] == [e.id for e in made.members]
    gone = {str(one.entry.key): (one.why, one.because) for one in revision.changes if one.change == "superseded"}
    assert gone == {str(call.key): ("open_hinged does it", call.id) for call in learnt.calls}


def test_a_call_keeps_scene_uses_and_record_of_its_program_and_derives_from_all_people(book) -> None:
    approval = book.record_feedback("", "ana", subtask=MICROWAVE, kind="approval")
    first = book.add_template(approval, MICROWAVE, program("microwave"), "kitchen")
    approve(book, OVEN, program("oven"), "ben")
    book.note_use([first.id], True, MICROWAVE)
    book.note_use([first.id], False, FRIDGE)
    note_trial(book, first.id, "run one", True)
    used = book.entry(first.id)
    merged(book)
    [learnt] = functions_of(book)
    call, other = learnt.calls
    assert (call.scene, call.uses, call.confirmed_uses, call.created) == ("kitchen", 2, 1, used.created)
    assert (other.scene, other.uses) == ("", 0) and learnt.entry.uses == 0
    assert [(str(one.key), one.served, one.approved) for one in evidence_of(book, call.id)] == [
        (MICROWAVE, 1, 1),
        (FRIDGE, 1, 0),
    ]
    assert evidence_of(book, other.id) == []
    assert all(book.sources([one.id]) == [1, 2] for one in (learnt.entry, *learnt.calls))
    assert program_behind(book, call) == book.entry(first.id)
    assert trials_of(book, [call.id]) == {}, "a trial of the template says nothing of the call"


def test_trials_of_calls_are_stored_with_them(book) -> None:
    first, second = teach_doors(book)
    function = GeneralFunction(program("oven", name="open_it"), ((first, "open_it('a')"), (second, "open_it()")))
    store(
        book, GroupChange((function,), trials={first: [("run one", True, ""), ("seed 2", False, "dropped")]}), "model"
    )
    [learnt] = functions_of(book)
    [(call, trials)] = trials_of(book).items()
    assert call == learnt.calls[0].id
    assert [(t.start, t.success, t.reason) for t in trials] == [("run one", True, ""), ("seed 2", False, "dropped")]
    assert history.revisions(book)[-1].reason == "functions by model"


def function_of(*calls: int, name: str = "open_hinged") -> GeneralFunction:
    return GeneralFunction(program("oven", name=name), tuple((entry, f"{name}()") for entry in calls))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda a, b, note: GroupChange((function_of(a, b),)), "name open_hinged is taken"),
        (lambda a, b, note: GroupChange((function_of(a, name="f"), function_of(b, name="f"))), "name f is taken"),
        (lambda a, b, note: GroupChange((function_of(a, b, a, name="f"),)), "named twice"),
        (lambda a, b, note: GroupChange(notes=(WiderNote("Slowly.", (note, note)),)), "named twice"),
        (lambda a, b, note: GroupChange((function_of(a, note, name="f"),)), "is a correction"),
        (lambda a, b, note: GroupChange(notes=(WiderNote("Slowly.", (a, note)),)), "is a template"),
        (lambda a, b, note: GroupChange((function_of(a, b, name="f"),), (note,)), "is a correction"),
        (lambda a, b, note: GroupChange((function_of(a, 1, name="f"),)), "entry 1 is not active"),
        (lambda a, b, note: GroupChange((function_of(a, 99, name="f"),)), "entry 99 is not active"),
    ],
)
def test_a_change_that_does_not_fit_the_book_writes_nothing(book, change, said: str) -> None:
    teach_doors(book)
    merged(book)
    first, second = teach_doors(book, "OPEN(chest)", "OPEN(crate)")
    [note] = teach(book, OVEN, "Slowly.")
    before, generation = exported(book), book.generation()
    with pytest.raises(GroupChanged, match=said):
        store(book, attrs.evolve(change(first, second, note), considered=(first, second)))
    assert exported(book) == before and book.generation() == generation
    [made] = merge_programs(book, ())
    assert made.revision, "a group about which nothing was written is not considered"


def test_a_function_with_a_call_that_the_change_does_not_know_is_not_replaced(book) -> None:
    teach_doors(book)
    merged(book)
    [learnt] = functions_of(book)
    since = approve_call(book, FRIDGE, FRIDGE_CALL)
    function = GeneralFunction(
        program("oven", name="open_hinged"), tuple((call.id, call.text) for call in learnt.calls)
    )
    with pytest.raises(GroupChanged, match=f"entry {since.id} calls"):
        store(book, GroupChange((function,), (learnt.entry.id,)))
    assert len(functions_of(book)[0].calls) == 3


def test_a_group_is_considered_once_unless_it_changes_or_is_asked_for_again(book) -> None:
    first, second = teach_doors(book)
    assert [one.revision for one in merge_programs(book, (), commit=False)] == [None]
    assert book.entries("function") == []
    history.roll_back(book, merged(book))
    assert merge_programs(book, ()) == [] and [e.id for e in book.entries("template")] == [first, second]
    history.roll_back(book, merged(book, again=True))
    third = approve(book, FRIDGE, program("fridge"))
    [made] = merge_programs(book, ())
    assert [entry.id for entry in made.members] == [first, second, third], "the group is another one"
    assert merge_programs(book, (), again=True) == [], "there is nothing left to do"


def test_a_later_template_becomes_a_further_call_of_the_function(book) -> None:
    teach_doors(book)
    merged(book)
    [before] = functions_of(book)
    approve(book, FRIDGE, program("fridge", 70, "open_fridge"), "cleo")
    [made] = merge_programs(book, ("open_hinged_2",))
    [after] = functions_of(book)
    assert made.functions == (before.entry,) and after.function.name == "open_hinged"
    assert [str(call.key) for call in after.calls] == [MICROWAVE, OVEN, FRIDGE]
    assert after.calls[2].text == "open_hinged('fridge door', angle=70)"
    assert book.entry(before.entry.id).superseded_by == made.revision and book.sources([after.entry.id]) == [1, 2, 3]
    history.roll_back(book, made.revision)
    assert functions_of(book) == [before] and len(book.entries("template")) == 1


def test_another_function_does_not_get_the_name_of_one_in_the_book_or_of_the_robot(book) -> None:
    teach_doors(book)
    merged(book)
    for thing in ("tap", "lamp"):
        approve(book, f"TURN_ON({thing})", program(thing).replace("lead_along_arc", "turn"))
    [made] = merge_programs(book, ("open_hinged_2",))
    assert made.change.functions[0].name == "open_hinged_3"


def test_a_new_version_takes_the_place_of_a_call_and_its_function_stays(book) -> None:
    teach_doors(book)
    merged(book)
    newer = approve(book, OVEN, program("oven").replace("look()", "wait()"))
    [learnt] = functions_of(book)
    assert [str(call.key) for call in learnt.calls] == [MICROWAVE]
    assert [v.state for v in history.versions(book, OVEN)] == ["superseded", "superseded", "served"]
    found = book.retrieve(OVEN)
    assert [one.entry.id for one in found.templates] == [newer]


# -- calls that are approved -------------------------------------------------------------------------------------------
def test_an_approved_call_is_kept_as_it_is(book) -> None:
    teach_doors(book)
    merged(book)
    entry = approve_call(book, FRIDGE, FRIDGE_CALL)
    assert (entry.kind, entry.text) == ("call", FRIDGE_CALL) and book.pending_feedback() == []
    assert approve_call(book, FRIDGE, FRIDGE_CALL, "dora").id == entry.id, "its approval becomes a further source"
    assert len(book.sources([entry.id])) == 2
    [function] = book.retrieve(FRIDGE).functions
    assert function.calls[0].entry.id == entry.id
    assert tree(function.as_template().text) == tree(program("fridge"))


@pytest.mark.parametrize(
    ("call", "said"), [("open_hinged(door, 85)", "literal"), ("shut('a')", "calls shut"), ("open_hinged(a=1)", "so")]
)
def test_a_call_that_its_function_does_not_take_is_refused(book, call: str, said: str) -> None:
    teach_doors(book)
    merged(book)
    with pytest.raises(InvalidArgument, match=said):
        approve_call(book, FRIDGE, call)
    assert len(functions_of(book)[0].calls) == 2


def test_only_a_function_is_called(book) -> None:
    [template, _] = teach_doors(book)
    with pytest.raises(InvalidArgument, match="function"):
        approve_call(book, FRIDGE, FRIDGE_CALL, function=template)


def test_a_call_of_a_function_that_was_retired_meanwhile_is_kept_as_a_template(book) -> None:
    teach_doors(book)
    revision = merged(book)
    [learnt] = functions_of(book)
    history.roll_back(book, revision)
    entry = approve_call(book, FRIDGE, "open_hinged('fridge door', angle=70)", function=learnt.entry.id)
    assert entry.kind == "template" and tree(entry.text) == tree(program("fridge", 70))
    assert [one.entry.id for one in book.retrieve(FRIDGE).templates][:1] == [entry.id]


# -- people's changes --------------------------------------------------------------------------------------------------
def test_an_edited_function_keeps_its_calls_and_an_edited_call_its_function(book) -> None:
    teach_doors(book)
    merged(book)
    [before] = functions_of(book)
    edited = book.edit(before.entry.id, before.entry.text.replace("look()", "wait()"), "dora")
    [after] = functions_of(book)
    assert after.entry == edited and after.calls == before.calls
    call = book.edit(after.calls[0].id, "open_hinged('microwave door', angle=60)", "dora")
    assert {one.id for one in functions_of(book)[0].calls} == {call.id, before.calls[1].id}
    assert tree(as_template(edited.text, call.text)) in programs(book)[MICROWAVE]
    with pytest.raises(InvalidArgument, match="open_hinged"):
        book.edit(edited.id, edited.text.replace("open_hinged", "open_it"), "dora")
    with pytest.raises(InvalidArgument, match="cannot be called so"):
        book.edit(call.id, "open_hinged(x=1)", "dora")
    with pytest.raises(InvalidArgument, match="2 programs call it"):
        book.remove(edited.id, "dora")


def test_a_function_that_nothing_calls_is_edited_to_a_function_of_a_free_name_only(book) -> None:
    teach_doors(book)
    merged(book)
    for call in functions_of(book)[0].calls:
        book.remove(call.id, "dora")
    teach_doors(book, "OPEN(chest)", "OPEN(crate)")
    merged(book)
    unused, other = functions_of(book)
    assert (unused.calls, other.function.name) == ((), "open_hinged_2")
    for text in (unused.entry.text.replace("open_hinged", "open_hinged_2"), "look()", "def f():\n    look()\n"):
        with pytest.raises(InvalidArgument):
            book.edit(unused.entry.id, text, "dora")
    book.edit(unused.entry.id, unused.entry.text.replace("open_hinged", "swing"), "dora")
    assert [one.function.name for one in functions_of(book)] == ["open_hinged_2", "swing"]
    book.remove(functions_of(book)[1].entry.id, "dora")
    assert len(functions_of(book)) == 1


def test_a_call_that_comes_back_without_its_function_is_a_template(book) -> None:
    """Revisions that retired a function may be undone in another order than they were made."""
    teach_doors(book)
    revision = merged(book)
    approve_call(book, FRIDGE, FRIDGE_CALL)
    newer = history.revision(
        book, book.entry(approve(book, FRIDGE, program("fridge").replace("look", "wait"))).revision
    )
    history.roll_back(book, revision)
    history.roll_back(book, newer.id)
    assert programs(book)[FRIDGE] == {tree(program("fridge"))} and functions_of(book) == []
    history.roll_back(book, history.revisions(book)[-2].id)
    assert programs(book)[FRIDGE] == {tree(program("fridge"))} and len(functions_of(book)[0].calls) == 2
    assert merge_programs(book, (), again=True), "it joins the others again"


def test_a_call_that_its_edited_function_does_not_take_any_more_comes_back_as_a_template(book) -> None:
    teach_doors(book)
    merged(book)
    approve_call(book, FRIDGE, "open_hinged('fridge door', angle=70)")
    newer = book.entry(approve(book, FRIDGE, program("fridge").replace("look", "wait"))).revision
    function = functions_of(book)[0].entry
    book.edit(function.id, function.text.replace("angle=85", "turn=85").replace("angle)", "turn)"), "dora")
    history.roll_back(book, newer)
    assert programs(book)[FRIDGE] == {tree(program("fridge", 70))} and len(functions_of(book)[0].calls) == 2
