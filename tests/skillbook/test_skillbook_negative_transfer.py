"""An entry that was served for another key and corrected there counts against itself there, and nowhere else."""

from __future__ import annotations

import pytest

from memo_core.config import load_experiment
from memo_core.plugins.registry import Registry
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook import track_record
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.skillbook.retrieval.score import key_score

DOORS = ("OPEN(oven)", "OPEN(fridge)", "OPEN(cabinet door)", "OPEN(cupboard)", "OPEN(oven door)", "OPEN(microwave)")
DRAWERS = ("OPEN(drawer)", "OPEN(top drawer)", "OPEN(desk drawer)", "OPEN(nightstand drawer)", "PULL_OPEN(drawer)")


@pytest.fixture(scope="module")
def embedder():
    opened = load_experiment(Registry(), None, (), SECTIONS).create("embedder")
    opened.open()
    yield opened
    opened.close()


def taught(embedder, **settings) -> tuple[Skillbook, list[int]]:
    """A book with the microwave lesson: a correction and a template with an arc."""
    book = Skillbook("sqlite://", embedder, settings=RetrievalSettings(**settings)).open()
    said = book.record_feedback("it turns!", "ana", subtask="OPEN(microwave)")
    note = book.add_lessons(said, "OPEN(microwave)", ["Pull the handle along an arc about the hinge."])[0]
    approval = book.record_feedback("", "ana", kind="approval", subtask="OPEN(microwave)")
    template = book.add_template(approval, "OPEN(microwave)", "def open_door(name): ...")
    return book, [note.id, template.id]


def served(book: Skillbook, subtask: str) -> set[int]:
    return {one.entry.id for one in book.retrieve(subtask).served}


def test_one_remark_on_a_drawer_ends_the_arc_on_drawers_and_not_on_doors(embedder) -> None:
    book, lesson = taught(embedder)
    for key in (*DOORS, *DRAWERS):
        assert served(book, key) == set(lesson), key
    said = book.record_feedback("no, this one slides", "bo", subtask="OPEN(drawer)")
    book.note_use(lesson, False, "OPEN(drawer)")
    slide = book.add_lessons(said, "OPEN(drawer)", ["Pull the drawer straight out."])[0].id
    for key in DRAWERS:
        assert served(book, key) == {slide}, key
    for key in DOORS:
        assert served(book, key) >= set(lesson), key
    withheld = [cut for cut in book.retrieve("OPEN(drawer)").cut if "corrected 1 times more than approved" in cut.rule]
    assert withheld
    assert all(
        cut.score == pytest.approx(key_score(cut.action_cosine, cut.objects_cosine, *book.settings.weights))
        for cut in withheld
    )
    assert [
        (str(one.key), one.served, one.approved, one.corrected) for one in track_record.evidence_of(book, lesson[0])
    ] == [("OPEN(drawer)", 1, 0, 1)]


def test_a_lesson_on_a_like_thing_survives_a_remark_and_not_several(embedder) -> None:
    book, lesson = taught(embedder)
    book.note_use(lesson, False, "OPEN(oven)")
    assert served(book, "OPEN(oven)") == set(lesson), "the remark may have been about something else"
    book.note_use(lesson, False, "OPEN(oven)")
    assert served(book, "OPEN(oven)") == set()
    assert served(book, "OPEN(microwave)") == set(lesson)
    for _ in range(2):
        book.note_use(lesson, True, "OPEN(oven)")
    assert served(book, "OPEN(oven)") == set(lesson), "approvals bring it back"


def test_an_entry_is_never_withheld_from_its_own_key_and_a_general_statement_from_none(embedder) -> None:
    book, lesson = taught(embedder)
    general = book.add_lessons(book.record_feedback("slowly", "ana"), "OPEN(microwave)", [], ["Move slowly."])[0].id
    for _ in range(5):
        book.note_use([*lesson, general], False, "OPEN(microwave)")
        book.note_use([general], False, "OPEN(drawer)")
    assert served(book, "OPEN(microwave)") >= {lesson[0], general}
    assert general in served(book, "OPEN(drawer)")


def test_the_paper_notices_no_harm(embedder) -> None:
    book, lesson = taught(embedder, notice_harm=False)
    book.note_use(lesson, False, "OPEN(drawer)")
    assert served(book, "OPEN(drawer)") == set(lesson)
