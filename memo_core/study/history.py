"""One teaching history: participants come one after the other and teach into one book, until the protocol is done.

Everything that was done is in the journal and in the folders of the runs, so a history that was killed at any moment
goes on with the run that was cut off."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument, Stopped
from memo_core.events import SessionEnded, SessionTask, TimeLeft
from memo_core.interfaces.reception import Reception
from memo_core.interfaces.task import Task
from memo_core.interfaces.teacher import Teacher
from memo_core.plugins.registry import Registry
from memo_core.policy.loop import TIME_IS_UP
from memo_core.runs.consolidation import after_run
from memo_core.runs.factories import book_of, environment_of, task_of, tasks_of
from memo_core.runs.idempotent_run import calls_that_count, do_one, public, wall_seconds
from memo_core.runs.run import components_of
from memo_core.skillbook import raw_log
from memo_core.study.clock import active_seconds, time_left
from memo_core.study.consent import Consent, demographics_of
from memo_core.study.journal import Journal, TaughtRun, read_journal
from memo_core.study.participants import Load, teacher_of
from memo_core.study.people import People
from memo_core.study.settings import Participant, StudySettings
from memo_core.text.counting import counted

BOOK = "skillbook.db"
SEEDS_A_HISTORY = 10_000  # scenes of one history are no other's


@attrs.frozen(eq=False)
class TeachingHistory:
    """One history of a study: ``order`` is who comes when."""

    number: int
    folder: Path
    order: tuple[Participant, ...]


@attrs.frozen(eq=False)
class Teaching:
    """Parts that all histories of a study share. ``reception`` meets people whose teacher has none of its own;
    ``report`` hears a line a run; ``sessions`` is how many may begin now, None: any number."""

    load: Load
    registry: Registry
    consent: Consent
    people: People
    reception: Reception | None = None
    report: Callable[[str], None] = lambda line: None
    sessions: int | None = None
    begun: Callable[[], None] = lambda: None  # called by each run, see ``RunComponents``
    view: bool = False  # whether each run opens the simulator's window


def training_tasks(experiment: Experiment, settings: StudySettings) -> tuple[str, ...]:
    """What is taught, in order. Raises ``UnknownName``, ``InvalidArgument``."""
    if settings.tasks:
        return tuple(task_of(experiment, name).name for name in settings.tasks)
    names = tuple(task.name for task in tasks_of(experiment) if task.split == "training")
    if not names:
        raise InvalidArgument("study.tasks", "the suite has no training tasks", "names of tasks")
    return names


def teach(history: TeachingHistory, teaching: Teaching) -> Journal:
    """Go on with a history until its protocol is done, or until as many sessions as may begin now have ended. Raises
    ``Stopped`` when a person ends it, and ``MemoError``."""
    experiment = teaching.load()
    settings: StudySettings = experiment.section("study")
    journal = read_journal(history.folder)
    if not journal.book:
        journal.note({"history": history.number, "book": BOOK})
    tasks = training_tasks(experiment, settings)
    begun = 0
    while not journal.over:
        session = journal.open_session
        if journal.open_run is not None:
            _run(history, teaching, settings, journal, journal.open_run)
        elif reason := _over(settings, journal, len(tasks)):
            if session is not None:
                _end_session(teaching, history, journal)
            journal.note({"over": reason})
        elif session is None:
            if teaching.sessions is not None and begun >= teaching.sessions:
                break
            _begin_session(history, teaching, settings, journal)
            begun += 1
        elif session.active_s >= settings.session_minutes * 60:
            _end_session(teaching, history, journal)
        else:
            number = len(journal.runs)  # of scenes, so that a task which is begun again has another
            seed = experiment.seed + history.number * SEEDS_A_HISTORY + number
            began = {"begin": number + 1, "session": session.number, "participant": session.participant}
            journal.note(began | {"task": tasks[journal.tasks_over % len(tasks)], "seed": seed})
    return journal


def _over(settings: StudySettings, journal: Journal, tasks: int) -> str:
    """Why the history is over; empty where it is not."""
    if journal.tasks_over >= settings.rounds * tasks:
        are = "is" if settings.rounds == 1 else "are"
        return f"{counted(settings.rounds, 'round')} of {counted(tasks, 'task')} {are} done"
    if settings.hours is not None and journal.active_s >= settings.hours * 3600:
        return f"{settings.hours:g} hours of teaching are over"
    return ""


def _begin_session(history: TeachingHistory, teaching: Teaching, settings: StudySettings, journal: Journal) -> None:
    number = len(journal.sessions) + 1
    who = history.order[(number - 1) % len(history.order)]
    teacher = _teacher(history, teaching, who, None, 0, settings)
    if teacher.simulated:
        consent = "simulated"
        teaching.people.note(who.id, demographics_of(who))
    else:
        consent = teaching.consent.digest
        reception = _reception(teaching, teacher, who)
        if not reception.agrees(who.id, teaching.consent.text):
            raise Stopped(f"beginning session {number}: {who.id} did not agree")
        known = teaching.people.known(who.id, demographics_of(who))
        teaching.people.note(who.id, reception.about(who.id, known))
    journal.note({"session": number, "participant": who.id, "consent": consent})
    teaching.report(f"history {history.number}, session {number}: {who.id}")


def _reception(teaching: Teaching, teacher: Teacher, who: Participant) -> Reception:
    reception = teacher.reception or teaching.reception
    if reception is None:
        raise InvalidArgument("study.participants", f"{who.id} is a person and nobody receives them", "memo study run")
    return reception


def _end_session(teaching: Teaching, history: TeachingHistory, journal: Journal) -> None:
    session = journal.open_session
    assert session is not None
    with book_of(teaching.load(), str(history.folder / BOOK), read_only=True) as book:
        revision = book.generation()
    journal.note({"session_end": session.number, "active_s": round(session.active_s, 3), "revision": revision})
    teaching.registry.emit(SessionEnded(session.participant, session.number))


def _teacher(
    history: TeachingHistory,
    teaching: Teaching,
    who: Participant,
    task: Task | None,
    seed: int,
    settings: StudySettings,
) -> Teacher:
    teacher = teacher_of(teaching.load, who, task, seed, settings.lessons)
    teacher.study = history.folder.parent
    return teacher


def _run(
    history: TeachingHistory, teaching: Teaching, settings: StudySettings, journal: Journal, run: TaughtRun
) -> None:
    """Do a run, or go on with it. Raises ``Stopped`` where a person ended it."""
    book_url = str(history.folder / BOOK)
    experiment = teaching.load(f"skillbook.url={book_url}", task=run.task, seed=run.seed)
    task = task_of(experiment, run.task)
    who = next(one for one in history.order if one.id == run.participant)
    book = book_of(experiment, book_url, read_only=False)
    teacher = _teacher(history, teaching, who, task, run.seed, settings)
    clustering = after_run(experiment)
    components = components_of(
        experiment, lambda: environment_of(experiment, task, run.seed), book, teacher, clustering=clustering
    )
    folder = history.folder / run.folder
    over = _session_clock(teaching, settings, journal, folder, teacher.simulated)
    components = attrs.evolve(components, time_is_up=over, attended=True, begun=teaching.begun)
    summary = do_one(components, task, run.seed, folder, teaching.registry, public(experiment), view=teaching.view)
    with book_of(experiment, book_url, read_only=True) as read:
        newest = max((one.id for one in raw_log.raw_log(read).feedback), default=0)
    active = active_seconds(settings, summary, calls_that_count(folder))
    journal.note(_ended(run, summary, active, newest))
    verdict = "done" if summary["success"] else "not done"
    if not teacher.simulated and teacher.reception is None:
        verdict = "ended"  # a person at this terminal is not to be taught by the task's check
    remarks = summary["corrections"] + summary["planning_remarks"]
    hours = journal.active_s / 3600
    teaching.report(f"  {hours:5.2f} h  {run.participant}  {run.task}: {verdict}, {counted(remarks, 'correction')}")


def _session_clock(
    teaching: Teaching, settings: StudySettings, journal: Journal, folder: Path, simulated: bool
) -> Callable[[float, int, int], bool]:
    """Announce the session's next task; returns ``Person.time_is_up`` for its run, which announces the time left."""
    session = journal.open_session
    assert session is not None
    emit, already_s, session_s = teaching.registry.emit, wall_seconds(folder), settings.session_minutes * 60
    left = time_left(settings, session_s - session.active_s, already_s)
    begun = (session.participant, session.number, session.runs, already_s > 0)
    emit(SessionTask(*begun, session_s, left(0.0, 0, 0), simulated))

    def over(robot_s: float, attempts: int, calls: int) -> bool:
        left_s = left(robot_s, attempts, calls)
        emit(TimeLeft(left_s))
        return left_s <= 0

    return over


def _ended(run: TaughtRun, summary: dict[str, Any], active_s: float, feedback: int) -> dict[str, Any]:
    kept = ("success", "reason", "corrections", "planning_remarks", "interruptions", "robot_s", "problem")
    cut = summary["ended"] == TIME_IS_UP and not summary["success"]
    ended = {"end": run.number, "active_s": active_s, "feedback": feedback, "session_over": cut}
    return ended | {key: summary[key] for key in kept}
