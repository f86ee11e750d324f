"""Conformance suite for language backends.

``check_language_model(make, requests)`` raises ``AssertionError`` naming the promise that a backend breaks. ``make``
returns a new, unopened backend; ``requests`` are questions it can answer. ``deterministic`` adds the rules that only
hold for backends that claim to answer the same question the same way.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import attrs

from memo_core.interfaces.llm import Answer, LanguageModel, LanguageModelError, Message, Request


def check_language_model(
    make: Callable[[], LanguageModel], requests: Sequence[Request], deterministic: bool = False
) -> None:
    """Run every rule."""
    assert requests, "the suite needs at least one request that the backend can answer"
    model = make()
    model.open()
    try:
        assert isinstance(model.name, str) and model.name, "name: a backend has a name"
        answers = [_check_answer(model, request) for request in requests]
        if len(requests) > 1:
            assert len({answer.text for answer in answers}) > 1, "varies: every question got the same answer"
        _check_unanswerable(model)
        if deterministic:
            for request, answer in zip(requests, answers, strict=True):
                assert model.answer(request).text == answer.text, "deterministic: asked again, it answered otherwise"
                renamed = attrs.evolve(request, phase="another phase")
                assert model.answer(renamed).text == answer.text, (
                    "messages alone: the request's phase changed the answer"
                )
    finally:
        model.close()
        model.close()
    if deterministic:
        again = make()
        again.open()
        try:
            for request, answer in zip(reversed(requests), reversed(answers), strict=True):
                assert again.answer(request).text == answer.text, "stateless: the order of questions changed an answer"
        finally:
            again.close()


def _check_answer(model: LanguageModel, request: Request) -> Answer:
    pieces: list[str] = []
    answer = model.answer(request, on_text=pieces.append)
    assert isinstance(answer, Answer), f"answer() returns an Answer, not {type(answer).__name__}"
    assert isinstance(answer.text, str) and answer.text.strip(), "text: an answer without text"
    assert not pieces or "".join(pieces) == answer.text, "on_text: the pieces are not the answer"
    usage = answer.usage
    assert usage.prompt_tokens >= 0 and usage.completion_tokens >= 0, "usage: tokens below zero"
    assert usage.cost is None or usage.cost >= 0, "usage: a cost below zero"
    assert usage.latency_s >= 0, "usage: a latency below zero"
    assert all(isinstance(words, str) and words for words in answer.not_understood), "not_understood holds words"
    return answer


def _check_unanswerable(model: LanguageModel) -> None:
    """A request without any message is nobody's question."""
    try:
        model.answer(Request("plan", ()))
    except LanguageModelError as error:
        assert error.problem, "errors: a LanguageModelError says what the problem is"
    except Exception as error:
        raise AssertionError(f"errors: {type(error).__name__} instead of LanguageModelError: {error}") from error
    else:
        raise AssertionError("errors: a request without messages was answered")


def user(text: str, phase: str = "code") -> Request:
    """A request with one user message."""
    return Request(phase, (Message("user", text),))
