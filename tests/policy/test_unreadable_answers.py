"""An answer that cannot be read is asked for again with the precise reason, at most twice; what people said stays."""

from __future__ import annotations

import json

import pytest

from memo_core.events import EntryStored, Problem
from memo_core.interfaces.llm import Answer, LanguageModelError
from memo_core.llm.readers import Unreadable
from memo_core.policy.feedback_processing import FeedbackProcessor, retry
from memo_core.policy.model_questions import Questions
from tests.support.loop_setup import GRASP, NO, NOTES, SAID, TEMPLATE, YES, Bench

BESIDE = "```python\nmove_to([0.4, 0.2, 0.3])\n```"


def last(bench: Bench, phase: str) -> list[str]:
    """The last message of every question of a phase."""
    return bench.llm.prompts(phase)


@pytest.mark.process
def test_a_name_that_is_not_in_the_scene_is_asked_again_with_the_closest(sandbox, book):
    script = {"plan": ["PICK_UP(read cube)", "PICK_UP(red cube)", "DONE"], "code": [GRASP], "template": [TEMPLATE]}
    bench = Bench(sandbox, book, script, [YES])
    assert bench.run().subtasks[0].subtask == "PICK_UP(red cube)"
    again = last(bench, "plan")[1]
    assert "nothing in the scene is called 'read cube'; the closest names are 'red cube'" in again
    roles = [message.role for message in bench.llm.asked[1].messages]
    assert roles == ["system", "user", "assistant", "user"]
    assert bench.llm.asked[1].messages[2].text == "PICK_UP(read cube)"


def test_a_part_of_a_name_that_no_other_thing_shares_is_that_thing(sandbox, book):
    names = [node.label for node in Bench(sandbox, None, {}, None).environment.look().nodes]
    assert sum("red" in name for name in names) == 1
    script = {"plan": ["PICK_UP(red)", "DONE"], "code": [GRASP], "template": [TEMPLATE]}
    assert Bench(sandbox, book, script, [YES]).run().subtasks[0].subtask == "PICK_UP(red cube)"


def test_a_plan_that_stays_unreadable_is_asked_for_three_times_and_ends_the_run(sandbox, book):
    bench = Bench(sandbox, book, {"plan": ["PICK_UP(moon)"] * 5}, None)
    with pytest.raises(Unreadable, match="'moon'"):
        bench.run()
    assert len(last(bench, "plan")) == 3


def test_code_that_breaks_off_is_asked_for_again_with_its_line(sandbox, book):
    cut = "```python\nopen_gripper()\nmove_to([0.4"
    script = {"plan": ["PICK_UP(red cube)", "DONE"], "code": [cut, GRASP], "template": [TEMPLATE]}
    bench = Bench(sandbox, book, script, [YES])
    assert bench.run().subtasks[0].status == "approved"
    assert "breaks off (line 2" in last(bench, "code")[1]


def test_words_whose_notes_stay_unreadable_are_set_aside_with_the_reason_and_learnt_on_a_retry(sandbox, book):
    place = json.dumps({"corrections": ["Go to [0.4, 0.1, 0.2]."], "general": []})
    script = {
        "plan": ["PICK_UP(red cube)", "DONE"],
        "code": [BESIDE, GRASP],
        "feedback": [place, place, place, NOTES],
        "template": [TEMPLATE],
    }
    bench = Bench(sandbox, book, script, [NO, YES])
    bench.run()
    [kept] = book.pending_feedback(parked=True)
    assert kept.words == SAID and kept.status == "parked" and "coordinates" in kept.reason
    assert len(last(bench, "feedback")) == 3 and "coordinates" in last(bench, "feedback")[1]
    assert any("coordinates" in event.message for event in bench.of(Problem))

    processor = FeedbackProcessor(Questions(bench.session).ask, book, bench.events.append)
    [noted] = retry(processor, book)
    assert noted.outcome == "learnt" and not book.pending_feedback(parked=True)
    assert [event for event in bench.of(EntryStored) if event.kind == "correction"]


