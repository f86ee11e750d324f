"""Lessons that cross over (``memo bench transfer``): taught in one simulator, used in another.

Per seed and simulator, a simulated participant teaches the robot some tasks; the book that comes of it is then used on
tasks that nobody ever corrected, read-only and with nobody watching, in the simulator where it was taught and in every
other, beside an empty book. Everything that ended is in ``trials.jsonl``, a line each; called again on the same folder,
only the rest is done.
"""

from __future__ import annotations

import json
import sqlite3
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import attrs

from memo_benchmarks.demo_sweep import FirstVerdict
from memo_core.config import Experiment
from memo_core.demo.running import EMPTY
from memo_core.errors import InvalidArgument
from memo_core.interfaces.task import Outcome
from memo_core.interfaces.teacher import Teacher
from memo_core.plugins.registry import Registry
from memo_core.runlog.json_lines import append_line, read_lines
from memo_core.runs.code_digest import code_digest
from memo_core.runs.factories import book_of, environment_of, task_of, tasks_of
from memo_core.runs.folder import RunFolder, new_run_folder
from memo_core.runs.run import RunReport, components_of, perform
from memo_core.skillbook.book import Skillbook
from memo_core.teachers.simulated_teacher import SimulatedTeacher, SimulatedTeacherSettings

NOBODY = ""  # taught the empty book


@attrs.frozen
class Trial:
    """One run that ended. ``taught_in``: the simulator whose book it had, ``NOBODY`` for an empty one; of a lesson (a
    run in which the participant taught) the simulator itself. ``first``: the verdict on the first subtask as that
    ended, None where it cannot tell."""

    seed: int
    task: str
    simulator: str
    taught_in: str
    lesson: bool
    success: bool
    why: str
    corrections: int
    wall_s: float
    folder: str  # within that of the whole
    first: bool | None = None

    @property
    def key(self) -> tuple[int, str, str, str, bool]:
        return (self.seed, self.task, self.simulator, self.taught_in, self.lesson)


@attrs.frozen
class Row:
    """One task in one simulator, over the seeds: how many runs succeeded with an empty book, with the book taught
    there, and with those taught in other simulators."""

    task: str
    simulator: str
    seeds: int
    empty: int
    taught_here: int
    taught_elsewhere: dict[str, int]


class Transfer:
    """All the lessons and trials of one table. ``experiments``: one a simulator, alike but for that.

    Raises ``InvalidArgument`` for fewer than two simulators, for a folder that holds trials of another experiment, and
    for tasks that are taught and tried at once; ``UnknownName`` for tasks that do not exist.
    """

    def __init__(
        self,
        experiments: Mapping[str, Experiment],
        registry: Registry,
        folder: Path,
        seeds: Sequence[int],
        taught: Sequence[str] = (),
        tried: Sequence[str] = (),
    ) -> None:
        if len(experiments) < 2:
            raise InvalidArgument("--simulator", f"only {', '.join(experiments)}", "two or more that are installed")
        self.experiments, self._registry, self.folder, self.seeds = dict(experiments), registry, folder, tuple(seeds)
        first = next(iter(self.experiments.values()))
        demo = first.choice("suite").backend.demo
        if taught:
            self.taught = tuple(dict.fromkeys(taught))
        elif demo is not None:
            self.taught = (demo.taught,)
        else:
            raise InvalidArgument("--teach", "the suite offers no demo whose lesson could be taught", "a task's name")
        held_out = tuple(task.name for task in tasks_of(first) if task.split == "held-out")
        self.tried = tuple(dict.fromkeys(tried)) or held_out
        for name in (*self.taught, *self.tried):
            task_of(first, name)
        if set(self.taught) & set(self.tried):
            both = ", ".join(sorted(set(self.taught) & set(self.tried)))
            raise InvalidArgument("--task", f"{both} is taught, too", "tasks that nobody ever corrected")
        self._log = _Log(folder / "trials.jsonl", _mark(self.experiments, self.taught))

    @property
    def size(self) -> int:
        """How many runs it takes altogether."""
        places = len(self.experiments)
        return len(self.seeds) * places * (len(self.taught) + len(self.tried) * (places + 1))

    def trials(self) -> Iterator[Trial]:
        """Every lesson and trial, those in the folder first; ends early when a person ends a run. A run that something
        else broke off (a language model that did not answer) is left out, and done when it is asked for again."""
        yield from self.done()
        for key in self._wanted():
            if key in self._log.done:
                continue
            seed, task, simulator, taught_in, lesson = key
            before = [self._log.done.get((seed, name, taught_in, taught_in, True)) for name in self.taught]
            if lesson:
                before = before[: self.taught.index(task)]
            if taught_in != NOBODY and None in before:
                continue  # its lesson was broken off
            started = time.monotonic()
            report, first = self._perform(seed, task, simulator, taught_in, lesson)
            if report.ended_by_person:
                return
            if report.outcome is None and report.resumable:
                continue
            trial = Trial(
                seed,
                task,
                simulator,
                taught_in,
                lesson,
                report.success,
                report.why,
                sum(subtask.attempts - 1 for subtask in report.result.subtasks) if lesson else 0,
                round(time.monotonic() - started, 2),
                str(report.folder.relative_to(self.folder)),
                None if first is None else first.success,
            )
            self._log.add(trial)
            yield trial

    def table(self) -> list[Row]:
        """What is known so far, over the seeds of which everything of that row is."""
        rows = []
        for task in self.tried:
            for simulator in self.experiments:
                books = (NOBODY, *self.experiments)
                counted = [
                    found
                    for seed in self.seeds
                    if None not in (found := [self._log.done.get((seed, task, simulator, b, False)) for b in books])
                ]
                done = {
                    book: sum(one.success for found in counted if (one := found[n]) is not None)
                    for n, book in enumerate(books)
                }
                elsewhere = {name: done[name] for name in self.experiments if name != simulator}
                rows.append(Row(task, simulator, len(counted), done[NOBODY], done[simulator], elsewhere))
        return rows

    def done(self) -> list[Trial]:
        """All lessons and trials so far."""
        return [trial for key in self._wanted() if (trial := self._log.done.get(key)) is not None]

    def lessons(self) -> list[Trial]:
        """The lessons so far."""
        return [trial for trial in self.done() if trial.lesson]

    def _wanted(self) -> Iterator[tuple[int, str, str, str, bool]]:
        for seed in self.seeds:
            for name in self.experiments:
                yield from ((seed, task, name, name, True) for task in self.taught)
            for task in self.tried:
                for name in self.experiments:
                    yield from ((seed, task, name, book, False) for book in (NOBODY, *self.experiments))

    def _perform(
        self, seed: int, name: str, simulator: str, taught_in: str, lesson: bool
    ) -> tuple[RunReport, Outcome | None]:
        experiment = attrs.evolve(self.experiments[simulator], seed=seed)
        task = task_of(experiment, name)
        teacher: Teacher | None = None
        if lesson:
            # As in the demo: it never misjudges, and knows what is to be known of the task's things.
            teacher = SimulatedTeacher(SimulatedTeacherSettings(seed=seed, misjudges=0.0, knows=task.lesson))
        what = "lesson" if lesson else f"with-{taught_in or 'empty'}-book"
        verdict = FirstVerdict()

        def folder() -> RunFolder:
            return RunFolder(new_run_folder(self.folder, f"{name}-in-{simulator}-{what}", seed))

        components = components_of(
            experiment,
            lambda: verdict.world_made(environment_of(experiment, task, seed)),
            self._book(experiment, name, taught_in, lesson),
            teacher,
        )
        config = experiment.public() | {"task": name, "bench": "transfer"}
        return perform(components, task, seed, folder, self._registry, config, verdict.heard), verdict.first

    def _book(self, experiment: Experiment, task: str, taught_in: str, lesson: bool) -> Skillbook:
        if taught_in == NOBODY:
            return book_of(experiment, EMPTY, read_only=True)
        if not lesson:
            return book_of(experiment, f"sqlite:///{self._file(experiment.seed, taught_in, self.taught[-1])}", True)
        # A lesson that is broken off leaves the book of the lessons before it as it was.
        number = self.taught.index(task)
        file = self._file(experiment.seed, taught_in, task)
        _remove(file)
        if number:
            _copy(self._file(experiment.seed, taught_in, self.taught[number - 1]), file)
        return book_of(experiment, f"sqlite:///{file}", read_only=False)

    def _file(self, seed: int, simulator: str, task: str) -> Path:
        """The book of a simulator's lessons up to this one."""
        return self.folder / f"taught-in-{simulator}-{seed}-{task}.db"


