"""``match: situation``: a recording outlives a prompt that is worded anew, and is not stretched further than that."""

from __future__ import annotations

import attrs
import pytest
from test_replay import player, record

from memo_core.interfaces.llm import LanguageModelError, Message
from tests.support.offline_prompts import Entry, box_with_door, code_request, request

CRATE = box_with_door()[0]
OVEN = box_with_door("oven", edge="bottom")[0]


@attrs.frozen
class Attempt:
    code: str = "look()"
    printed: str = "p"
    ended: str = "MotionError"


def reworded(asked):
    """The same question by another version of the prompt: other explanations, functions and numbers of the scene."""
    messages = []
    for message in asked.messages:
        text = message.text.replace("metres", "m").replace("One Python code block", "A block of Python")
        text = text.replace("get_objects() -> list", "yodel() -> None").replace("0.700 0.050", "0.810 0.330")
        messages.append(Message(message.role, text + " Think.", message.images))
    return attrs.evolve(asked, messages=tuple(messages))


def code(subtask="OPEN(crate)", corrections=(), attempts=(), **more):
    return code_request(CRATE, subtask, corrections, attempts=attempts, **more)


def test_a_question_in_other_words_is_answered_and_says_so(tmp_path):
    asked = [code(), code("CLOSE(crate)"), code(attempts=[Attempt()]), code(corrections=["Pull in an arc."])]
    record(tmp_path / "r.jsonl", {"code": ["a = 1", "b = 2", "c = 3", "d = 4"]}, asked)
    again = player(tmp_path / "r.jsonl", match="situation")
    for one, text in reversed(list(zip(asked, ("a = 1", "b = 2", "c = 3", "d = 4"), strict=True))):
        answer = again.answer(reworded(one))
        assert answer.text == text and "prompt that has changed" in answer.note
    with pytest.raises(LanguageModelError, match="has no answer to this question"):
        player(tmp_path / "r.jsonl", match="numbers").answer(reworded(asked[0]))


def test_the_very_same_question_comes_first_and_says_nothing(tmp_path):
    asked = [code(task="one"), reworded(code(task="one"))]
    record(tmp_path / "r.jsonl", {"code": ["a = 1", "b = 2"]}, asked)
    again = player(tmp_path / "r.jsonl", match="situation")
    second = again.answer(asked[1])
    assert second.text == "b = 2" and not second.note


def test_one_situation_asked_twice_gets_its_answers_in_their_order_and_then_the_last(tmp_path):
    plan = request("plan", CRATE, task="open it", done=["OPEN(crate): nobody said whether it worked"])
    other = request("plan", OVEN, task="open it", done=["OPEN(crate): a person saw that it worked"])
    record(tmp_path / "r.jsonl", {"plan": ["OPEN(crate)", "DONE"]}, [plan, other])
    again = player(tmp_path / "r.jsonl", match="situation")
    assert [again.answer(reworded(plan)).text for _ in range(3)] == ["OPEN(crate)", "DONE", "DONE"]


@pytest.mark.parametrize(
    "asked",
    [
        code("OPEN(oven)"),
        code(task="something else"),
        code(corrections=["Pull straight."]),
        code(templates=[Entry("def f(a):\n    '''x'''\n    wait(1)", "OPEN(jar)")]),
        code(done=["PICK_UP(food)"]),
        code(attempts=[Attempt()]),
        code(attempts=[Attempt(), Attempt()], corrections=["Pull in an arc."]),
        request("plan", CRATE, task="do it", done=[]),
        attrs.evolve(code(), seed=7),
    ],
    ids=["subtask", "task", "correction", "template", "done", "attempt", "attempts", "phase", "seed"],
)
def test_another_situation_is_not_answered(tmp_path, asked):
    recorded = [code(), code(corrections=["Pull in an arc."], attempts=[Attempt()])]
    record(tmp_path / "r.jsonl", {"code": ["a = 1", "b = 2"]}, recorded)
    with pytest.raises(LanguageModelError, match="has no answer to this question"):
        player(tmp_path / "r.jsonl", match="situation").answer(reworded(asked))


def test_a_question_that_is_no_prompt_of_memos_has_no_situation(tmp_path):
    asked = attrs.evolve(code(), messages=(Message("user", "Say one word."),))
    record(tmp_path / "r.jsonl", {"code": ["word"]}, [asked])
    again = player(tmp_path / "r.jsonl", match="situation")
    with pytest.raises(LanguageModelError):
        again.answer(attrs.evolve(asked, messages=(Message("user", "Say two words."),)))
