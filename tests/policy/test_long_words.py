"""Words that are too long to be read are stored in full and set aside with the reason; the run and the book go on."""

from __future__ import annotations

import pytest

from memo_core.errors import InvalidArgument
from memo_core.events import FeedbackGiven, Problem
from memo_core.interfaces.llm import LanguageModelError
from memo_core.interfaces.teacher import ReadBack, Verdict
from memo_core.policy.feedback_processing import FeedbackProcessor, retry
from memo_core.policy.model_questions import Questions
from memo_core.skillbook.model.entries import Note
from memo_core.skillbook.model.keys import Key
from memo_core.text.reading_limits import LONGEST_WORDS, excerpt, too_long
from tests.support.loop_setup import BESIDE, GRASP, NO, NOTES, TEMPLATE, YES, Bench

SCRIPT = {"plan": ["PICK_UP(red cube)", "DONE"], "code": [BESIDE, GRASP], "template": [TEMPLATE], "feedback": [NOTES]}
LONG = "that is not a cup, it is a mug " * 40_000
TEXTS = [LONG, "👎" * 200_000, "a" * 10_000_000, "," * 10_000, "pasted\n" * 300_000]


@pytest.mark.process
@pytest.mark.parametrize("words", TEXTS)
def test_a_long_correction_is_stored_in_full_set_aside_and_told(sandbox, book, words):
    heard = []
    session = {"read_back": lambda noted: heard.append(noted) or ReadBack("accepted")}
    bench = Bench(sandbox, book, SCRIPT, [Verdict("correct", words), YES], session=session)
    bench.run()
    [kept] = [said for said in book.pending_feedback(parked=True) if said.kind == "correction"]
    assert kept.words == words and kept.status == "parked" and kept.reason == too_long(words)
    assert f"at most {LONGEST_WORDS} are read" in heard[0].question and len(heard[0].words) < 500
    assert [len(event.words) < 500 for event in bench.of(FeedbackGiven)] == [True]
    assert any(too_long(words) in event.message for event in bench.of(Problem))
    assert bench.llm.prompts("feedback") == [] and all(len(prompt) < 60_000 for prompt in bench.llm.prompts("code"))


def test_the_same_said_in_fewer_words_is_learnt(sandbox, book):
    heard = []

    def read_back(noted):
        heard.append(noted)
        return ReadBack("reworded", "lower") if not noted.notes else ReadBack("accepted")

    Bench(sandbox, book, SCRIPT, [Verdict("correct", LONG), YES], session={"read_back": read_back}).run()
    assert len(heard) == 2 and len(book.entries("correction")) == 1


@pytest.mark.parametrize("method", ["memo-s", "droc-v"])
def test_every_method_tells_that_the_words_are_not_read(sandbox, book, method):
    bench = Bench(sandbox, book, SCRIPT, [Verdict("correct", LONG), YES], method=method)
    bench.run()
    assert any(too_long(LONG) in event.message for event in bench.of(Problem))
    assert LONG in [said.words for said in book.feedback_of_run("run-1")]
    assert all(len(prompt) < 60_000 for prompt in bench.llm.prompts("code"))


def test_feedback_of_others_that_cannot_be_asked_about_blocks_no_run(sandbox, book):
    book.record_feedback("x" * 2_000_000, "ann", subtask="PICK_UP(red cube)")
    book.record_feedback("lower", "ann", subtask="PICK_UP(red cube)", scene_graph="s" * 2_000_000)
    book.record_feedback("higher", "ann", subtask="PICK_UP(red cube)", code="# " + "c" * 2_000_000)
    book.record_feedback("over its middle", "ann", subtask="PICK_UP(red cube)")
    Bench(sandbox, book, SCRIPT, None).run()
    waiting = book.pending_feedback(parked=True)
    assert [said.status for said in waiting] == ["parked"] * 3 and all(said.reason for said in waiting)
    assert len(book.entries("correction")) == 1, "what could be asked about was learnt"


@pytest.mark.parametrize("cause", ["refusal", "length"])
def test_a_question_that_a_model_never_answers_is_set_aside_and_can_be_taken_up_again(sandbox, book, cause):
    book.record_feedback("lower", "ann", subtask="PICK_UP(red cube)")
    refused = LanguageModelError("scripted", "withheld", cause=cause)
    bench = Bench(sandbox, book, SCRIPT | {"feedback": [refused, NOTES]}, None)
    bench.run()
    [aside] = book.pending_feedback(parked=True)
    assert aside.status == "parked" and "withheld" in aside.reason
    processor = FeedbackProcessor(Questions(bench.session).ask, book, bench.events.append)
    assert [noted.outcome for noted in retry(processor, book)] == ["learnt"]


def test_one_question_that_fails_does_not_keep_the_others_from_being_asked(sandbox, book):
    for words in ("lower", "higher"):
        book.record_feedback(words, "ann", subtask="PICK_UP(red cube)")
    failed = LanguageModelError("scripted", "bad request")
    Bench(sandbox, book, SCRIPT | {"feedback": [failed, NOTES, *[failed] * 5]}, None).run()
    [learnt], [left] = book.entries("correction"), book.pending_feedback()
    assert left.words == "lower" and learnt.feedback != left.id


def test_words_within_the_limit_are_repeated_as_they_are():
    assert excerpt("x" * LONGEST_WORDS) == "x" * LONGEST_WORDS and not too_long("x" * LONGEST_WORDS)
    assert excerpt("x" * (LONGEST_WORDS + 1)).startswith("x" * 200 + " … (4001 characters")


def test_a_short_correction_is_learnt_as_ever(sandbox, book):
    Bench(sandbox, book, SCRIPT, [NO, YES]).run()
    assert len(book.entries("correction")) == 1 and not book.pending_feedback(parked=True)


def test_an_entry_that_no_prompt_can_hold_is_told_and_passed_over(sandbox, book):
    spoken = book.record_feedback("lower", "ann", subtask="PICK_UP(red cube)", kept_only="an import")
    key = Key.parse("PICK_UP(red cube)")
    book.add_notes(spoken, [Note(key, "Lower. " * 300_000), Note(key, "Grip it at its middle.")])
    bench = Bench(sandbox, book, SCRIPT, None)
    bench.run()
    assert all("middle" in prompt and len(prompt) < 60_000 for prompt in bench.llm.prompts("code"))
    assert any("2100000 characters" in event.message for event in bench.of(Problem))
    with pytest.raises(InvalidArgument, match=f"at most {LONGEST_WORDS} characters"):
        book.edit(book.entries("correction")[1].id, "x" * (LONGEST_WORDS + 1), "ann")