class _Log:
    """Trials in a file, one JSON line each, the first line what they are of."""

    def __init__(self, file: Path, mark: dict[str, Any]) -> None:
        self._file = file
        self.done: dict[tuple[int, str, str, str, bool], Trial] = {}
        try:
            lines = list(read_lines(file)) if file.exists() else []
            if lines:
                self._read(lines, mark)
            else:
                append_line(file, mark)
        except OSError as error:
            raise InvalidArgument("--out", f"{file} cannot be used ({error})", "a folder to write to") from None

    def _read(self, lines: list[tuple[int, Any]], mark: dict[str, Any]) -> None:
        (_, found), *rest = lines
        if isinstance(found, dict) and "code" not in found:  # written before it was kept
            mark = {key: value for key, value in mark.items() if key != "code"}
        if found != mark:
            differs = [key for key in mark if not isinstance(found, dict) or found.get(key) != mark[key]]
            problem = f"{self._file} is of another experiment (it differs in {', '.join(differs)})"
            raise InvalidArgument("--out", problem, "the same settings and code, or a new folder")
        for number, line in rest:
            try:
                trial = Trial(**line)
            except TypeError:
                expected = "a file that this command wrote, or a new folder"
                raise InvalidArgument("--out", f"line {number} of {self._file} is no trial", expected) from None
            self.done[trial.key] = trial

    def add(self, trial: Trial) -> None:
        append_line(self._file, attrs.asdict(trial))
        self.done[trial.key] = trial


def _mark(experiments: Mapping[str, Experiment], taught: Sequence[str]) -> dict[str, Any]:
    """What trials depend on: the settings, and the files of MEMO and the plugins."""
    varies = ("task", "seed", "skillbook.url", "skillbook.read_only")
    settings: dict[str, Any] = {"simulators": sorted(experiments), "taught": list(taught)}
    for name, experiment in sorted(experiments.items()):
        settings[name] = {key: value for key, value in experiment.public().items() if key not in varies}
    settings["code"] = {name: code_digest(experiment) for name, experiment in sorted(experiments.items())}
    return json.loads(json.dumps(settings, default=str))


def _remove(file: Path) -> None:
    for each in file.parent.glob(file.name + "*"):  # SQLite keeps files beside it
        each.unlink()


def _copy(file: Path, to: Path) -> None:
    with closing(sqlite3.connect(file)) as source, closing(sqlite3.connect(to)) as target:
        source.backup(target)
