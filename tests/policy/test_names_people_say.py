"""A person says that a thing is called by a wrong name: perception is told at once, the book keeps it, and forgets it
with the person."""

from __future__ import annotations

import pytest

from memo_core.events import NameCorrected
from memo_core.interfaces.teacher import Verdict
from memo_core.testing.fake_environment import FakeEnvironment
from tests.support.loop_setup import BESIDE, GRASP, NOTES, TEMPLATE, YES, Bench

PICK = "PICK_UP(red cube)"
WORDS = "That is not a red cube, it is a sugar box."


def taught(sandbox, book, words, notes=()):
    script = {"plan": [PICK, "DONE"], "code": [BESIDE, GRASP], "feedback": list(notes), "template": [TEMPLATE]}
    told = []
    environment = FakeEnvironment()
    environment.correct_names = told.append
    bench = Bench(sandbox, book, script, [Verdict("correct", words), YES], environment=environment)
    bench.run()
    return bench, told


@pytest.mark.process
def test_perception_is_told_and_no_model_is_asked_what_to_make_of_it(sandbox, book):
    bench, told = taught(sandbox, book, WORDS)
    ((said,),) = told
    assert (said.label, said.instead, said.who, said.said) == ("red cube", "sugar box", "ana", WORDS)
    assert [(e.label, e.instead, e.who) for e in bench.of(NameCorrected)] == [("red cube", "sugar box", "ana")]
    assert not bench.llm.prompts("feedback")
    (kept,) = [one for one in book.feedback_of_run("run-1") if one.kind == "correction"]
    assert (kept.words, kept.status) == (WORDS, "kept")


def test_the_book_knows_it_in_later_runs_and_forgets_it_with_the_person(sandbox, book):
    taught(sandbox, book, WORDS)
    book.record_feedback("that is not a good idea", "ana", subtask=PICK, scene_graph="no table")
    (said,) = book.name_corrections()
    assert (said.label, said.instead, said.who, said.id) == ("red cube", "sugar box", "ana", "")
    assert len(said.size) == 3
    book.forget("ana")
    assert book.name_corrections() == ()


def test_what_else_was_said_is_learnt_as_ever(sandbox, book):
    bench, told = taught(sandbox, book, f"{WORDS} Come from the top.", [NOTES])
    assert len(told) == 1 and bench.llm.prompts("feedback")
    assert len(book.name_corrections()) == 1


def test_without_a_book_it_holds_for_the_run(sandbox):
    _, told = taught(sandbox, None, WORDS)
    assert [one.instead for one in told[0]] == ["sugar box"]
