"""Conformance suite for language backends.

``RULES[name](make)`` are the rules that any backend can be held to, whatever it understands; ``make`` returns a new,
unopened one. A backend that cannot answer here (no key, no network) may say so with ``LanguageModelError``, and raises
nothing else.

``check_language_model(make, requests)`` runs them too and goes further with ``requests`` that the backend can answer.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from typing import get_args

import attrs

from memo_core.interfaces.llm import Answer, Cause, LanguageModel, LanguageModelError, Message, Request, Usage
from memo_core.policy.prompting import messages
from memo_core.scene.graph import Node, Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.testing.rules import Limited, Rules

Make = Callable[[], LanguageModel]
RULES: Rules[Callable[[Make], None]] = Rules()
rule = RULES.rule
FINISHES = ("stop", "length", "refusal")
GIVE_UP_S = 30.0


def check_llm(make: Make) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken; to be limited breaks none."""
    for name, check in RULES.items():
        try:
            check(make)
        except Limited:
            continue
        except AssertionError as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error


def question(text: str = "Say one word.", phase: str = "plan") -> Request:
    """A question that any backend can be asked."""
    return Request(phase, (Message("system", "You answer briefly."), Message("user", text)), seed=0)


def _answer(model: LanguageModel, request: Request, **how: object) -> Answer | None:
    """The answer, or None when the backend says that it cannot."""
    try:
        answer = model.answer(request, **how)  # type: ignore[arg-type]
    except LanguageModelError as error:
        assert error.problem.strip(), "an error without a reason"
        return None
    assert isinstance(answer, Answer), f"answer() returns an Answer, not {type(answer).__name__}"
    return answer


class _Open:
    def __init__(self, make: Make) -> None:
        self._model = make()

    def __enter__(self) -> LanguageModel:
        self._model.open()
        return self._model

    def __exit__(self, *_: object) -> None:
        self._model.close()


@rule
def has_a_name(make: Make) -> None:
    """``name`` says before ``open`` which model this is."""
    assert isinstance(make().name, str) and make().name.strip()


@rule
def answers_or_says_why_not(make: Make) -> None:
    """Every request, also a nonsensical one, gets an ``Answer`` or a ``LanguageModelError`` with a reason."""
    with _Open(make) as model:
        for text in ("Say one word.", "", "⟂ ∄ \x00 \u202e", "word " * 3000):
            answer = _answer(model, question(text))
            assert answer is None or answer.finish in FINISHES, f"finish {answer.finish!r}" if answer else ""


@rule
def answers_a_question_of_memo(make: Make) -> None:
    """It answers the prompt with which MEMO asks for the next subtask. One that cannot (no key, no server, a bug that
    turns every answer into an error) is limited: the other rules have seen no answer of it."""
    cube = Node("red cube", "red cube", Pose((0.45, 0.1, 0.02)), (0.04, 0.04, 0.04), None, "object")
    scene = SceneGraph((cube,), (), Observation(Pose((0.4, 0.0, 0.4), (0.0, 1.0, 0.0, 0.0)), 0.08, False), 0.0, "table")
    prompt = messages("plan", None, scene, task="pick up the red cube", done=[])
    with _Open(make) as model:
        try:
            model.answer(Request("plan", prompt, seed=0))
        except LanguageModelError as error:
            raise Limited(f"it never answered, so the other rules saw no answer: {error.problem}") from None


@rule
def reports_what_a_call_cost(make: Make) -> None:
    """``usage`` counts tokens and seconds, never below zero; ``model`` names who answered."""
    with _Open(make) as model:
        answer = _answer(model, question())
        if answer is None:
            return
        usage = answer.usage
        assert isinstance(usage, Usage) and answer.model
        assert usage.prompt_tokens > 0 and usage.completion_tokens >= 0 and usage.latency_s >= 0, f"{usage}"
        assert usage.cost is None or usage.cost >= 0


@rule
def the_phase_is_for_logs_only(make: Make) -> None:
    """Answers come from the messages alone: where asking twice gives one text, another phase label gives it too."""
    with _Open(make) as model:
        one, again, other = (_answer(model, question(phase=phase)) for phase in ("plan", "plan", "no-such-phase"))
        assert (one is None) == (other is None), "the phase decides whether there is an answer"
        if one and again and other and one.text == again.text:
            assert other.text == one.text, "the phase changes the answer"


