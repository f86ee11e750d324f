"""How tests write down wrong behaviours of a task, and let the task's own success check judge them.

A table maps a task to robot code that a person would *not* call doing it: nearly right, sloppy, or cheating. Each entry
says which words the verdict must give as the reason, so that it fails for what is wrong with it and not by accident:

    WRONG = {
        PickTheLeftCan: (
            Wrong("nearly right", "lifts the other can", "pick_up(rightmost())", because="not held"),
            ...
        ),
    }

    rehearsal = rehearsal_fixture()
    test_a_wrong_behaviour_is_not_success, test_the_reference_is_success_and_doing_nothing_is_not = judged(WRONG)

The functions of the task's solution may be called: ``using`` names the files of ``memo_tabletop.solutions``. A
``before`` that several behaviours share is performed once and restored for each. One world is kept open, of the task
asked for last, so keep a task's cases together.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal

import attrs
import pytest
from memo_tabletop.reference import solution

from memo_core.cli.options import load
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.environment.task_verification import run_code
from memo_core.interfaces.task import Outcome, Task
from memo_core.runs.factories import environment_of, sandbox_of

SEED = 0


@attrs.frozen
class Wrong:
    """One wrong behaviour. ``because`` must be part of the verdict's reason; ``error`` part of the error with which the
    code ends, for behaviours that end with one."""

    how: Literal["nearly right", "sloppy", "cheating"]
    what: str
    code: str
    because: str
    before: str = ""
    using: tuple[str, ...] = ()
    error: str = ""
    seed: int = SEED


def each(table: Mapping[Callable[[], Task], Sequence[Wrong]]) -> list[Any]:
    """pytest parameters (task class, wrong behaviour), a task's together."""
    return [
        pytest.param(make, wrong, id=f"{make.name}: {wrong.how}, {wrong.what}")  # type: ignore[attr-defined]
        for make, wrongs in table.items()
        for wrong in wrongs
    ]


class Rehearsal:
    """Performs behaviours in one world a task, put back to its start before each."""

    def __init__(self, *overrides: str) -> None:
        self._experiment = load(None, list(overrides))[1]
        self._key: tuple[Callable[[], Task], int] | None = None
        self._checkpoints: dict[str, bytes] = {}

    def __enter__(self) -> Rehearsal:
        self._sandbox = sandbox_of(self._experiment)
        self._sandbox.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._leave()
        self._sandbox.__exit__(*error)

    def outcome(self, make: Callable[[], Task], code: str, before: str = "", seed: int = SEED) -> tuple[Outcome, str]:
        """(the verdict after the code, how the code ended if not at its end)."""
        world = self._at(make, seed, before)
        execution = run_code(world, code, self._sandbox)
        return world.check(), execution.error

    @property
    def world(self) -> SimulatedEnvironment:
        """As the last behaviour left it."""
        return self._world

    def further(self, code: str) -> str:
        """More code where the last behaviour ended; how it ended if not at its end."""
        return run_code(self._world, code, self._sandbox).error

    def must_fail(self, make: Callable[[], Task], wrong: Wrong) -> None:
        files = solution(*wrong.using) if wrong.using else ""
        before = f"{files}\n{wrong.before}" if wrong.before else ""
        outcome, error = self.outcome(make, f"{files}\n{wrong.code}", before, wrong.seed)
        assert wrong.error in error and bool(wrong.error) == bool(error), f"the code ended with: {error or 'nothing'}"
        assert not outcome.success, f"judged a success: {outcome.reason}"
        assert wrong.because in outcome.reason, f"failed for another reason: {outcome.reason}"

    def must_succeed(self, make: Callable[[], Task], seed: int = SEED) -> None:
        """The reference solution is a success, doing nothing is not."""
        world = self._at(make, seed, "")
        world.settle(world.task.settle)
        nothing = world.check()
        assert not nothing.success, f"doing nothing was judged a success: {nothing.reason}"
        outcome, error = self.outcome(make, world.task.reference_solution, seed=seed)
        assert outcome.success, error or outcome.reason

    def _at(self, make: Callable[[], Task], seed: int, before: str) -> SimulatedEnvironment:
        if self._key != (make, seed):
            self._leave()
            self._world = environment_of(self._experiment, make(), seed)
            self._world.open()
            self._key = (make, seed)
            self._checkpoints = {"": self._world.checkpoint()}
        if before not in self._checkpoints:
            self._world.restore(self._checkpoints[""])
            execution = run_code(self._world, before, self._sandbox)
            assert not execution.error, f"what comes before failed: {execution.error}"
            self._checkpoints[before] = self._world.checkpoint()
        else:
            self._world.restore(self._checkpoints[before])
        return self._world

    def _leave(self) -> None:
        if self._key is not None:
            self._key = None
            self._world.close()


def rehearsal_fixture() -> Any:
    """A module-scoped fixture: ``rehearsal = rehearsal_fixture()``."""

    @pytest.fixture(scope="module")
    def rehearsal() -> Iterator[Rehearsal]:
        with Rehearsal() as stage:
            yield stage

    return rehearsal


def judged(table: Mapping[Callable[[], Task], Sequence[Wrong]]) -> tuple[Callable[..., None], Callable[..., None]]:
    """The two tests of a table: its wrong behaviours fail; its tasks' reference solutions succeed, doing nothing does
    not. They ask for a fixture ``rehearsal``."""

    @pytest.mark.parametrize(("make", "wrong"), each(table))
    def wrong_ones(rehearsal: Rehearsal, make: Callable[[], Task], wrong: Wrong) -> None:
        rehearsal.must_fail(make, wrong)

    @pytest.mark.parametrize("make", table, ids=lambda make: make.name)
    def reference(rehearsal: Rehearsal, make: Callable[[], Task]) -> None:
        rehearsal.must_succeed(make)

    return wrong_ones, reference
