"""A simulated scene at the start of a template's subtask, in which programs are run and judged by the task's check of
that subtask (``Task.check_subtask``)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

import attrs

from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.environment.task_verification import run_code
from memo_core.errors import InvalidArgument, Stopped
from memo_core.interfaces.link import Link
from memo_core.maintenance.template_sources import CannotRetest, TemplateSource
from memo_core.runs.factories import environment_of, sandbox_of
from memo_core.sandbox.sandbox import Sandbox

Stopping = Callable[[Link], AbstractContextManager[None]]


class StartNotReached(CannotRetest):
    """The code of the earlier subtasks does not bring a new scene to the start of the subtask."""


@attrs.frozen
class ProgramOutcome:
    """The end of one program from one start."""

    success: bool  # by the task's check of the subtask
    reason: str  # why it failed; empty for a success
    robot_s: float  # s on the robot's clock, up to the end of its last skill call
    printed: str
    finished: bool = True  # ran to its end; otherwise it raised an error or reached a limit, which is the reason


def no_signals(link: Link) -> AbstractContextManager[None]:
    """Leave signals as they are."""
    return nullcontext()


class SubtaskScene:
    """An open scene of the task that a template was approved for."""

    def __init__(self, world: SimulatedEnvironment, sandbox: Sandbox, source: TemplateSource, seed: int | None) -> None:
        """Keep the open parts; nothing moves. ``seed``: of a new scene; None: the scene of the source's run."""
        self._world = world
        self._sandbox = sandbox
        self._source = source
        self._seed = seed

    def reach_start(self) -> None:
        """Bring the scene to the start of the subtask: the stored one, or in a new scene by the code of the earlier
        subtasks.

        Raises:
            CannotRetest: if the start cannot be restored; ``StartNotReached`` if an earlier subtask does not succeed.
            Stopped: if the stop is pressed.
            MemoError: if the robot, the simulator, a backend or the task's own code fails.
        """
        if self._seed is None:
            self.restore(self._source.start)
        else:
            self._lead()

    def checkpoint(self) -> bytes:
        """The present state, to be restored in a scene of the same task and seed."""
        return self._world.checkpoint()

    def restore(self, checkpoint: bytes) -> None:
        """Restore a state exactly. Raises ``CannotRetest`` if the task's scene is no longer the one it was stored
        of."""
        try:
            self._world.restore(checkpoint)
        except InvalidArgument as problem:
            raise CannotRetest(f"its start cannot be restored: {problem}") from None

    def judged(
        self, code: str, robot_seconds: float | None = None, wall_seconds: float | None = None
    ) -> ProgramOutcome:
        """Run a program for the subtask and judge it.

        Args:
            code: the program.
            robot_seconds: limit on the robot's clock (s), where it is shorter than the sandbox's.
            wall_seconds: limit on the wall clock (s), where it is shorter than the sandbox's.

        Returns:
            The outcome; a program that is refused, raises or reaches a limit has failed.

        Raises:
            CannotRetest: if the program ran to its end and the task has no check of the subtask.
            Stopped: if the stop is pressed.
            MemoError: if the robot, the simulator, a backend or the task's own code fails.
        """
        return self._judged(self._source.subtask, code, robot_seconds, wall_seconds)

    def _lead(self) -> None:
        for subtask, code in self._source.earlier:
            try:
                outcome = self._judged(subtask, code)
            except CannotRetest as problem:
                raise StartNotReached(f"its start was not reached: {problem}") from None
            if not outcome.success:
                raise StartNotReached(
                    f"its start was not reached: {subtask}, which comes before it, failed ({outcome.reason})"
                )

    def _judged(
        self, subtask: str, code: str, robot_seconds: float | None = None, wall_seconds: float | None = None
    ) -> ProgramOutcome:
        self._world.look()
        began = self._world.time()
        execution = run_code(self._world, code, self._sandbox, robot_seconds=robot_seconds, wall_seconds=wall_seconds)
        if execution.ended == "stopped":
            raise Stopped("retesting")
        robot_s = execution.calls[-1].sim_time - began if execution.calls else 0.0
        if not execution.succeeded:
            return ProgramOutcome(False, execution.error or execution.ended, robot_s, execution.printed, finished=False)
        verdict = self._world.check_subtask(subtask)
        if verdict is None:
            raise CannotRetest(f"the task {self._world.task.name} has no check of {subtask}")
        return ProgramOutcome(verdict.success, "" if verdict.success else verdict.reason, robot_s, execution.printed)


@contextmanager
def subtask_scene(source: TemplateSource, seed: int | None, stopping: Stopping = no_signals) -> Iterator[SubtaskScene]:
    """Open the scene of a template's source for ``with``; nothing moves.

    Args:
        source: where the template comes from.
        seed: seed of the scene; None: that of the source's run.
        stopping: context manager that is entered around everything that moves a robot, to handle signals.

    Yields:
        The scene as the task begins; it is closed afterwards.
    """
    world = environment_of(source.experiment, source.task, source.seed if seed is None else seed)
    with world, sandbox_of(source.experiment) as sandbox, stopping(world.link):
        yield SubtaskScene(world, sandbox, source, seed)
