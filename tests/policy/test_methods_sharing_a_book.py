"""Methods that share a book do not change what the others find in it: one test a contamination."""

from __future__ import annotations

import json

import pytest

from memo_core.events import Retrieved
from memo_core.interfaces.teacher import Verdict
from memo_core.skillbook import consolidating, history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.rules import Condensed, Dropped, Merged
from tests.support.loop_setup import BESIDE, GRASP, NO, NOTES, SAID, YES, Bench

ONE_TRY = {"plan": ["PICK_UP(red cube)", "DONE"], "code": [GRASP]}
TWO_TRIES = {"plan": ["PICK_UP(red cube)", "DONE"], "code": [BESIDE, GRASP]}
SILENT = Verdict("silent")


def clustered(book: Skillbook) -> list[int]:
    """A book whose notes were merged and dropped by clustering; the notes' ids."""
    notes = []
    for text in ("Go over it first.", "Go over it first, slowly.", "Push it aside."):
        feedback = book.record_feedback(text, "ana", subtask="PICK_UP(red cube)")
        notes.append(book.add_lessons(feedback, "PICK_UP(red cube)", [text])[0].id)
    approval = book.record_feedback("", "ana", subtask="PICK_UP(red cube)", kind="approval")
    book.add_template(approval, "PICK_UP(red cube)", "def pick(name): ...")
    [cluster] = consolidating.clusters(book)
    consolidating.condense(
        book, cluster, Condensed((Merged("Go over it slowly.", (1, 2)),), (Dropped(3, 1, "it is picked up"),))
    )
    return notes


def served(bench: Bench, kind: str = "correction") -> set[str]:
    return {entry.text for event in bench.of(Retrieved) for entry in event.served if entry.kind == kind}


@pytest.mark.process
@pytest.mark.parametrize("method", ["memo-c", "droc-v"])
def test_a_method_without_clustering_reads_the_notes_as_they_were_said(sandbox, book, method):
    clustered(book)
    with_clusters = Bench(sandbox, book, ONE_TRY, None, method="memo")
    with_clusters.run()
    assert served(with_clusters) == {"Go over it slowly."}
    without = Bench(sandbox, book, ONE_TRY, None, method=method)
    without.run()
    assert served(without) == {"Go over it first.", "Go over it first, slowly.", "Push it aside."}
    assert "Push it aside." in without.llm.prompts("code")[0]


def test_what_is_taught_edited_or_removed_after_clustering_shows_without_clusters_too(book):
    first, second, _ = clustered(book)
    without = lambda: {one.text for one in book.retrieve("PICK_UP(red cube)", clustered=False).corrections}
    assert len(without()) == 3
    book.add_lessons(book.record_feedback("new", "bo"), "PICK_UP(red cube)", ["New."])
    assert len(without()) == 4
    [merged] = [entry for entry in book.entries("correction") if entry.text == "Go over it slowly."]
    removed = book.remove(merged.id, "ana")
    assert without() == {"Push it aside.", "New."}, "a person struck what the two had become"
    history.roll_back(book, removed)
    book.edit(merged.id, "Go over it, then down.", "ana")
    assert without() == {"Push it aside.", "New.", "Go over it, then down."}
    assert book.entry(first).superseded_by and book.entry(second).superseded_by, "the book itself is as it was"


def test_a_book_that_was_rolled_back_needs_no_second_reading(book):
    notes = clustered(book)
    [clustering] = [one for one in history.revisions(book) if one.reason.startswith("cluster")]
    history.roll_back(book, clustering.id)
    assert {one.entry.id for one in book.retrieve("PICK_UP(red cube)", clustered=False).corrections} == set(notes)
    assert not book._copies


@pytest.mark.parametrize("method", ["memo", "droc-v"])
def test_without_a_skillbook_nothing_is_left_that_a_later_run_picks_up(sandbox, book, method):
    Bench(sandbox, book, TWO_TRIES, [NO, YES], method="memo-s").run()
    assert not book.pending_feedback(parked=True) and not book.entries()
    assert [(one.kind, one.words, one.status) for one in book.feedback_of_run("run-1")] == [
        ("correction", SAID, "kept"),
        ("approval", "", "kept"),
    ], "what was said is there for whoever rebuilds a book from it"
    later = Bench(sandbox, book, ONE_TRY | {"feedback": [NOTES]}, None, method=method)
    later.run()
    assert not [request for request in later.llm.asked if request.phase == "feedback"]
    assert SAID.strip() not in later.llm.prompts("code")[0] and not served(later)


def test_corrections_only_never_takes_general_statements_away_from_the_others(sandbox, book):
    both = json.dumps({"corrections": ["Go over it."], "general": ["Be slow near people."], "unclear": ""})
    droc = Bench(sandbox, book, TWO_TRIES | {"feedback": [both]}, [NO, YES], method="droc-v")
    droc.run()
    assert served(droc) == {"Go over it."} and not served(droc, "general")
    assert "Be slow near people." not in "".join(droc.llm.prompts("code"))
    memo = Bench(sandbox, book, ONE_TRY, None, method="memo")
    memo.run()
    assert served(memo, "general") == {"Be slow near people."}


def test_what_others_left_pending_keeps_its_general_statements_when_corrections_only_reads_it(sandbox, book):
    book.record_feedback("slowly!", "bo", subtask="PICK_UP(red cube)", scene_graph="## Scene")
    general = json.dumps({"corrections": [], "general": ["Be slow near people."], "unclear": ""})
    Bench(sandbox, book, {"plan": ["DONE"], "feedback": [general]}, None, method="droc-v").run()
    assert [entry.text for entry in book.entries("general")] == ["Be slow near people."]
