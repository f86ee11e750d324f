"""Notes that are read back are accepted, reworded or struck, and any entry can be edited or removed: as revisions."""

from __future__ import annotations

from pathlib import Path

import pytest

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.skillbook import exchange, history
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import GLOBAL_KEY, Note, Reaction
from memo_core.skillbook.model.keys import Key
from memo_core.testing.fake_embedder import FakeEmbedder

OPEN, PICK = Key.parse("OPEN(door)"), Key.parse("PICK_UP(cup)")


@pytest.fixture
def book() -> Skillbook:
    return Skillbook("sqlite://", FakeEmbedder()).open()


def taught(book: Skillbook) -> tuple[int, list[int]]:
    feedback = book.record_feedback("No, an arc! And hold it tighter.", "ana", subtask="OPEN(door)", run="r1")
    entries = book.add_lessons(
        feedback, OPEN, ["Lead it along an arc.", "Hold it tighter."], ["Doors turn."], "kitchen"
    )
    return feedback, [entry.id for entry in entries]


def valid(book: Skillbook) -> list[str]:
    return [entry.text for entry in book.entries()]


def test_what_is_said_of_notes_that_are_read_back_is_applied_and_kept_with_the_words(book: Skillbook) -> None:
    feedback, (arc, tight, general) = taught(book)
    said = [
        Reaction(arc, "accepted"),
        Reaction(tight, "struck"),
        Reaction(general, "reworded", "Doors turn about a hinge."),
    ]
    left = book.read_back(feedback, said)
    assert [entry.text for entry in left] == ["Lead it along an arc.", "Doors turn about a hinge."] == valid(book)
    assert left[1].kind == "general" and left[1].key == GLOBAL_KEY and left[1].scene == "kitchen"
    kept = [(one.outcome, one.note, one.text, one.who) for one in book.read_backs(feedback)]
    assert kept == [
        ("accepted", "Lead it along an arc.", "", "ana"),
        ("struck", "Hold it tighter.", "", "ana"),
        ("reworded", "Doors turn.", "Doors turn about a hinge.", "ana"),
    ]
    assert book.feedback(feedback).words == "No, an arc! And hold it tighter."
    assert [served.text for served in book.retrieve(OPEN).corrections] == ["Lead it along an arc."]


def test_a_read_back_may_be_repeated_after_a_crash(book: Skillbook) -> None:
    feedback, (_, tight, general) = taught(book)
    said = [Reaction(tight, "struck"), Reaction(general, "reworded", "Doors turn about a hinge.")]
    first = book.read_back(feedback, said)
    before = (list(exchange.export(book)), book.generation())
    assert book.read_back(feedback, said) == first
    assert (list(exchange.export(book)), book.generation()) == before


def test_a_read_back_is_one_revision_that_can_be_rolled_back_and_that_again(book: Skillbook) -> None:
    feedback, (arc, tight, general) = taught(book)
    before = valid(book)
    book.read_back(feedback, [Reaction(tight, "struck"), Reaction(general, "reworded", "Some doors turn.")])
    after, revision = valid(book), history.revisions(book)[-1]
    back = history.roll_back(book, revision.id)
    assert valid(book) == before
    history.roll_back(book, back.id)
    assert valid(book) == after
    assert arc in [entry.id for entry in book.entries()]


def test_notes_of_another_feedback_are_not_read_back(book: Skillbook) -> None:
    feedback, _ = taught(book)
    _, (other, *_) = taught(book)
    with pytest.raises(InvalidArgument, match=f"entry {other} does not derive from feedback {feedback}"):
        book.read_back(feedback, [Reaction(other, "struck")])
    with pytest.raises(UnknownName):
        book.read_back(feedback, [Reaction(999, "struck")])
    with pytest.raises(InvalidArgument, match="reworded to nothing"):
        Reaction(other, "reworded", " ")


def test_one_remark_files_notes_under_several_keys_and_the_same_words_once(book: Skillbook) -> None:
    feedback = book.record_feedback(
        "You should have opened it further, and grip lower.", "ana", subtask="PLACE(cup, box)"
    )
    notes = [
        Note(OPEN, "Open it wide."),
        Note(PICK, "Grip low."),
        Note(OPEN, "open it  wide"),
        Note(PICK, "Open it wide."),
        Note(GLOBAL_KEY, "Grip low"),
    ]
    stored = book.add_notes(feedback, notes, "kitchen")
    assert [(str(one.key), one.text) for one in stored] == [
        ("OPEN(door)", "Open it wide."),
        ("PICK_UP(cup)", "Grip low."),
        ("PICK_UP(cup)", "Open it wide."),
    ]
    assert book.add_notes(feedback, [Note(OPEN, "another answer of the model")]) == stored
    assert [one.text for one in book.entries(key=OPEN)] == ["Open it wide."]


def test_an_entry_is_edited_and_removed_by_revisions(book: Skillbook) -> None:
    feedback, (arc, tight, _) = taught(book)
    new = book.edit(arc, "Lead it along a wide arc.", "ben")
    assert (new.key, new.kind, new.scene) == (OPEN, "correction", "kitchen")
    assert "Lead it along an arc." not in valid(book) and new.text in valid(book)
    assert set(book.sources([new.id])) > {feedback}
    removed = book.remove(tight, "ben")
    assert history.revision(book, removed).reason == f"removal of {tight}" and "Hold it tighter." not in valid(book)
    history.roll_back(book, removed)
    assert "Hold it tighter." in valid(book)
    assert [(one.outcome, one.who) for one in book.read_backs(feedback)] == [("reworded", "ben"), ("struck", "ben")]
    with pytest.raises(InvalidArgument, match="superseded by revision"):
        book.edit(arc, "again", "ben")
    with pytest.raises(InvalidArgument, match="nobody is named"):
        book.remove(new.id, " ")


def test_a_template_is_edited_to_a_function_only(book: Skillbook) -> None:
    approval = book.record_feedback("", "ana", kind="approval", subtask="OPEN(door)")
    template = book.add_template(approval, OPEN, "def pull(name):\n    '''Pulls.'''\n")
    with pytest.raises(InvalidArgument, match="no Python"):
        book.edit(template.id, "pull the door", "ana")
    with pytest.raises(InvalidArgument, match="no function"):
        book.edit(template.id, "pull = 1", "ana")
    assert book.edit(template.id, "def pull(name, force=5):\n    '''Pulls.'''\n", "ana").kind == "template"
    assert len(book.entries(kind="template")) == 1


def test_whoever_reworded_an_entry_can_withdraw_the_wording(tmp_path: Path) -> None:
    path = tmp_path / "book.db"
    with Skillbook(str(path), FakeEmbedder()) as book:
        feedback, (arc, *_) = taught(book)
        book.edit(arc, "zebra words of ben", "ben")
        book.forget("ben")
        assert "Lead it along an arc." in valid(book)
        assert book.read_backs(feedback) == []
    assert b"zebra" not in path.read_bytes()
