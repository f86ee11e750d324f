"""The demo: teach the simulated arm once by language, and watch whether the lesson carries over (``memo demo``).

Four runs on one seed, each judged by its task's success check: the taught task without any memory; the same with a
simulated participant who sees it fail and says what was wrong; then another task, which nobody ever corrected and
where nobody watches, once with an empty book and once with this book, read-only.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument
from memo_core.events import Event
from memo_core.experiment.assembly import book_of, library_of, prompts_of, sandbox_of, task_of, world_of
from memo_core.experiment.folder import RunFolder, json_text, new_run_folder, write_whole
from memo_core.experiment.participant import ParticipantSettings, SimulatedParticipant
from memo_core.experiment.run import Cast, RunReport, perform
from memo_core.interfaces.backend import Demo
from memo_core.interfaces.task import Task
from memo_core.plugins import Registry
from memo_core.skillbook.book import Skillbook

EMPTY = "sqlite://"  # a book in memory that nobody writes to


@attrs.frozen
class Chapter:
    """One of the four runs."""

    name: str  # as in the JSON: empty_book, after_feedback, transfer_empty_book, transfer
    folder: str
    title: str
    expected: bool  # the success that the story needs


CHAPTERS = (
    Chapter("empty_book", "1-no-memory", "Without any memory", False),
    Chapter("after_feedback", "2-taught", "With somebody who says what was wrong", True),
    Chapter("transfer_empty_book", "3-transfer-empty-book", "Another task, with an empty book", False),
    Chapter("transfer", "4-transfer", "The same, with the book of the lesson", True),
)


@attrs.frozen(eq=False)
class DemoReport:
    """What happened, whatever happened."""

    seed: int
    folder: Path
    demo: Demo
    runs: dict[str, RunReport]
    wall_s: float
    page: Path | None = None

    @property
    def told(self) -> bool:
        """Whether it was the expected story: fails, is taught, succeeds, carries over."""
        return not self.interrupted and all(self.runs[c.name].success == c.expected for c in CHAPTERS)

    @property
    def interrupted(self) -> bool:
        return len(self.runs) < len(CHAPTERS) or any(run.ended_by_person for run in self.runs.values())

    def why(self) -> dict[str, str]:
        """A sentence for each run: what the success check said, and how the run ended."""
        return {name: run.why for name, run in self.runs.items()}

    @property
    def unjudged(self) -> tuple[str, ...]:
        """The runs whose success check was never asked: something kept them from taking place."""
        return tuple(name for name, run in self.runs.items() if run.outcome is None)

    def summary(self) -> dict[str, Any]:
        outcomes: dict[str, Any] = {
            c.name: self.runs[c.name].success if c.name in self.runs else None for c in CHAPTERS
        }
        return outcomes | {
            "wall_s": round(self.wall_s, 2),
            "seed": self.seed,
            "told": self.told,
            "interrupted": self.interrupted,
            "taught_task": self.demo.taught,
            "transfer_task": self.demo.transfer,
            "reasons": self.why(),
            "run_folder": str(self.folder),
            "report": None if self.page is None else str(self.page),
        }


def run_demo(
    experiment: Experiment,
    registry: Registry,
    out: Path,
    listener: Callable[[Event], None] | None = None,
    chapter: Callable[[str], None] = lambda title: None,
    on_text: Callable[[str, str], None] | None = None,
) -> DemoReport:
    """Run the story on the experiment's seed in a new folder under ``out``. ``listener`` hears every event, ``chapter``
    the title of each run as it begins, ``on_text`` (phase, piece) while models write. Call it in the main thread.
    Raises ``MemoError`` for what keeps it from beginning."""
    suite = experiment.choice("suite").backend
    if suite.demo is None:
        raise InvalidArgument("suite.backend", f"{suite.name!r} offers no demo", "a suite that declares one")
    demo, started = suite.demo, time.monotonic()
    task_of(experiment, demo.taught), task_of(experiment, demo.transfer)
    folder = new_run_folder(out, "demo", experiment.seed)
    lesson = f"sqlite:///{folder / 'skillbook.db'}"
    llm, runs = experiment.create("llm"), dict[str, RunReport]()
    for part in CHAPTERS:
        chapter(part.title)
        name = demo.taught if part in CHAPTERS[:2] else demo.transfer
        task = task_of(experiment, name)
        book, teacher = _props(experiment, part, lesson, task)
        cast = Cast(
            method=experiment.create("method"),
            llm=llm,
            make_world=lambda task=task: world_of(experiment, task, experiment.seed),  # type: ignore[misc]
            sandbox=sandbox_of(experiment),
            skills=library_of(experiment),
            settings=experiment.section("run"),
            book=book,
            teacher=teacher,
            prompts=prompts_of(experiment),
        )
        config = experiment.public() | {"task": name, "demo.chapter": part.name}
        runs[part.name] = perform(
            cast, task, experiment.seed, RunFolder(folder / part.folder), registry, config, listener, on_text=on_text
        )
        if runs[part.name].ended_by_person:
            break
    return _told(DemoReport(experiment.seed, folder, demo, runs, time.monotonic() - started))


def _props(
    experiment: Experiment, part: Chapter, lesson: str, task: Task
) -> tuple[Skillbook | None, SimulatedParticipant | None]:
    """The book and the person of one chapter. The demo's participant never misjudges, and knows what is to be known of
    the task's things: what it shows is the lesson."""
    if part.name == "empty_book":
        return None, None
    if part.name == "after_feedback":
        settings = ParticipantSettings(seed=experiment.seed, misjudges=0.0, knows=task.lesson)
        return book_of(experiment, lesson, read_only=False), SimulatedParticipant(settings)
    return book_of(experiment, EMPTY if part.name == "transfer_empty_book" else lesson, read_only=True), None


def _told(report: DemoReport) -> DemoReport:
    from memo_core.experiment.report import write_demo_report

    report = attrs.evolve(report, page=write_demo_report(report))
    write_whole(report.folder / "summary.json", json_text(report.summary()))
    return report
