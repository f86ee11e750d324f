"""Functions, calls and notes of several keys when a person withdraws, in another book, in an older one and left out."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path
from typing import Any

import pytest

from memo_core.skillbook import consolidating, exchange, history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.functions import consolidated_groups, functions_of, merge_notes, merge_programs, store
from memo_core.skillbook.model.functions import GeneralFunction
from memo_core.skillbook.sharing.import_records import BadImport
from memo_core.skillbook.stats import stats_of
from memo_core.skillbook.track_record import evidence_of
from memo_core.skillbook.writing.functions import GroupChange, WiderNote
from tests.support.cluster_books import approve, new_book, teach
from tests.support.function_books import (
    FRIDGE,
    MICROWAVE,
    OVEN,
    active,
    approve_call,
    content,
    exported,
    merged,
    program,
    programs,
    teach_doors,
    tree,
)

JAR = "OPEN(jar)"
FRIDGE_CALL = "open_hinged('fridge door', angle=70)"
ZEBRA = program("zebra", 33, "open_zebra", "Open what ana calls zebra.")


@pytest.fixture
def book():
    with new_book() as opened:
        yield opened


def kinds(book: Skillbook) -> list[tuple[str, str]]:
    return [(kind, key) for kind, key, _ in active(book)]


# -- withdrawing -------------------------------------------------------------------------------------------------------
def test_who_withdraws_takes_the_function_and_gives_back_the_others_templates(tmp_path: Path) -> None:
    path, file = tmp_path / "book.db", tmp_path / "export.jsonl"
    with new_book(str(path)) as book:
        bens = approve(book, OVEN, program("oven"), "ben")
        approve(book, MICROWAVE, ZEBRA, "ana")
        merged(book)
        [learnt] = functions_of(book)
        assert "zebra" in learnt.entry.text and "zebra" in learnt.calls[1].text
        book.retrieve(MICROWAVE), book.search("zebra")
        file.write_text("".join(json.dumps(record) + "\n" for record in exported(book)))
        book.note_place("export", file)
        book.forget("ana")
        assert [entry.id for entry in book.entries()] == [bens] and book.problems() == []
        assert book.retrieve(MICROWAVE).functions == ()
        assert [one.entry.id for one in book.retrieve(MICROWAVE).templates] == [bens]
    left = b"".join(one.read_bytes() for one in tmp_path.iterdir())
    assert b"zebra" not in left, "the code, its name or a reason that quotes it is still there"


def test_a_name_of_a_function_that_goes_is_in_no_reason(tmp_path: Path) -> None:
    path = tmp_path / "book.db"
    with new_book(str(path)) as book:
        anas = book.record_feedback("", "ana", kind="approval")
        for key in (OVEN, MICROWAVE):
            approval = book.record_feedback("", "ben", subtask=key, kind="approval")
            book.add_template(approval, key, program(key[5:-1]), derived_from=[anas])
        function = GeneralFunction(
            ZEBRA, ((1, "open_zebra('oven door', angle=85)"), (2, "open_zebra('microwave door', angle=85)"))
        )
        store(book, GroupChange((function,)))
        book.forget("ana")
        assert [entry.id for entry in book.entries()] == [1, 2]
    assert b"zebra" not in b"".join(one.read_bytes() for one in tmp_path.iterdir())


def test_a_call_that_somebody_else_approved_later_stays_as_a_template(book) -> None:
    teach_doors(book)
    merged(book)
    mine = approve_call(book, FRIDGE, FRIDGE_CALL, "cleo")
    book.note_use([mine.id], True, FRIDGE)
    book.forget("ana")
    assert kinds(book) == [("template", OVEN), ("template", FRIDGE)]
    assert programs(book) == {OVEN: {tree(program("oven"))}, FRIDGE: {tree(program("fridge", 70))}}
    assert book.entry(mine.id).uses == 1 and len(evidence_of(book, mine.id)) == 1
    assert book.retrieve(FRIDGE).templates[0].entry.id == mine.id
    assert len(merged_entries(book)) == 2, "the next consolidation rebuilds the rest"


def merged_entries(book: Skillbook) -> list[str]:
    merged(book)
    return [call.text for call in functions_of(book)[0].calls]


def test_an_export_that_the_book_knows_of_is_rewritten_as_the_book_is(book, tmp_path: Path) -> None:
    file = tmp_path / "export.jsonl"
    teach_doors(book)
    merged(book)
    approve_call(book, FRIDGE, FRIDGE_CALL, "cleo")
    approve_call(book, MICROWAVE, functions_of(book)[0].calls[0].text, "dora")
    file.write_text("".join(json.dumps(record) + "\n" for record in exported(book)))
    book.note_place("export", file)
    book.forget("ana")
    with new_book() as other:
        exchange.merge(other, map(json.loads, file.read_text().splitlines()), "lab")
        assert content(other) == content(book) and len(programs(other)) == 3


def test_a_call_that_goes_takes_no_code_of_others_out_of_files(book, tmp_path: Path) -> None:
    """Letter by letter ``open_hinged('door')`` stands in the header of every template."""
    teach_doors(book)
    merged(book)
    approve_call(book, JAR, "open_hinged('door')", "ana")
    file = tmp_path / "notes.txt"
    file.write_text(program("oven"))
    book.forget("ana", [file])
    assert file.read_text() == program("oven")


def test_a_call_of_a_template_that_somebody_else_approved_later_stays_too(book) -> None:
    """A template that is approved again as it is stays as well."""
    teach_doors(book)
    merged(book)
    [learnt] = functions_of(book)
    assert approve_call(book, MICROWAVE, learnt.calls[0].text, "cleo").id == learnt.calls[0].id
    book.forget("ana")
    assert programs(book) == {MICROWAVE: {tree(program("microwave"))}, OVEN: {tree(program("oven"))}}
    assert functions_of(book) == [] and book.problems() == []
    book.forget("cleo")
    assert kinds(book) == [("template", OVEN)]


def test_an_edited_function_goes_with_its_editor_and_the_former_one_has_its_calls_again(book) -> None:
    teach_doors(book, MICROWAVE, OVEN, who=("ben", "cleo"))
    merged(book)
    [before] = functions_of(book)
    edited = book.edit(before.entry.id, before.entry.text.replace("look()", "look_at('zebra')"), "ana")
    since = approve_call(book, FRIDGE, FRIDGE_CALL, "dora", edited.id)
    book.forget("ana")
    [after] = functions_of(book)
    assert after.entry == before.entry and after.calls[:2] == before.calls
    assert not any("zebra" in text for kind, _, text in active(book) if kind != "template")
    assert since.id in [entry.id for entry in book.entries("template")], "it was approved as the edited one did it"


def test_who_came_last_takes_only_what_was_made_with_theirs(book) -> None:
    teach_doors(book)
    merged(book)
    [before] = functions_of(book)
    approve(book, FRIDGE, program("fridge"), "cleo")
    merge_programs(book, ())
    book.forget("cleo")
    assert functions_of(book) == [before] and FRIDGE not in programs(book)


def test_who_came_first_takes_all_and_the_others_templates_are_there_again(book) -> None:
    [_, bens] = teach_doors(book)
    merged(book)
    cleos = approve(book, FRIDGE, program("fridge"), "cleo")
    merge_programs(book, ())
    book.forget("ana")
    assert [entry.id for entry in book.entries()] == [bens, cleos]


def test_after_a_rollback_was_undone_the_others_templates_are_there_again_too(book) -> None:
    [_, bens] = teach_doors(book)
    undone = history.roll_back(book, merged(book))
    history.roll_back(book, undone.id)
    book.forget("ana")
    assert [entry.id for entry in book.entries()] == [bens]


def test_a_rollback_is_not_undone_after_somebody_withdrew_what_it_undid(book) -> None:
    teach_doors(book, MICROWAVE, OVEN, FRIDGE)
    undone = history.roll_back(book, merged(book))
    book.forget("ana")
    before = programs(book)
    with pytest.raises(history.CannotRollBack, match="withdrawn"):
        history.roll_back(book, undone.id)
    assert programs(book) == before and len(before) == 2


def test_a_note_inside_a_function_and_those_of_a_wider_one_are_there_again(book) -> None:
    first, second = teach_doors(book)
    [inside] = teach(book, OVEN, "Hold the handle.", who="ben")
    [anas] = teach(book, MICROWAVE, "Slowly.", who="ana")
    [bens] = teach(book, OVEN, "Do it slowly.", who="ben")
    function = GeneralFunction(program("oven"), ((first, "open_hinged('microwave door')"), (second, "open_hinged()")))
    wider = WiderNote("Slowly.", (anas, bens))
    revision = store(book, GroupChange((function,), (), ((inside, 0),), (wider,)), "model")
    assert [one.text for one in book.entries("correction", OVEN)] == ["Slowly."]
    assert book.entries("correction", MICROWAVE) == book.entries("correction", OVEN)
    assert history.revision(book, revision).count("superseded") == 5
    book.forget("ana")
    assert [entry.id for entry in book.entries()] == [second, inside, bens]
    assert [str(one.key) for one in book.entries("correction")] == [OVEN, OVEN]


# -- other books -------------------------------------------------------------------------------------------------------
def test_a_copy_of_a_book_is_the_book(book) -> None:
    teach_doors(book)
    for key in (OVEN, MICROWAVE):
        teach(book, key, "Slowly.")
    merged(book), merge_notes(book)
    approve_call(book, FRIDGE, FRIDGE_CALL)
    book.note_use([functions_of(book)[0].calls[0].id], True, MICROWAVE)
    with new_book() as copy:
        first = exchange.merge(copy, exported(book), "lab")
        assert content(copy) == content(book) and programs(copy) == programs(book)
        assert [e.text for e in copy.entries(key=MICROWAVE)] == [e.text for e in book.entries(key=MICROWAVE)]
        before = exported(copy)
        assert not exchange.merge(copy, exported(book), "lab").changed and exported(copy) == before
        assert first.changed and not copy.problems()
        for subtask in (OVEN, MICROWAVE, FRIDGE):
            mine, theirs = book.retrieve(subtask), copy.retrieve(subtask)
            assert [(one.key, one.text) for one in mine.served] == [(one.key, one.text) for one in theirs.served]
            assert mine.functions[0].docstring == theirs.functions[0].docstring
        assert not exchange.merge(book, exported(copy), "copy").changed
        merges = [one.id for one in history.revisions(copy) if one.reason == "imported functions"]
        with pytest.raises(history.CannotRollBack, match="called since"):
            history.roll_back(copy, merges[0])


def settle(one: Skillbook, other: Skillbook) -> None:
    """Import each into the other until nothing changes."""
    for _ in range(6):
        changed = exchange.merge(one, exported(other), "other").changed
        changed |= exchange.merge(other, exported(one), "one").changed
        if not changed:
            break
    assert not changed, "they never agree"
    assert content(one) == content(other) and programs(one) == programs(other)
    assert one.problems() == other.problems() == []


def test_two_books_that_merged_the_same_templates_end_up_the_same(book) -> None:
    teach_doors(book)
    with new_book() as other:
        exchange.merge(other, exported(book), "one")
        merged(book), merged(other)
        settle(book, other)
        assert programs(book) == {MICROWAVE: {tree(program("microwave"))}, OVEN: {tree(program("oven"))}}


def test_functions_of_one_name_from_two_books_are_both_there_and_one_is_retrieved(book) -> None:
    teach_doors(book)
    with new_book() as other:
        for key in (FRIDGE, JAR):
            approve(other, key, program(key[5:-1]).replace("look()", "wait()"), "dora")
        merged(book), merged(other)
        settle(book, other)
        assert [one.function.name for one in functions_of(book)] == ["open_hinged"] * 2
        for key in (MICROWAVE, OVEN, FRIDGE, JAR):
            [function] = book.retrieve(key).functions
            assert str(function.calls[0].entry.key) == key
        assert merge_programs(book, (), again=True) == []
        approve(book, "OPEN(chest)", program("chest"))
        assert all(len(one.calls) >= 2 for one in functions_of(book))


def test_of_two_books_with_functions_one_that_goes_on_is_followed(book) -> None:
    teach_doors(book)
    with new_book() as other:
        merged(book)
        exchange.merge(other, exported(book), "one")
        approve(other, FRIDGE, program("fridge"), "dora")
        [made] = merge_programs(other, ())
        assert len(made.members) == 3
        approve_call(book, JAR, "open_hinged('jar')", "eve")
        settle(book, other)
        assert tree(program("jar").replace("jar door", "jar")) in programs(book)[JAR]
        assert len([one for one in functions_of(book) if one.calls]) == 1


def test_a_book_of_format_3_is_imported(book) -> None:
    teach_doors(book)
    records = exported(book)
    records[0]["format"] = 3
    with new_book() as other:
        exchange.merge(other, records, "old")
        assert kinds(other) == [("template", MICROWAVE), ("template", OVEN)]
        assert merged(other)


def test_what_was_withdrawn_in_its_book_goes_with_the_function(book) -> None:
    teach_doors(book)
    with new_book() as other:
        exchange.merge(other, exported(book), "one")
        merged(other)
        approve_call(other, FRIDGE, FRIDGE_CALL, "cleo")
        book.forget("ana")
        exchange.merge(other, exported(book), "one")
        assert kinds(other) == [("template", OVEN), ("template", FRIDGE)]
        settle(book, other)


def test_a_function_made_of_what_was_withdrawn_here_does_not_come_with_its_calls(book) -> None:
    teach_doors(book)
    with new_book() as other:
        exchange.merge(other, exported(book), "one")
        merged(other)
        approve_call(other, FRIDGE, FRIDGE_CALL, "cleo")
        book.forget("ana")
        found = exchange.merge(book, exported(other), "other")
        assert found.left_out >= 3 and functions_of(book) == []
        assert programs(book) == {OVEN: {tree(program("oven"))}, FRIDGE: {tree(program("fridge", 70))}}
        assert not exchange.merge(book, exported(other), "other").changed
        settle(book, other)


def test_a_further_key_that_is_the_first_one_here_is_not_there_twice(book) -> None:
    for key in (OVEN, FRIDGE):
        teach(book, key, "Slowly.")
    merge_notes(book)
    with new_book() as other:
        teach(other, OVEN, "Fast.")
        consolidating.add_alias(other, FRIDGE, OVEN)
        exchange.merge(other, exported(book), "one")
        assert [entry.text for entry in other.entries(key=OVEN)] == ["Fast.", "Slowly."]
        assert len(list(consolidating.clusters(other, unchanged=True))) == 1, "a note of one key is clustered"


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [
        ("function", "text", "open_hinged = 1"),
        ("function", "text", "def f():\n    look()\n"),
        ("call", "text", "open_hinged('a door') or look()"),
        ("call", "text", "open_hinged(angel=85)"),
        ("call", "text", "another('a door')"),
        ("call", "calls", []),
        ("call", "calls", [1]),
        ("call", "calls", [99]),
        ("call", "kind", "function"),
        ("correction", "keys", [["", ""]]),
        ("correction", "keys", [["open"]]),
        ("correction", "keys", [["", "jar"]]),
    ],
)
def test_a_function_call_or_key_that_cannot_be_is_refused(book, kind: str, name: str, value: object) -> None:
    teach_doors(book)
    for key in (OVEN, FRIDGE):
        teach(book, key, "Slowly.")
    merged(book), merge_notes(book)
    records = exported(book)
    [*_, record] = [one for one in records if one.get("kind") == kind and one["record"] == "entry"]
    record[name] = value
    with new_book() as other:
        with pytest.raises(BadImport):
            exchange.merge(other, records, "x")
        assert other.entries(superseded=True) == []


# -- older books -------------------------------------------------------------------------------------------------------
def as_version_6(path: Path) -> None:
    with sqlite3.connect(path) as raw:
        for name in ("calls", "groupings", "entry_keys"):
            raw.execute(f"DROP TABLE {name}")
        raw.execute("UPDATE meta SET value = '6' WHERE name = 'schema_version'")
    with sqlite3.connect(path) as raw:
        raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def test_a_book_of_schema_6_is_read_as_it_is_and_gets_its_tables_when_it_is_written(tmp_path: Path) -> None:
    path = tmp_path / "book.db"
    with new_book(str(path)) as book:
        first, second = teach_doors(book)
        for key in (OVEN, MICROWAVE):
            teach(book, key, "Slowly.", "Do it slowly.")
        book.note_use([first], True, MICROWAVE)
    as_version_6(path)
    before = path.read_bytes()
    with new_book(str(path), read_only=True) as book:
        assert functions_of(book) == [] and stats_of(book).functions == 0
        for way in ({}, {"functions": "off"}, {"clustered": False}):
            found = book.retrieve(OVEN, **way)
            assert found.templates[0].entry.id == second and len(found.corrections) == 4 and found.functions == ()
        assert len(book.entries(key=OVEN)) == 3 and len(history.revisions(book)) == 6 and exported(book)
        assert len(list(consolidating.clusters(book))) == 2 and history.difference(book, 1).added
        assert len(consolidated_groups(book)) == 1
        assert len(merge_programs(book, (), commit=False)) == 1 and len(merge_notes(book, commit=False)) == 2
    assert path.read_bytes() == before and not list(tmp_path.glob("*backup"))
    with new_book(str(path)) as book:
        assert (tmp_path / "book.db.schema-6.backup").exists() and len(book.places()) == 1
        assert merged(book) and len(merge_notes(book)) == 2 and book.problems() == []
        assert book.retrieve(OVEN).functions and len(evidence_of(book, functions_of(book)[0].calls[0].id)) == 1
        book.forget("ana")
    assert not (tmp_path / "book.db.schema-6.backup").exists()


# -- without functions -------------------------------------------------------------------------------------------------
def served(book: Skillbook, subtask: str, **way: Any) -> list[int]:
    found = book.retrieve(subtask, **way)
    assert found.functions == () or not way
    return [one.entry.id for one in found.templates]


def test_without_clustering_or_functions_the_templates_are_read(book) -> None:
    first, second = teach_doors(book)
    notes = [teach(book, key, "Slowly.")[0] for key in (OVEN, MICROWAVE)]
    merged(book), merge_notes(book)
    assert served(book, OVEN) == []
    for way in ({"clustered": False}, {"functions": "off"}):
        assert served(book, OVEN, **way)[0] == second and served(book, MICROWAVE, **way)[0] == first
    assert {one.entry.id for one in book.retrieve(OVEN, clustered=False).corrections} == set(notes)
    [note] = book.retrieve(MICROWAVE, functions="off").corrections
    assert note.entry.id not in notes and note.key == MICROWAVE


def test_without_functions_a_call_approved_since_is_a_template(book) -> None:
    teach_doors(book)
    merged(book)
    call = approve_call(book, FRIDGE, FRIDGE_CALL)
    assert served(book, FRIDGE) == [] and book.retrieve(FRIDGE).functions
    for way in ({"clustered": False}, {"functions": "off"}):
        assert served(book, FRIDGE, **way)[0] == call.id
        assert tree(book.retrieve(FRIDGE, **way).templates[0].text) == tree(program("fridge", 70))
    assert book.entry(call.id) == call, "the book itself is as it was"


def test_without_functions_what_people_edited_since_is_a_template_too(book) -> None:
    [_, second] = teach_doors(book)
    merged(book)
    [learnt] = functions_of(book)
    book.edit(learnt.entry.id, learnt.entry.text.replace("look()", "wait()"), "dora")
    call = book.edit(learnt.calls[0].id, "open_hinged('microwave door', angle=60)", "dora")
    since = approve_call(book, FRIDGE, FRIDGE_CALL)
    for way in ({"clustered": False}, {"functions": "off"}):
        assert served(book, MICROWAVE, **way)[0] == call.id and served(book, FRIDGE, **way)[0] == since.id
        assert served(book, OVEN, **way)[0] == second
        found = book.retrieve(MICROWAVE, **way).templates[0].text
        assert tree(found) == tree(program("microwave", 60).replace("look()", "wait()"))


def test_without_functions_the_templates_are_read_also_after_a_rollback_was_undone(book) -> None:
    first, second = teach_doors(book)
    undone = history.roll_back(book, merged(book))
    assert served(book, OVEN)[0] == second
    history.roll_back(book, undone.id)
    for way in ({"clustered": False}, {"functions": "off"}):
        assert served(book, OVEN, **way)[0] == second and served(book, MICROWAVE, **way)[0] == first


def test_without_functions_a_function_that_others_came_to_call_is_left_out_whole(book) -> None:
    ids = teach_doors(book)
    merged(book)
    ids.append(approve(book, FRIDGE, program("fridge"), "cleo"))
    merge_programs(book, ())
    for way in ({"clustered": False}, {"functions": "off"}):
        assert [served(book, key, **way)[0] for key in (MICROWAVE, OVEN, FRIDGE)] == ids
