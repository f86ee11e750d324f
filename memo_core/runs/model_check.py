"""Asking an experiment's model one example question for each phase, and what its answers show of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Literal

import attrs

from memo_core.config import Experiment
from memo_core.events import Event, ModelCalled
from memo_core.interfaces.llm import LanguageModelError, Usage
from memo_core.llm.budget import CHARACTERS_A_TOKEN
from memo_core.llm.readers import Unreadable
from memo_core.policy.example_questions import ExampleQuestion, example_questions
from memo_core.policy.model_questions import put
from memo_core.process.stop_switch import StopSwitch
from memo_core.runs.consolidation import calls_without_a_run
from memo_core.runs.factories import library_of, prompts_of, sandbox_of
from memo_core.skills.contract import documentation

ASKED_TWICE = "code"  # the phase whose prompt is longest
AGAIN = "code again"
ANSWER_TOKENS = 400  # expected of an answer, before any has been seen
CACHED_FROM = 1024  # tokens: most providers cache no shorter prompt
_OF_ONE_QUESTION = ("", "refusal", "length")  # causes that another question may not have

Ability = tuple[Literal["yes", "no", "unknown"], str]  # whether something works, and how that is known


@attrs.define
class Asked:
    """One question and its answer. ``problem``: why it could not be read, or why there is none."""

    phase: str
    problem: str = ""
    usage: Usage = Usage()
    first_text_s: float | None = None  # None: it came whole
    pieces: int = 0
    started: float = attrs.field(factory=time.monotonic)

    def note(self, event: Event) -> None:
        """Take the usage of a call; of several, the last."""
        if isinstance(event, ModelCalled):
            tokens = (event.prompt_tokens, event.completion_tokens, event.cost, event.latency_s, event.cached_tokens)
            self.usage = Usage(*tokens)

    def arrived(self, phase: str, piece: str) -> None:
        """Note a piece of the answer's text."""
        self.pieces += 1
        if self.first_text_s is None:
            self.first_text_s = time.monotonic() - self.started


@attrs.frozen
class ModelCheck:
    """Questions, answers and abilities. ``ended``: the error after which nothing more was asked; "" without one."""

    model: str
    asked: tuple[Asked, ...]
    abilities: dict[str, Ability]
    ended: str

    @property
    def works(self) -> bool:
        return not self.ended and not any(one.problem for one in self.asked)


def check_model(
    experiment: Experiment,
    stop: StopSwitch,
    emit: Callable[[Event], None],
    before: Callable[[str, int, float | None], None],
) -> ModelCheck:
    """Ask the example questions, one of them twice, within the limits of the ``run`` section.

    Args:
        experiment: selects model, prompts, robot, skills and sandbox.
        stop: ends the check.
        emit: receives events, such as repeated attempts.
        before: called before anything is asked with the model's name, the number of questions and about what they cost
            (US dollars; None: unknown); may raise.

    Raises:
        BackendUnavailable: if the model cannot be opened, for instance without its key.
        UnknownPrice, BudgetExceeded: as for runs.
        Stopped: if ``stop`` is pressed.
    """
    llm, asked, ended = experiment.create("llm"), list[Asked](), ""
    skills, subset = documentation(library_of(experiment)), sandbox_of(experiment).subset()
    questions: list[ExampleQuestion] = []
    for question in example_questions(prompts_of(experiment), experiment.create("robot"), skills, subset):
        questions += [question] * (2 if question.phase == ASKED_TWICE else 1)

    def noted(event: Event) -> None:
        asked[-1].note(event)
        emit(event)

    def on_text(phase: str, piece: str) -> None:
        asked[-1].arrived(phase, piece)

    with calls_without_a_run(experiment, llm, noted, stop, "llm check", on_text=on_text) as calls:
        costs = [llm.expected_cost(_expected(question)) for question in questions]
        before(llm.name, len(questions), None if None in costs else sum(costs))
        for question in questions:
            again = bool(asked) and asked[-1].phase == question.phase
            asked.append(one := Asked(AGAIN if again else question.phase))
            try:
                put(calls, question.phase, question.messages, question.read, 0, experiment.seed, "", question.schema)
            except Unreadable as error:
                one.problem = error.problem
            except LanguageModelError as error:
                one.problem = error.problem
                if error.cause not in _OF_ONE_QUESTION:
                    ended = str(error)
                    break
        return ModelCheck(llm.name, tuple(asked), {} if ended else _abilities(asked, llm.unsupported()), ended)


def _expected(question: ExampleQuestion) -> Usage:
    characters = sum(len(message.text) for message in question.messages)
    return Usage(characters // CHARACTERS_A_TOKEN, ANSWER_TOKENS)


def _abilities(asked: Sequence[Asked], unsupported: dict[str, str]) -> dict[str, Ability]:
    json = [one for one in asked if one.phase in ("feedback", "cluster")]
    return {
        "streaming": _streaming(max(one.pieces for one in asked), unsupported),
        "JSON schema": _schemas(next((one.phase for one in json if one.problem), ""), unsupported),
        "caching": _caching(next(one.usage for one in asked if one.phase == AGAIN), unsupported),
    }


def _streaming(pieces: int, unsupported: dict[str, str]) -> Ability:
    if pieces > 1:
        return "yes", f"an answer arrived in {pieces} pieces"
    if pieces == 1 or "stream" in unsupported:
        return "no", unsupported.get("stream", "each answer arrived in one piece")
    return "unknown", "no text arrived"


def _schemas(unread: str, unsupported: dict[str, str]) -> Ability:
    if "schema" in unsupported:
        return "no", unsupported["schema"]
    return ("unknown", f"the answer of {unread} could not be read") if unread else ("yes", "all such answers fit it")


def _caching(usage: Usage, unsupported: dict[str, str]) -> Ability:
    asked = usage.prompt_tokens
    if usage.cached_tokens:
        return "yes", f"{usage.cached_tokens} of {asked} prompt tokens of a repeated question"
    if "usage" in unsupported:
        return "unknown", unsupported["usage"]
    if asked < CACHED_FROM:
        return "unknown", f"the repeated question has {asked} tokens, and few providers cache less than {CACHED_FROM}"
    return "no", f"none of {asked} prompt tokens of a repeated question"
