"""Comparing a program with the template whose work it is to do, such as a call of a function learnt from several
templates: both run from the same starts, and the program is accepted when it does not do worse."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from itertools import islice

import attrs

from memo_core.errors import Stopped
from memo_core.maintenance.subtask_scene import (
    ProgramOutcome,
    StartNotReached,
    Stopping,
    SubtaskScene,
    no_signals,
    subtask_scene,
)
from memo_core.maintenance.template_sources import CannotRetest, TemplateSource, TemplateSources, program_of
from memo_core.plugins.registry import Registry
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import Entry

FRESH_SEEDS = range(1001, 2001)  # of new scenes
MOST_TIMES_SLOWER, SLOWER_MARGIN_S = 1.5, 10.0  # robot time of an accepted program, against the template's
LIMIT_TIMES, LIMIT_MARGIN_S = 3.0, 30.0  # time after which a program is ended, against the template's


@attrs.frozen
class PairedTrial:
    """The template and the program from the same start."""

    start: str  # as the book names it
    before: ProgramOutcome  # of the template
    after: ProgramOutcome  # of the program


@attrs.frozen
class Verdict:
    """Whether a program may stand in for a template."""

    accepted: bool
    reason: str = ""  # why not, as one sentence
    trials: tuple[PairedTrial, ...] = ()
    untestable: str = ""  # why nothing could be run or judged; nothing is then known against the program

    @property
    def starts(self) -> tuple[tuple[str, bool, str], ...]:
        """Each start, whether the program succeeded from it, and if not, why."""
        return tuple((one.start, one.after.success, one.after.reason) for one in self.trials)


@attrs.frozen
class _OwnRun:
    """A run of the template itself, and the state it began in."""

    start: bytes
    outcome: ProgramOutcome
    wall_s: float


class PairedTrials:
    """Compares programs with the templates of one book, and remembers the templates' own runs."""

    def __init__(
        self,
        book: Skillbook,
        registry: Registry,
        stopping: Stopping = no_signals,
        scenes: int = 2,
        seeds: Sequence[int] = FRESH_SEEDS,
    ) -> None:
        """Prepare comparisons; nothing is opened.

        Args:
            book: the book of the templates; nothing is written to it.
            registry: the plugins with the backends of the templates' runs.
            stopping: context manager that is entered around everything that moves a robot, to handle signals.
            scenes: number of new scenes beside the stored start.
            seeds: seeds of the new scenes; the first ones that differ from the seed of the template's run are used.
        """
        self._stopping = stopping
        self._scenes = scenes
        self._seeds = seeds
        self._sources = TemplateSources(book, registry)
        self._own: dict[tuple[int, int | None], _OwnRun | None] = {}  # by template and seed; None: start not reached

    def compare(self, template: Entry, program: str, progress: Callable[[str], None] = lambda start: None) -> Verdict:
        """Run a template and a program from the stored start of the template's subtask and in new scenes of its task.

        A new scene in which the start is not reached is left out. From each start, a program is ended after
        ``LIMIT_TIMES`` the template's own time and ``LIMIT_MARGIN_S``, both on the robot's and the wall clock.

        Args:
            template: the template, active or replaced.
            program: robot code, such as ``functions.as_program`` returns.
            progress: called with the name of each start before anything is run from it.

        Returns:
            The verdict, with an outcome of both from every start.

        Raises:
            KeyboardInterrupt: for a stop.
            MemoError: if the robot, the simulator, a backend or the task's own code fails, which is no verdict.
        """
        try:
            trials = tuple(self._trials(template, program, progress))
        except Stopped:
            raise KeyboardInterrupt from None
        except CannotRetest as problem:
            return Verdict(False, str(problem), untestable=str(problem))
        reason = shortfall(trials)
        return Verdict(not reason, reason, trials)

    def _trials(self, template: Entry, program: str, progress: Callable[[str], None]) -> Iterator[PairedTrial]:
        source = self._sources.of(template)
        own_program = _own_program(template, source)  # raises before anything is opened
        fresh = islice((seed for seed in self._seeds if seed != source.seed), self._scenes)
        for seed in (None, *fresh):
            progress(source.start_name(seed))
            if (trial := self._trial(template, source, seed, own_program, program)) is not None:
                yield trial

    def _trial(
        self, template: Entry, source: TemplateSource, seed: int | None, own_program: str, program: str
    ) -> PairedTrial | None:
        """One paired trial; None if its start is not reached."""
        at = (template.id, seed)
        if at in self._own and self._own[at] is None:
            return None
        with subtask_scene(source, seed, self._stopping) as scene:
            own = self._own.get(at) or _own_run(scene, own_program)
            self._own[at] = own
            if own is None:
                return None
            scene.restore(own.start)
            outcome = scene.judged(
                program,
                robot_seconds=LIMIT_TIMES * own.outcome.robot_s + LIMIT_MARGIN_S,
                wall_seconds=LIMIT_TIMES * own.wall_s + LIMIT_MARGIN_S,
            )
            return PairedTrial(source.start_name(seed), own.outcome, outcome)


def _own_program(template: Entry, source: TemplateSource) -> str:
    """The program that a template is compared by: a call of its function, or if that needs arguments which nobody can
    know, the program that was approved. Raises ``CannotRetest`` if there is neither."""
    try:
        return program_of(template)
    except CannotRetest:
        if not source.code.strip():
            raise
        return source.code


def _own_run(scene: SubtaskScene, program: str) -> _OwnRun | None:
    """Run the template's own program in a scene just opened. None if the start is not reached."""
    try:
        scene.reach_start()
    except StartNotReached:
        return None
    start, began = scene.checkpoint(), time.monotonic()
    outcome = scene.judged(program)
    return _OwnRun(start, outcome, time.monotonic() - began)


def shortfall(trials: Sequence[PairedTrial]) -> str:
    """Why a program does worse than the template, as one sentence; "" if it does not.

    It must succeed as often as the template, at least once where the template does, and where both succeed in at most
    ``MOST_TIMES_SLOWER`` the template's time and ``SLOWER_MARGIN_S``. If the template never succeeds, its check may be
    wrong; the program must then run to its end wherever the template does, and at least once.
    """
    before = sum(trial.before.success for trial in trials)
    after = sum(trial.after.success for trial in trials)
    lost = [trial for trial in trials if trial.before.success and not trial.after.success]
    if after < before:
        return f"it succeeded from {after} of {len(trials)} starts and the template from {before}: {_failed(lost[0])}"
    if before and len(lost) == before:
        return f"from no start did both succeed: {_failed(lost[0])}"
    if not before and (ended := _ended_early(trials)):
        return f"from {ended.start} it did not run to its end ({ended.after.reason})"
    for trial in trials:
        if trial.before.success and trial.after.success and _slow(trial):
            return (
                f"from {trial.start} it took {trial.after.robot_s:.0f} s on the robot's clock, "
                f"where the template took {trial.before.robot_s:.0f} s"
            )
    return ""


def _failed(trial: PairedTrial) -> str:
    return f"from {trial.start} it failed ({trial.after.reason})"


def _ended_early(trials: Sequence[PairedTrial]) -> PairedTrial | None:
    """The first start from which only the program did not run to its end; any if it did from none."""
    early = [trial for trial in trials if not trial.after.finished]
    worse = [trial for trial in early if trial.before.finished]
    return next(iter(worse or (early if len(early) == len(trials) else [])), None)


def _slow(trial: PairedTrial) -> bool:
    return trial.after.robot_s > MOST_TIMES_SLOWER * trial.before.robot_s + SLOWER_MARGIN_S
