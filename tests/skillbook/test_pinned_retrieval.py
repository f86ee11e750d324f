"""A pinned book: what others cluster meanwhile is not retrieved, what people teach is."""

from __future__ import annotations

import pytest

from memo_core.policy.logged_book import pin
from memo_core.runlog.log_file import read_lines
from memo_core.runlog.log_history import read_history
from memo_core.runlog.run_log import RunLog
from memo_core.skillbook import consolidating, history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.rules import Condensed, Dropped, Merged
from memo_core.skillbook.functions import merge_programs
from tests.skillbook.test_merging_by_defaults import FRIDGE, MICROWAVE, OVEN, program
from tests.support.cluster_books import approve, new_book, teach

KEY = "OPEN(oven)"


def clustered(url: str) -> None:
    """Condense the only cluster, by another connection."""
    with new_book(url) as other:
        [cluster] = consolidating.clusters(other)
        others = tuple(Merged(member.text, (n,)) for n, member in enumerate(cluster.members[3:], start=4))
        proposal = Condensed((Merged("Swing it slowly.", (1, 2)), *others), (Dropped(3, 1, "it does"),))
        consolidating.condense(other, cluster, proposal)


def with_functions(url: str) -> None:
    """Merge the programs of several keys, by another connection."""
    with new_book(url) as other:
        assert [len(one.change.functions) for one in merge_programs(other, ())] == [1]


def served(book: Skillbook, **how: bool) -> list:
    return list(book.retrieve(KEY, **how).served)


def notes(book: Skillbook) -> set[str]:
    return {one.text for one in book.retrieve(KEY).corrections}


@pytest.fixture
def book(tmp_path):
    with new_book(str(tmp_path / "book.db")) as opened:
        teach(opened, KEY, "Swing it.", "Swing it, slowly.", "Pull it.")
        approve(opened, KEY)
        yield opened


def test_what_was_clustered_meanwhile_is_not_retrieved_and_what_was_taught_is(book):
    book.pin(book.newest_revision())
    before = served(book)
    assert not book._copies, "a copy although nothing was clustered"
    clustered(book.url)
    assert served(book) == before
    teach(book, KEY, "Mind the cable.")
    assert notes(book) == {"Swing it.", "Swing it, slowly.", "Pull it.", "Mind the cable."}
    with new_book(book.url) as later:
        assert notes(later) == {"Swing it slowly.", "Mind the cable."}, "the next run sees it"


def test_what_was_clustered_before_is_retrieved(book):
    clustered(book.url)
    book.pin(book.newest_revision())
    assert notes(book) == {"Swing it slowly."} and not book._copies


def test_edits_removals_and_rollbacks_of_people_are_seen(book):
    book.pin(book.newest_revision())
    clustered(book.url)
    [merged] = [entry for entry in book.entries("correction") if entry.text == "Swing it slowly."]
    removed = book.remove(merged.id, "ana")
    assert notes(book) == {"Pull it."}
    history.roll_back(book, removed)
    assert notes(book) == {"Swing it.", "Swing it, slowly.", "Pull it."}


def test_uses_that_the_run_counts_are_seen(book):
    book.pin(book.newest_revision())
    clustered(book.url)
    first = book.retrieve(KEY).corrections[0].entry
    book.note_use([first.id], True, KEY)
    assert {one.entry.id: one.entry.uses for one in book.retrieve(KEY).corrections}[first.id] == first.uses + 1


def test_what_is_clustered_while_it_is_retrieved_is_left_out_too(book, monkeypatch):
    book.pin(book.newest_revision())
    before, retrieve = served(book), Skillbook._retrieve

    def interfered(self, *asked):
        if self is book:
            monkeypatch.undo()
            clustered(book.url)
        return retrieve(self, *asked)

    monkeypatch.setattr(Skillbook, "_retrieve", interfered)
    assert served(book) == before


def test_a_function_made_meanwhile_is_not_called_and_its_programs_stay(tmp_path):
    with new_book(str(tmp_path / "book.db")) as book:
        for key, parameters in (("OPEN(microwave)", MICROWAVE), ("OPEN(fridge)", FRIDGE), (KEY, OVEN)):
            approve(book, key, program(parameters))
        book.pin(book.newest_revision())
        before = served(book)
        with_functions(book.url)
        found = book.retrieve(KEY)
        assert served(book) == before and not found.functions and found.templates
        assert served(book, functions="off") == before and served(book, clustered=False) == before
        with new_book(book.url) as later:
            assert later.retrieve(KEY).functions


def test_a_call_of_a_function_that_is_replaced_meanwhile_becomes_a_program_of_its_own(tmp_path):
    with new_book(str(tmp_path / "book.db")) as book:
        for key, parameters in (("OPEN(microwave)", MICROWAVE), ("OPEN(fridge)", FRIDGE), (KEY, OVEN)):
            approve(book, key, program(parameters))
        with_functions(book.url)
        [function] = book.entries("function")
        approval = book.record_feedback("", "ana", subtask="OPEN(cupboard)", kind="approval")
        history.roll_back(book, function.revision)
        call = "open_hinged('cupboard door', 'cupboard handle', angle=70)"
        added = book.add_call(approval, "OPEN(cupboard)", call, function.id)
        assert added.kind == "template" and "angle=70" in added.text
        assert book.add_call(approval, "OPEN(cupboard)", call, function.id) == added


def test_a_resumed_run_pins_the_revision_that_it_began_with(book, tmp_path):
    (tmp_path / "run").mkdir()
    log = RunLog(tmp_path / "run")
    log.begin({"run": "r"}, {})
    pin(log, book)
    log.close()
    before = served(book)
    clustered(book.url)
    resumed = RunLog(tmp_path / "run", read_history(tmp_path / "run", read_lines(tmp_path / "run").records))
    with new_book(book.url) as again:
        pin(resumed, again)
        assert served(again) == before
