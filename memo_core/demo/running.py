"""The demo: teach the simulated arm once by language, and test whether the lesson transfers (``memo demo``).

Four runs on one seed, each judged by its task's success check: the taught task without any memory; the same with a
simulated teacher who sees it fail and says what was wrong; then another task, which was never corrected, without a
teacher, once with an empty book and once with this book, read-only. A suite may declare other runs (``Demo.runs``),
before which rules are told and noted; nobody watches these."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import attrs

from memo_core.config import Experiment
from memo_core.demo.page import write_demo_report
from memo_core.demo.result import CHAPTERS, Chapter, DemoReport, chapters_of
from memo_core.demo.telling import note_told
from memo_core.errors import InvalidArgument
from memo_core.events import Event
from memo_core.interfaces.task import Task
from memo_core.plugins.registry import Registry
from memo_core.runlog.whole_files import write_whole
from memo_core.runs.factories import book_of, environment_of, task_of
from memo_core.runs.folder import RunFolder, json_text, new_run_folder
from memo_core.runs.run import RunReport, components_of, perform
from memo_core.skillbook.book import Skillbook
from memo_core.teachers.simulated_teacher import SimulatedTeacher, SimulatedTeacherSettings

EMPTY = "sqlite://"  # a book in memory that nobody writes to


def run_demo(
    experiment: Experiment,
    registry: Registry,
    out: Path,
    listener: Callable[[Event], None] | None = None,
    chapter: Callable[[str], None] = lambda title: None,
    on_text: Callable[[str, str], None] | None = None,
) -> DemoReport:
    """Run the demo on the experiment's seed in a new folder under ``out``. ``listener`` receives every event,
    ``chapter`` the title of each run as it begins, ``on_text`` (phase, piece) while models write. Call it in the main
    thread. Raises ``MemoError`` if it cannot begin."""
    suite = experiment.choice("suite").backend
    if suite.demo is None:
        raise InvalidArgument("suite.backend", f"{suite.name!r} offers no demo", "a suite that declares one")
    demo, started = suite.demo, time.monotonic()
    for name in dict.fromkeys((demo.taught, demo.transfer, *(run.task for run in demo.runs))):
        environment_of(experiment, task_of(experiment, name), experiment.seed)  # refuses what no run could begin with
    folder = new_run_folder(out, "demo", experiment.seed)
    lesson = f"sqlite:///{folder / 'skillbook.db'}"
    llm, runs = experiment.create("llm"), dict[str, RunReport]()
    for number, part in enumerate(chapters_of(demo)):
        chapter(part.title)
        if demo.runs:
            name = demo.runs[number].task
            note_told(experiment, llm, lesson, demo.runs[number].told, listener or _ignore)
            book = book_of(experiment, lesson, read_only=True) if demo.runs[number].memory else None
            task, teacher = task_of(experiment, name), None
        else:
            name = demo.taught if part in CHAPTERS[:2] else demo.transfer
            task = task_of(experiment, name)
            book, teacher = _props(experiment, part, lesson, task)
        components = components_of(
            experiment,
            lambda task=task: environment_of(experiment, task, experiment.seed),  # type: ignore[misc]
            book,
            teacher,
            llm=llm,
        )
        config = experiment.public() | {"task": name, "demo.chapter": part.name}
        runs[part.name] = perform(
            components,
            task,
            experiment.seed,
            lambda part=part: RunFolder(folder / part.folder),  # type: ignore[misc]
            registry,
            config,
            listener,
            on_text=on_text,
        )
        if runs[part.name].ended_by_person:
            break
    return _told(DemoReport(experiment.seed, folder, demo, runs, time.monotonic() - started))


def _props(
    experiment: Experiment, part: Chapter, lesson: str, task: Task
) -> tuple[Skillbook | None, SimulatedTeacher | None]:
    """The book and the teacher of one run. The demo's simulated teacher never misjudges and knows the properties of the
    task's objects, since the demo is about the lesson."""
    if part.name == "empty_book":
        return None, None
    if part.name == "after_feedback":
        settings = SimulatedTeacherSettings(seed=experiment.seed, misjudges=0.0, knows=task.lesson)
        return book_of(experiment, lesson, read_only=False), SimulatedTeacher(settings)
    return book_of(experiment, EMPTY if part.name == "transfer_empty_book" else lesson, read_only=True), None


def _ignore(event: Event) -> None:
    """Ignore the event; nobody listens."""


def _told(report: DemoReport) -> DemoReport:
    report = attrs.evolve(report, page=write_demo_report(report))
    write_whole(report.folder / "summary.json", json_text(report.summary()))
    return report
