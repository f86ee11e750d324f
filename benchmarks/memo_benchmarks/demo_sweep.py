"""The demo on many seeds, and its lesson under lesions (``memo bench demo``, ``memo bench lesions``)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import attrs

from memo_core.config import Experiment
from memo_core.demo.result import DemoReport
from memo_core.demo.running import EMPTY, run_demo
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.errors import InvalidArgument, Stopped, UnknownName
from memo_core.evaluation.lesions import LESIONS, OF_FUNCTIONS, VariedTask, handle_moved, lesioned_copy, mirrored
from memo_core.events import Event, SubtaskEnded
from memo_core.interfaces.llm import LanguageModel
from memo_core.interfaces.task import Outcome, Task
from memo_core.interfaces.teacher import Teacher
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import book_of, environment_of, task_of
from memo_core.runs.folder import RunFolder, new_run_folder
from memo_core.runs.run import RunReport, components_of, perform
from memo_core.skillbook.book import Skillbook
from memo_core.teachers.simulated_teacher import SimulatedTeacher, SimulatedTeacherSettings

SCENES = {
    "mirrored": mirrored,
    "handle-3cm-lower": handle_moved((0.0, 0.0, -0.03)),
    "handle-6cm-lower": handle_moved((0.0, 0.0, -0.06)),
}
CONTROLS = ("empty-book",)
KNOWN = (*CONTROLS, *LESIONS, *SCENES)
FOR_ONE_KEY = tuple(name for name in KNOWN if name not in OF_FUNCTIONS)  # the demo's book has no function


def known_lesion(name: str) -> str:
    """Returns the name. Raises ``UnknownName`` if there is no such lesion."""
    if name not in KNOWN:
        raise UnknownName("lesion", name, KNOWN)
    return name


def demos(experiment: Experiment, registry: Registry, out: Path, seeds: Sequence[int]) -> Iterator[DemoReport]:
    """The demo on each seed, one after another, until somebody ends one."""
    for seed in seeds:
        report = run_demo(attrs.evolve(experiment, seed=seed), registry, out)
        yield report
        if report.interrupted:
            return


@attrs.frozen
class Lesioned:
    """One task done with one book. ``first`` is the task's verdict on its first subtask as that ended, None where the
    task cannot tell; ``why`` quotes the success check and how the run ended."""

    seed: int
    task: str
    lesion: str
    success: bool
    first: bool | None
    first_why: str
    why: str
    wall_s: float


class Lesson:
    """One seed's lesson, taught once through the complete loop, and then applied under lesions.

    Use ``teach`` first. Every book and run folder is made under ``out``. Raises ``Stopped`` when a person ends a run.
    """

    def __init__(self, experiment: Experiment, registry: Registry, out: Path, seed: int) -> None:
        suite = experiment.choice("suite").backend
        if suite.demo is None:
            raise InvalidArgument("suite.backend", f"{suite.name!r} offers no demo", "a suite that declares one")
        self.demo = suite.demo
        self.seed = seed
        self.experiment = attrs.evolve(experiment, seed=seed)
        self._registry = registry
        self.folder = new_run_folder(out, "lesions", seed)
        self.url = self._book_url("taught")
        self._llm = experiment.create("llm")

    def teach(self) -> RunReport:
        """The demo's first task with a simulated teacher who never misjudges; fills the book."""
        task = task_of(self.experiment, self.demo.taught)
        participant = SimulatedTeacher(SimulatedTeacherSettings(seed=self.seed, misjudges=0.0))
        book = book_of(self.experiment, self.url, read_only=False)
        return self._perform(task, book, participant, "taught")[0]

    def under(self, lesion: str, task: str | None = None) -> Lesioned:
        """The demo's transfer task (or ``task``) under a lesion of the book or of the scene. Raises ``UnknownName``."""
        known_lesion(lesion)
        started = time.monotonic()
        name = task or self.demo.transfer
        chosen = task_of(self.experiment, name)
        if lesion in SCENES:
            chosen = VariedTask(chosen, SCENES[lesion], lesion)
        report, first = self._perform(chosen, self._book(lesion), None, f"{name}-{lesion}")
        return Lesioned(
            seed=self.seed,
            task=name,
            lesion=lesion,
            success=report.success,
            first=None if first is None else first.success,
            first_why="" if first is None else first.reason,
            why=report.why,
            wall_s=round(time.monotonic() - started, 2),
        )

    def _book(self, lesion: str) -> Skillbook:
        if lesion in CONTROLS:
            return book_of(self.experiment, EMPTY, read_only=True)
        if lesion not in LESIONS:
            return book_of(self.experiment, self.url, read_only=True)
        url = self._book_url(lesion)
        if not (self.folder / f"{lesion}.db").exists():
            with (
                book_of(self.experiment, self.url, read_only=True) as taught,
                book_of(self.experiment, url, read_only=False) as copy,
            ):
                lesioned_copy(taught, copy, lesion, self.seed)
        return book_of(self.experiment, url, read_only=True)

    def _book_url(self, name: str) -> str:
        return f"sqlite:///{self.folder / name}.db"

    def _perform(
        self, task: Task, book: Skillbook, teacher: Teacher | None, folder: str
    ) -> tuple[RunReport, Outcome | None]:
        """Run as ``perform_judged`` does. Raises ``Stopped`` where a person ended the run."""
        run_folder = partial(new_run_folder, self.folder, folder, self.seed)
        report, first = perform_judged(self.experiment, self._registry, task, book, teacher, run_folder, self._llm)
        if report.ended_by_person:
            raise Stopped(f"the run of {task.name}")
        return report, first


@attrs.define
class FirstVerdict:
    """Asks the task about the first subtask at the moment it ends, because later subtasks may undo it."""

    world: SimulatedEnvironment | None = None
    first: Outcome | None = None
    asked: bool = False

    def world_made(self, world: SimulatedEnvironment) -> SimulatedEnvironment:
        self.world = world
        return world

    def heard(self, event: Event) -> None:
        if isinstance(event, SubtaskEnded) and not self.asked and self.world is not None:
            self.asked = True
            self.first = self.world.check_subtask(event.subtask)


def perform_judged(
    experiment: Experiment,
    registry: Registry,
    task: Task,
    book: Skillbook,
    teacher: Teacher | None,
    folder: Callable[[], Path],
    llm: LanguageModel,
) -> tuple[RunReport, Outcome | None]:
    """A run with the experiment's seed, and the task's own verdict on the first subtask when that had ended."""
    watch = FirstVerdict()
    components = components_of(
        experiment,
        lambda: watch.world_made(environment_of(experiment, task, experiment.seed)),
        book,
        teacher,
        llm=llm,
    )
    config = experiment.public() | {"task": task.name}
    report = perform(components, task, experiment.seed, lambda: RunFolder(folder()), registry, config, watch.heard)
    return report, watch.first