@rule
def pieces_add_up_to_the_answer(make: Make) -> None:
    """What ``on_text`` receives is, joined, the answer's text; a backend may also send nothing."""
    with _Open(make) as model:
        pieces: list[str] = []
        answer = _answer(model, question(), on_text=pieces.append)
        if answer is not None and pieces:
            assert "".join(pieces) == answer.text, "the pieces are another text than the answer"


@rule
def giving_up_early_is_no_accident(make: Make) -> None:
    """With ``cancelled`` true from the start it answers or raises ``LanguageModelError``, and soon."""
    with _Open(make) as model:
        started = time.monotonic()
        _answer(model, question(), cancelled=lambda: True)
        assert time.monotonic() - started < GIVE_UP_S


@rule
def answers_from_two_threads(make: Make) -> None:
    """An abandoned call may still be running when the next request comes."""
    with _Open(make) as model:
        failed: list[BaseException] = []

        def ask() -> None:
            try:
                _answer(model, question())
            except BaseException as error:
                failed.append(error)

        threads = [threading.Thread(target=ask) for _ in range(2)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(timeout=120)
        assert not failed, f"{type(failed[0]).__name__}: {failed[0]}"


@rule
def closes_twice_and_opens_again(make: Make) -> None:
    """``close`` is idempotent, and a closed backend can be opened again."""
    model = make()
    model.open()
    model.close()
    model.close()
    model.open()
    _answer(model, question())
    model.close()


@rule
def nothing_asked_is_an_error(make: Make) -> None:
    """A request without messages raises ``LanguageModelError`` and no other error."""
    with _Open(make) as model:
        try:
            model.answer(Request("plan", ()))
        except LanguageModelError as error:
            assert error.problem.strip(), "an error without a reason"
        except Exception as error:
            raise AssertionError(f"{type(error).__name__} instead of LanguageModelError: {error}") from error
        else:
            raise AssertionError("a request without messages was answered")


@rule
def errors_have_a_cause_that_is_known(make: Make) -> None:
    """``LanguageModelError.cause`` is one of ``Cause``; with a refused key or no credit, nothing is retryable."""
    with _Open(make) as model:
        for request in (question(), Request("plan", ())):
            try:
                model.answer(request)
            except LanguageModelError as error:
                assert error.cause in get_args(Cause), f"cause {error.cause!r}; known are {', '.join(get_args(Cause))}"
                assert not (error.retryable and error.cause in ("access", "quota")), f"{error.cause} is retryable"


# -- with questions that the backend can answer ------------------------------------------------------------------------


def check_language_model(make: Make, requests: Sequence[Request], deterministic: bool = False) -> None:
    """Run all rules, and those that need ``requests`` which the backend can answer. ``deterministic`` adds what holds
    for backends that claim to answer the same question the same way."""
    assert requests, "the suite needs at least one request that the backend can answer"
    check_llm(make)
    with _Open(make) as model:
        answers = [_check_answer(model, request) for request in requests]
        if len(requests) > 1:
            assert len({answer.text for answer in answers}) > 1, "varies: every question got the same answer"
        if deterministic:
            for request, answer in zip(requests, answers, strict=True):
                assert model.answer(request).text == answer.text, "deterministic: asked again, it answered otherwise"
                renamed = attrs.evolve(request, phase="another phase")
                assert model.answer(renamed).text == answer.text, (
                    "messages alone: the request's phase changed the answer"
                )
    if deterministic:
        with _Open(make) as again:
            for request, answer in zip(reversed(requests), reversed(answers), strict=True):
                assert again.answer(request).text == answer.text, "stateless: the order of questions changed an answer"


def _check_answer(model: LanguageModel, request: Request) -> Answer:
    pieces: list[str] = []
    answer = model.answer(request, on_text=pieces.append)
    assert isinstance(answer.text, str) and answer.text.strip(), "text: an answer without text"
    assert not pieces or "".join(pieces) == answer.text, "on_text: the pieces are not the answer"
    assert answer.usage.cost is None or answer.usage.cost >= 0, "usage: a cost below zero"
    assert all(isinstance(words, str) and words for words in answer.not_understood), "not_understood holds words"
    return answer


def user(text: str, phase: str = "code") -> Request:
    """A request with one user message."""
    return Request(phase, (Message("user", text),))
