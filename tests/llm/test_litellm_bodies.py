"""A whole answer in place of a stream is read if it is one; a mistake of our own is not taken for one that is none."""

from __future__ import annotations

import json

import pytest
from memo_llm.litellm import conversion
from memo_llm.litellm.conversion import Spoken, read_body
from memo_llm.litellm.library import quiet_litellm

CHOICE = {"index": 0, "message": {"role": "assistant", "content": "whole"}, "finish_reason": "length"}
ANSWER = {"id": "1", "object": "chat.completion", "created": 1, "model": "m", "choices": [CHOICE]}


@pytest.fixture(scope="module", autouse=True)
def quiet():
    quiet_litellm()


def test_a_whole_answer_is_read():
    spoken = Spoken()
    assert read_body(json.dumps(ANSWER).encode(), spoken)
    assert (spoken.text, spoken.ended) == ("whole", "length")


@pytest.mark.parametrize(
    "body",
    [
        b"",
        b"\xff",
        json.dumps(ANSWER).encode()[:60],  # recorded in part
        b"[" * 100_000,
        b"null",
        b"[]",
        b"3",
        b"{}",
        b'{"candidates": []}',
        b'{"error": {"message": "no"}}',
        b'{"choices": null}',
        b'{"choices": []}',
        b'{"choices": [{}]}',
        b'{"choices": [{"index": 0, "message": {"role": "assistant", "content": [1]}, "finish_reason": "stop"}]}',
    ],
)
def test_what_is_no_whole_answer_is_told_apart(body):
    spoken = Spoken()
    assert not read_body(body, spoken)
    assert spoken == Spoken()


@pytest.mark.parametrize("mistake", [TypeError, AttributeError, NameError, KeyError])
def test_a_mistake_in_reading_comes_out(monkeypatch, mistake):
    def wrong(response, spoken):
        raise mistake("a mistake")

    monkeypatch.setattr(conversion, "read_whole", wrong)
    with pytest.raises(mistake):
        read_body(json.dumps(ANSWER).encode(), Spoken())


def test_a_wrong_call_of_litellm_comes_out(monkeypatch):
    monkeypatch.setattr("litellm.utils.convert_to_model_response_object", lambda given: given)
    with pytest.raises(TypeError):
        read_body(json.dumps(ANSWER).encode(), Spoken())
