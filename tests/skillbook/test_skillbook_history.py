"""The book's history: what every revision did, differences, rollbacks, versions of templates, and older books."""

from __future__ import annotations

import json
import sqlite3

import pytest

from memo_core.errors import UnknownName
from memo_core.skillbook import consolidating, history
from memo_core.skillbook.history import CannotRollBack
from memo_core.skillbook.store.database import ReadOnlyBook
from tests.support.cluster_books import ARC, approve, clustering, new_book, teach, texts


def other(code: str) -> str:
    return ARC.replace("80", code)


def merge(book) -> int:
    """Condense two corrections into one; the revision."""
    both = json.dumps({"entries": [{"text": "Swing it.", "from": [1, 2]}], "dropped": []})
    [outcome] = clustering(book, [both]).condense_all()
    return outcome.committed.revision


@pytest.fixture
def book():
    with new_book() as opened:
        yield opened


def test_every_revision_says_what_it_did_and_why(book) -> None:
    first, second = teach(book, "OPEN(oven)", "Swing it.", "Do swing it.")
    revision = merge(book)
    taught, _, merged = history.revisions(book, "open(the oven)")
    assert (taught.reason, [change.change for change in taught.changes]) == ("feedback 1", ["added"])
    assert merged.id == revision and merged.reason == "cluster by scripted"
    [new] = [change.entry for change in merged.changes if change.change == "added"]
    gone = {change.entry.id: (change.why, change.because) for change in merged.changes if change.change == "superseded"}
    assert gone == {first: (f"merged into {new.id}", new.id), second: (f"merged into {new.id}", new.id)}
    assert history.revisions(book, "WIPE(table)") == []


def test_a_difference_is_between_any_two_states(book) -> None:
    first, second = teach(book, "OPEN(oven)", "Swing it.", "Do swing it.")
    revision = merge(book)
    [merged] = book.entries()
    shown = history.difference(book, revision)
    assert ([e.id for e in shown.removed], [e.id for e in shown.added]) == ([first, second], [merged.id])
    assert [e.id for e in history.difference(book, 1, 2).added] == [second]
    assert [e.id for e in history.difference(book, revision, 1).added] == [first]
    same = history.difference(book, 2, 2)
    assert same.added == same.removed == ()
    with pytest.raises(UnknownName, match="revision"):
        history.difference(book, 99)


def test_a_rollback_restores_what_was_there_and_can_be_rolled_back(book) -> None:
    teach(book, "OPEN(oven)", "Swing it.", "Do swing it.")
    before = [entry.text for entry in book.entries()]
    revision, generation = merge(book), book.generation()
    undone = history.roll_back(book, revision)
    assert [entry.text for entry in book.entries()] == before and book.generation() > generation
    assert undone.reason == f"rollback of {revision}"
    with pytest.raises(CannotRollBack, match=f"already, by revision {undone.id}"):
        history.roll_back(book, revision)
    assert list(clustering(book, []).condense_all()) == [], "what somebody took back is not done again"
    history.roll_back(book, undone.id)
    assert texts(book) == ["Swing it."]
    history.roll_back(book, revision + 2)
    assert [entry.text for entry in book.entries()] == before


def test_what_later_revisions_rest_on_is_rolled_back_after_them(book) -> None:
    teach(book, "OPEN(oven)", "Swing it.", "Do swing it.")
    revision = merge(book)
    with pytest.raises(CannotRollBack) as refused:
        history.roll_back(book, 1)
    assert refused.value.later == (revision,)
    history.roll_back(book, revision)
    history.roll_back(book, 1)
    assert texts(book) == ["Do swing it."]


def test_a_rollback_needs_a_book_that_can_be_written(tmp_path) -> None:
    path = f"sqlite:///{tmp_path / 'book.db'}"
    with new_book(path) as book:
        teach(book, "OPEN(oven)", "Swing it.")
    with new_book(path, read_only=True) as book, pytest.raises(ReadOnlyBook):
        history.roll_back(book, 1)


# -- versions of templates ---------------------------------------------------------------------------------------------


def served(book, key: str = "OPEN(oven)") -> list[int]:
    return [one.entry.id for one in book.retrieve(key).templates]


def test_newly_approved_code_is_the_new_version_and_the_old_one_stays(book) -> None:
    first = approve(book, "OPEN(oven)")
    second = approve(book, "OPEN(oven)", other("60"))
    assert served(book) == [second]
    assert [(v.entry.id, v.state) for v in history.versions(book, "OPEN(oven)")] == [
        (first, "superseded"),
        (second, "served"),
    ]


def test_the_same_code_approved_again_is_no_new_version_but_this_persons_too(book) -> None:
    first = approve(book, "OPEN(oven)", who="ana")
    assert approve(book, "OPEN(oven)", ARC.replace("...", "...  # as before"), who="ben") == first
    assert [one.reason for one in history.revisions(book, "OPEN(oven)")] == ["template 1"]
    assert book.pending_feedback() == []
    book.forget("ana")
    assert served(book) == [first]


