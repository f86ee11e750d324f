"""Conformance suite for methods: ``RULES[name](make)``, where ``make`` returns a new method.

The session has a fake environment, a language model that fails every call, and a silent teacher: the minimum that every
method must handle. How well it does tasks is measured by evaluations."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from memo_core.errors import MemoError
from memo_core.policy.method_interface import Method
from memo_core.policy.person import Person
from memo_core.policy.results import RunResult
from memo_core.policy.run_context import Session
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.sandbox import Sandbox
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from memo_core.testing.fake_environment import FakeEnvironment
from memo_core.testing.fake_llm import ScriptedModel
from memo_core.testing.rules import Rules

Make = Callable[[], Method]
RULES: Rules[Callable[[Make], None]] = Rules()
rule = RULES.rule
ENOUGH_S = 10.0


def check_method(make: Make) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken."""
    for name, check in RULES.items():
        try:
            check(make)
        except AssertionError as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error


class _Leaving(Person):
    """A person who may have ended the run, and says nothing."""

    def __init__(self, ended: bool) -> None:
        self._ended = ended

    def has_ended(self) -> bool:
        return self._ended


def _session(environment: FakeEnvironment, ending: bool = False) -> Session:
    library = skill_library(BUILTIN_SKILLS)
    return Session(
        run="conformance",
        environment=environment,
        llm=ScriptedModel({}),
        skills=library,
        sandbox=Sandbox(library),
        settings=RunSettings(attempts=1, subtasks=2, video="off"),
        stop=StopSwitch(),
        emit=lambda event: None,
        person=_Leaving(ending),
    )


def _run(make: Make, session: Session) -> tuple[Any, BaseException | None]:
    """The result or the error of a run in a worker thread, as a run has it; fails when it takes too long."""
    ended: list[tuple[Any, BaseException | None]] = []

    def work() -> None:
        try:
            ended.append((make().run(session), None))
        except BaseException as error:
            ended.append((None, error))

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(ENOUGH_S)
    session.sandbox.close()
    assert ended, f"it still ran after {ENOUGH_S:g} s"
    return ended[0]


@rule
def has_a_name(make: Make) -> None:
    """``name`` says which method this is, in reports and records."""
    assert isinstance(make().name, str) and make().name.strip()


@rule
def ends_with_a_result_or_a_clear_error(make: Make) -> None:
    """When the language model fails, nobody watches and there is no book, it ends with a ``RunResult`` or a
    ``MemoError``, and nothing else."""
    result, error = _run(make, _session(FakeEnvironment()))
    if error is not None:
        assert isinstance(error, MemoError), f"raised {type(error).__name__}: {error}"
    else:
        assert isinstance(result, RunResult), f"returned {type(result).__name__}"
        assert result.reason.strip(), "no reason"


@rule
def a_latched_stop_moves_nothing(make: Make) -> None:
    """With the stop latched and the run to end, it ends soon, with ``Stopped`` or a result, and commands nothing."""
    environment = FakeEnvironment()
    session = _session(environment, ending=True)
    environment.link.stop()
    session.stop.press()
    started = time.monotonic()
    result, error = _run(make, session)
    assert error is None or isinstance(error, MemoError), f"raised {type(error).__name__}: {error}"
    assert time.monotonic() - started < ENOUGH_S
    assert not environment.control.commands, f"commanded {environment.control.commands} after the stop"
    assert result is None or not result.finished, "it says that the task is done"


@rule
def keeps_nothing_between_runs(make: Make) -> None:
    """One method may do several runs, one after the other."""
    method = make()
    for _ in range(2):
        _, error = _run(lambda: method, _session(FakeEnvironment()))
        assert error is None or isinstance(error, MemoError), f"raised {type(error).__name__}: {error}"
