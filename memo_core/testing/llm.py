"""Conformance suite for language backends: ``RULES[name](make)``, where ``make`` returns a new, unopened one.

A backend that cannot answer here (no key, no network) may say so with ``LanguageModelError``, and raises nothing else.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from memo_core.interfaces.llm import Answer, LanguageModel, LanguageModelError, Message, Request, Usage

Make = Callable[[], LanguageModel]
RULES: dict[str, Callable[[Make], None]] = {}
FINISHES = ("stop", "length", "refusal")
GIVE_UP_S = 30.0


def rule(check: Callable[[Make], None]) -> Callable[[Make], None]:
    """Register a check; its docstring is the promise."""
    RULES[check.__name__] = check
    return check


def check_llm(make: Make) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken."""
    for name, check in RULES.items():
        try:
            check(make)
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
    assert isinstance(answer, Answer), f"answer returned {type(answer).__name__}"
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
    """Every request gets an ``Answer`` or a ``LanguageModelError`` with a reason, also one that makes no sense."""
    with _Open(make) as model:
        for text in ("Say one word.", "", "⟂ ∄ \x00 \u202e", "word " * 3000):
            answer = _answer(model, question(text))
            assert answer is None or answer.finish in FINISHES, f"finish {answer.finish!r}" if answer else ""


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
    """A late answer that was given up may still be under way when the next question comes."""
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