def test_words_that_teach_nothing_are_set_aside_at_once_with_what_would_have_to_be_asked(sandbox, book):
    unclear = json.dumps({"corrections": [], "general": [], "unclear": "what was wrong about the grasp"})
    script = {
        "plan": ["PICK_UP(red cube)", "DONE"],
        "code": [BESIDE, GRASP],
        "feedback": [unclear],
        "template": [TEMPLATE],
    }
    bench = Bench(sandbox, book, script, [NO, YES])
    bench.run()
    [kept] = book.pending_feedback(parked=True)
    assert kept.words == SAID and "what was wrong about the grasp" in kept.reason
    assert len(last(bench, "feedback")) == 1
    assert not book.entries("correction")


FILTER = "the provider's content filter withheld the answer (SAFETY); other words or another llm.model may help"
LIMIT = "the answer was cut off at the limit of tokens; raise llm.max_answer_tokens (77)"
BLOCKED = LanguageModelError("scripted", "refuses the question: SAFETY", cause="refusal")
WITHHELD = [
    (Answer("", "refusal", note=FILTER), FILTER, "refusal"),
    (Answer("half", "length", note=LIMIT), LIMIT, "length"),
    (Answer("", "refusal"), "a content filter refuses to answer", "refusal"),
    (Answer("", "length"), "cut off at the limit of tokens", "length"),
    (BLOCKED, "refuses the question: SAFETY", "refusal"),
]


@pytest.mark.parametrize(("withheld", "why", "cause"), WITHHELD)
def test_a_plan_that_is_withheld_ends_the_run_with_the_reason_in_words_for_people(sandbox, book, withheld, why, cause):
    bench = Bench(sandbox, book, {"plan": [withheld] * 3}, None)
    with pytest.raises(Unreadable) as raised:
        bench.run()
    assert raised.value.cause == cause and "scripted" in raised.value.told and why in raised.value.told
    assert "answer more briefly" not in str(raised.value) and "nothing here is dangerous" not in str(raised.value)
    assert len(bench.llm.asked) == (1 if withheld is BLOCKED else 3), "a blocked question stays blocked"


@pytest.mark.parametrize(("withheld", "why", "cause"), WITHHELD)
def test_code_that_is_withheld_ends_its_subtask_with_the_reason(sandbox, book, withheld, why, cause):
    bench = Bench(sandbox, book, {"plan": ["PICK_UP(red cube)", "DONE"], "code": [withheld] * 3}, [YES])
    [subtask] = bench.run().subtasks
    assert subtask.status == "unobserved" and why in subtask.problem


@pytest.mark.parametrize(("withheld", "why", "cause"), WITHHELD)
def test_words_whose_notes_are_withheld_are_set_aside_with_the_reason(sandbox, book, withheld, why, cause):
    script = {
        "plan": ["PICK_UP(red cube)", "DONE"],
        "code": [BESIDE, GRASP],
        "feedback": [withheld] * 3,
        "template": [TEMPLATE],
    }
    bench = Bench(sandbox, book, script, [NO, YES])
    assert bench.run().subtasks[0].status == "approved", "the run goes on"
    [kept] = book.pending_feedback(parked=True)
    assert kept.words == SAID and kept.status == "parked" and why in kept.reason
    assert any(why in event.message for event in bench.of(Problem))


@pytest.mark.parametrize(("withheld", "why", "cause"), WITHHELD)
def test_a_template_that_is_withheld_is_told_with_the_reason(sandbox, book, withheld, why, cause):
    script = {"plan": ["PICK_UP(red cube)", "DONE"], "code": [GRASP], "template": [withheld] * 3}
    bench = Bench(sandbox, book, script, [YES])
    assert bench.run().subtasks[0].status == "approved"
    assert any(why in event.message for event in bench.of(Problem))


def test_a_model_is_asked_again_after_a_withheld_answer_without_an_empty_message(sandbox, book):
    script = {"plan": [Answer("", "refusal"), Answer("half", "length"), "DONE"]}
    bench = Bench(sandbox, book, script, None)
    bench.run()
    roles = [message.role for message in bench.llm.asked[2].messages]
    assert roles == ["system", "user", "user", "assistant", "user"]
    assert "it is a refusal" in bench.llm.asked[1].messages[-1].text
    assert "answer more briefly" in bench.llm.asked[2].messages[-1].text


def test_which_prompt_a_question_was_made_from_is_with_it(sandbox, book):
    bench = Bench(sandbox, book, {"plan": ["DONE"]}, None)
    bench.run()
    assert bench.llm.asked[0].prompt == bench.session.prompts.stamp("plan")
