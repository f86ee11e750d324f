"""Another book is found to serve the same exactly when a prompt could not tell."""

from __future__ import annotations

import pytest

from memo_core.evaluation.retrieval_equivalence import ObservedBook, read_questions, same_answers
from memo_core.policy.methods import METHODS
from memo_core.skillbook import raw_log
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.keys import Key
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

SAID = [("A", 100.0, "Pull the handle in an arc."), ("B", 200.0, "Grasp the bar in its middle.")]


def filled(book, said=SAID, template=""):
    for who, when, words in said:
        with raw_log.clock(book, lambda when=when: when):
            feedback = book.record_feedback(words, who, subtask="OPEN(microwave)")
            book.add_lessons(feedback, Key.parse("OPEN(microwave)"), [words], [])
    if template:
        approval = book.record_feedback("", "A", subtask="OPEN(microwave)", kind="approval")
        book.add_template(approval, "OPEN(microwave)", template)
    return book


@pytest.fixture
def book():
    books = []

    def make(observed=False, **content):
        kind = ObservedBook if observed else Skillbook
        made = kind("sqlite://", FakeEmbedder(), FakeStore())
        books.append(made)
        made.open()
        return filled(made, **content)

    yield make
    for one in books:
        one.close()


@pytest.fixture
def questions(book, tmp_path):
    """What a book with this content was asked, as the trial's file has it."""

    def asked(**content):
        observed = book(observed=True, **content)
        observed.observe(METHODS["memo"], tmp_path / "questions.jsonl")
        for subtask in ("OPEN(microwave)", "OPEN(oven)"):
            observed.retrieve(Key.parse(subtask))
        return read_questions(observed.file)

    return asked


def test_the_same_book_with_other_ids_names_and_dates_serves_the_same(book, questions):
    other = [("X", 7.0, SAID[0][2]), ("Y", 9.0, SAID[1][2])]
    assert same_answers(book(said=other), METHODS["memo"], questions())


@pytest.mark.parametrize(
    "said",
    [
        SAID[:1],
        [SAID[0], ("B", 200.0, "Grasp the bar at its end.")],
        SAID[::-1],  # the order in which they were said is in the prompt
        [SAID[0], ("A", 200.0, SAID[1][2])],  # as is whether one person said both
    ],
)
def test_a_book_that_a_prompt_can_tell_apart_does_not(book, questions, said):
    assert not same_answers(book(said=said), METHODS["memo"], questions())


def test_a_method_that_uses_less_is_given_less(book, questions):
    code = 'def open_it(name):\n    """Open it."""\n    move_to(get_position(name))\n'
    asked = questions(template=code)
    assert same_answers(book(template=code), METHODS["memo-c"], asked)
    assert not same_answers(book(template=code), METHODS["droc-v"], asked)


def test_a_method_without_memory_is_given_what_an_empty_book_gives(book, questions):
    assert same_answers(book(), METHODS["memo-s"], questions(said=()))
    assert not same_answers(book(), METHODS["memo-s"], questions())


def test_a_run_that_goes_on_adds_to_the_questions_that_were_asked_before_it_was_cut_off(book, questions, tmp_path):
    file = tmp_path / "questions.jsonl"
    whole = questions()
    first, second = file.read_text().splitlines(keepends=True)
    file.write_text(first + second[: len(second) // 2])  # as a killed process leaves it
    again = book(observed=True)
    again.observe(METHODS["memo"], file)
    for subtask in ("OPEN(microwave)", "OPEN(oven)"):  # the first was asked, its answer had not reached the run's log
        again.retrieve(Key.parse(subtask))
    assert len(whole) == 2 and read_questions(file) == again.questions == whole