def test_an_approval_that_is_processed_twice_makes_nothing_new(book) -> None:
    approve(book, "OPEN(oven)")
    again = book.record_feedback("", "ben", subtask="OPEN(oven)", kind="approval")
    first = book.add_template(again, "OPEN(oven)", ARC)
    newer = approve(book, "OPEN(oven)", other("60"))
    assert book.add_template(again, "OPEN(oven)", other("70")).id == first.id
    assert served(book) == [newer]


@pytest.mark.wire
def test_a_version_that_fails_gives_way_to_one_with_a_better_record(book) -> None:
    first = approve(book, "OPEN(oven)")
    book.note_use([first], success=True, subtask="OPEN(oven)")
    second = approve(book, "OPEN(oven)", other("60"))
    book.note_use([second], success=False, subtask="WIPE(table)")
    assert served(book) == [second], "what does not fit something else is not wrong here"
    book.note_use([second], success=False, subtask="open(the oven)")
    assert served(book) == [first]
    assert [(v.uses, v.confirmed_uses) for v in history.versions(book, "OPEN(oven)")] == [(1, 1), (1, 0)]
    book.note_use([first], success=False, subtask="OPEN(oven)")
    assert served(book) == [first], "two of three is better than one of two"


def test_a_version_that_was_rolled_back_does_not_come_back_by_itself(book) -> None:
    first = approve(book, "OPEN(oven)")
    second = approve(book, "OPEN(oven)", other("60"))
    [revision] = [
        one.id for one in history.revisions(book) if one.reason.startswith("template") and one.count("superseded")
    ]
    history.roll_back(book, revision)
    assert served(book) == [first]
    for _ in range(3):
        book.note_use([first], success=False, subtask="OPEN(oven)")
    assert served(book) == [first]
    assert [v.state for v in history.versions(book, "OPEN(oven)") if v.entry.id == second] == ["rolled back"]


def test_who_withdraws_the_newest_version_gives_back_the_one_before(book) -> None:
    first = approve(book, "OPEN(oven)", who="ana")
    approve(book, "OPEN(oven)", other("60"), who="ben")
    third = approve(book, "OPEN(oven)", other("40"), who="cleo")
    book.forget("ben")
    assert served(book) == [third]
    book.forget("cleo")
    assert served(book) == [first]


# -- joined keys -------------------------------------------------------------------------------------------------------


def test_a_join_moves_entries_and_can_be_rolled_back(book) -> None:
    teach(book, "PLACE(cup, shelf)", "Gently.")
    teach(book, "PUT(cups, shelf)", "Slowly.")
    old = approve(book, "PUT(cups, shelf)")
    consolidating.add_alias(book, "PUT(cups, shelf)", "PLACE(cup, shelf)")
    assert texts(book, "PLACE(cup, shelf)") == ["Gently.", "Slowly."]
    [joined] = [one for one in history.revisions(book) if one.reason.startswith("joined")]
    assert joined.count("joined") == 2 and [v.entry.id for v in history.versions(book, "PUT(cups, shelf)")] == [old]
    history.roll_back(book, joined.id)
    assert texts(book, "PUT(cups, shelf)") == ["Slowly."]
    teach(book, "PUT(cups, shelf)", "Higher.")
    assert texts(book, "PLACE(cup, shelf)") == ["Gently."]


def test_of_two_templates_that_a_join_brings_together_one_is_served(book) -> None:
    approve(book, "PLACE(cup, shelf)")
    newer = approve(book, "PUT(cups, shelf)", other("60"))
    consolidating.add_alias(book, "PUT(cups, shelf)", "PLACE(cup, shelf)")
    assert served(book, "PLACE(cup, shelf)") == [newer]


# -- older books -------------------------------------------------------------------------------------------------------


def test_a_book_of_the_first_version_is_read_as_it_is_and_gets_its_tables_when_it_is_written(tmp_path) -> None:
    path = tmp_path / "book.db"
    with new_book(f"sqlite:///{path}") as book:
        teach(book, "OPEN(oven)", "Swing it.", "Do swing it.")
        approve(book, "OPEN(oven)")
    raw = sqlite3.connect(path)
    for table in ("changes", "clusterings", "records"):
        raw.execute(f"DROP TABLE {table}")
    raw.execute("UPDATE meta SET value = '1' WHERE name = 'schema_version'")
    raw.commit()
    raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    raw.close()
    with new_book(f"sqlite:///{path}", read_only=True) as book:
        assert len(history.revisions(book)) == 3 and [v.uses for v in history.versions(book, "OPEN(oven)")] == [0]
        assert len(consolidating.clusters(book)) == 1 and history.difference(book, 1).added
    with new_book(f"sqlite:///{path}") as book:
        merge(book)
        assert texts(book) == ["Swing it."]
