"""Doing one trial: a run in a folder of its own, and its row of the table.

trials/ID/row.json        the row; missing until the trial is over
trials/ID/error.json      why it could not be carried out the last time; missing once it is over
trials/ID/run/…           the folder of the run, as of any run; missing where it shares another's
trials/ID/recording.jsonl what the model was asked and said, where that is recorded
trials/ID/questions.jsonl what the book was asked and served, where nobody watched
"""

from __future__ import annotations

import json
import shutil
import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.evaluation.books import LESSON_BOOK, book_key, lesson_digest, told_of
from memo_core.evaluation.grid import Trial
from memo_core.evaluation.lesson_book import LessonServed, lesson_served
from memo_core.evaluation.on_hardware import Judge, hidden_name, is_hardware, judged, set_up
from memo_core.evaluation.retrieval_equivalence import (
    effects_of,
    executed_in,
    observed_book,
    programs_in,
    read_questions,
    same_answers,
    served_in,
)
from memo_core.evaluation.settings import EMPTY, LESSONS, PRESET, EvaluationSettings
from memo_core.interfaces.task import Task
from memo_core.interfaces.teacher import Teacher
from memo_core.plugins.registry import Registry
from memo_core.policy.learnt_functions import used_by
from memo_core.policy.method_interface import LanguageMethod
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.whole_files import write_whole
from memo_core.runs.factories import book_of, environment_of, task_of, world_of
from memo_core.runs.folder import json_text, nested
from memo_core.runs.idempotent_run import do_one, public
from memo_core.runs.record_replay import recorded, replayed
from memo_core.runs.run import check_release, components_of
from memo_core.runs.run_errors import NotCarriedOut, RunError
from memo_core.runs.trial_sheet import write_trial_sheet
from memo_core.skillbook.book import Skillbook
from memo_core.study.participants import Load, teacher_of
from memo_core.study.settings import Participant
from memo_core.text.parsing import parse_json

ROW, QUESTIONS, RECORDING, RUN = "row.json", "questions.jsonl", "recording.jsonl", "run"
ERROR = "error.json"
PRIVATE = "skillbook.db"  # a trial's copy of a book
NO_FILE = "sqlite://"  # a book in memory that nobody writes to
WATCHER = "E1"  # id of who corrects in an evaluation


@attrs.frozen(eq=False)
class Place:
    """Where an evaluation's files are: the experiment's folder."""

    folder: Path
    hidden: bool = False  # whether the folders of trials have names that do not tell the method

    @property
    def trials(self) -> Path:
        return self.folder / "evaluation" / "trials"

    def of(self, trial: Trial) -> Path:
        """The folder of a trial."""
        return self.trials / (hidden_name(trial) if self.hidden else trial.id)

    @property
    def books(self) -> Path:
        return self.folder / "books"

    def row(self, trial: Trial) -> dict[str, Any] | None:
        """The row of a trial that is over, with the book as it is now."""
        file = self.of(trial) / ROW
        row = parse_json(file.read_text(encoding="utf-8")) if file.exists() else None
        if row is None or row["book"] != self.digest(trial) or self._was_an_error(trial, row):
            return None
        return dict(row)

    def error(self, trial: Trial) -> dict[str, Any] | None:
        """The trial's columns with ``cause``, ``problem`` and ``persistent``, if it could not be carried out the last
        time that it was tried."""
        file = self.of(trial) / ERROR
        return dict(parse_json(file.read_text(encoding="utf-8"))) if file.exists() else None

    def _was_an_error(self, trial: Trial, row: dict[str, Any]) -> bool:
        """Whether an earlier version counted a model that could not answer as a failure; such a trial is done again."""
        summary = self.of(trial) / RUN / "summary.json"
        if row["success"] or not summary.exists():
            return False
        return bool(parse_json(summary.read_text(encoding="utf-8")).get("unanswerable"))

    def digest(self, trial: Trial) -> str:
        """Of what the trial's book holds; empty where it has none, or was given one."""
        if trial.given == LESSONS:
            return lesson_digest(self.books)
        key = book_key(trial)
        told = told_of(self.books, key) if key is not None else None
        return str(told["digest"]) if told is not None else ""

    def book(self, trial: Trial) -> str:
        """The file of a trial's book; empty for none."""
        if trial.given == LESSONS:
            return str(self.books / LESSON_BOOK)
        if trial.given == EMPTY:
            return ""
        key = book_key(trial)
        return trial.given or (str(self.books / key.file) if key is not None else "")


def do_group(
    load: Load,
    registry: Registry,
    place: Place,
    trials: Sequence[Trial],
    tried: Callable[[RunError | None], None] = lambda error: None,
) -> None:
    """The trials of one scene, in order; what is over already is not done again, and what would come out the same as
    another shares its run. ``tried`` hears of each trial the error by which it could not be carried out, or None; such
    a trial leaves ``ERROR``, and a persistent error ends the group. Raises ``Stopped`` when a person or a limit ends a
    run, ``MemoError``."""
    for trial in trials:
        if place.row(trial) is not None:
            continue
        try:
            row = _shared(load, place, trial, trials) or _done(load, registry, place, trial)
        except NotCarriedOut as error:
            about = _about(experiment_of(load, trial), trial, place)
            write_whole(place.of(trial) / ERROR, json_text(about | attrs.asdict(error.error)))
            tried(error.error)
            if error.error.persistent:
                return
            continue
        _keep(place.of(trial), row)
        tried(None)


def do_on_robot(load: Load, registry: Registry, place: Place, trials: Sequence[Trial], stop: StopSwitch) -> None:
    """Trials on a real robot, in this order and in the main thread, which asks the person; what is over already is not
    done again. Raises ``Stopped`` when a person pauses or ends a run, ``MemoError``."""
    experiment = load()
    first = experiment.section("evaluation").first_scene
    for number, trial in enumerate(trials, start=1):
        if place.row(trial) is None:
            if not (place.of(trial) / RUN).exists():
                set_up(experiment.create("teacher"), trial, first, task_of(experiment, trial.task), number, len(trials))
            stop.check("evaluating")
            _keep(place.of(trial), _done(load, registry, place, trial))


def _keep(folder: Path, row: dict[str, Any]) -> None:
    write_whole(folder / ROW, json_text(row))
    (folder / ERROR).unlink(missing_ok=True)


def experiment_of(load: Load, trial: Trial, *further: str) -> Experiment:
    """The experiment as this trial changes it."""
    whole = load()
    settings: EvaluationSettings = whole.section("evaluation")
    given = [f"method={json.dumps(_method_section(whole, trial.method))}", "run.video=off"]
    if trial.ablation == PRESET:
        given.append("preset=paper")
    if trial.mode == "corrected":
        limit = settings.corrected.corrections
        given += [f"run.max_feedback={limit}", f"run.attempts={limit + 1}"]
        if not is_hardware(whole):  # beside a real robot is the experiment's own teacher
            given.append(f"teacher={json.dumps(settings.corrected.teacher)}")
    return load(*given, *further, task=trial.task, seed=trial.model_seed)


def _method_section(experiment: Experiment, name: str) -> dict[str, Any]:
    """The section ``method`` of a trial: the entry of ``evaluation.methods``, as it was written."""
    entries = nested(experiment.public())["evaluation"]["methods"]
    return next((dict(entry) for entry in entries if entry["backend"] == name), {"backend": name})


def _done(load: Load, registry: Registry, place: Place, trial: Trial) -> dict[str, Any]:
    experiment, folder = experiment_of(load, trial), place.of(trial)
    _remove_former(folder, place.digest(trial))
    task = task_of(experiment, trial.task)
    teacher: Teacher | None = None
    judge: Judge | None = None
    hardware = is_hardware(experiment)
    if hardware:
        teacher = experiment.create("teacher")
        check_release(experiment, teacher)
    if trial.mode == "zero-shot":
        if teacher is not None:
            teacher = judge = Judge(teacher, folder)
    elif teacher is None:
        watcher = Participant(WATCHER, load().section("evaluation").corrected.teacher)
        teacher = teacher_of(load, watcher, task, trial.scene, knows_lessons=True)
    book = _book(experiment, place, trial)
    experiment = _transcribed(experiment, registry, place, trial)
    environment = world_of if hardware else environment_of
    components = components_of(experiment, lambda: environment(experiment, task, trial.scene), book, teacher)
    if judge is not None:
        components = attrs.evolve(components, time_is_up=judge.over)
    summary = do_one(components, task, trial.model_seed, folder / RUN, registry, public(experiment))
    if judge is not None:
        summary = judged(summary, judge.outcome(task, summary["ended"]))
    write_trial_sheet(experiment, summary, folder / RUN)
    lesson = _lesson(experiment, task, place, trial)
    if trial.mode == "corrected":
        for left in folder.glob(f"{PRIVATE}*"):
            left.unlink()  # what people said stays in the books that `forget` knows of
    return _row(experiment, trial, summary, lesson, place)


def _book(experiment: Experiment, place: Place, trial: Trial) -> Skillbook | None:
    """The trial's skillbook: one that is only read and observed or, in a corrected trial, a private copy. None for a
    method that neither retrieves nor takes feedback."""
    if not _takes_book(experiment):
        return None
    folder, private = place.of(trial), place.of(trial) / PRIVATE
    if trial.mode == "zero-shot":
        memory = experiment.choice("method").backend.memory
        return observed_book(experiment, place.book(trial) or NO_FILE, memory, folder / QUESTIONS)
    if not private.exists():
        _copy(place.book(trial), private)
    return book_of(experiment, str(private), read_only=False)


def _takes_book(experiment: Experiment) -> bool:
    method = experiment.choice("method").backend
    return method.memory.any or method.takes_feedback


def _lesson(experiment: Experiment, task: Task, place: Place, trial: Trial) -> LessonServed:
    """Whether the lesson of a task with a trick was served; not known on a real robot, which has no other scenes."""
    if is_hardware(experiment) or not task.trick or not trial.has_memory:
        return LessonServed()
    folder = place.of(trial)
    url = place.book(trial) or NO_FILE
    with book_of(experiment, str(folder / PRIVATE) if trial.mode == "corrected" else url, read_only=True) as book:
        return lesson_served(experiment, task, folder / RUN, book)


def _transcribed(experiment: Experiment, registry: Registry, place: Place, trial: Trial) -> Experiment:
    """The experiment with its model recorded, or played back, as the settings say."""
    settings: EvaluationSettings = experiment.section("evaluation")
    if settings.replay:
        kept = Place(Path(settings.replay)).of(trial) / RECORDING
        packed = kept.with_name(f"{RECORDING}.gz")
        file = packed if packed.exists() and not kept.exists() else kept
        return replayed(experiment, registry, file, match=settings.replay_match)
    return recorded(experiment, registry, place.of(trial) / RECORDING) if settings.record else experiment


def _remove_former(folder: Path, digest: str) -> None:
    """Take away a trial that was begun with a book that held something else."""
    mark = folder / "book.digest"
    if folder.exists() and (not mark.exists() or mark.read_text(encoding="utf-8") != digest):
        shutil.rmtree(folder)
    write_whole(mark, digest)


def film_trial(load: Load, registry: Registry, place: Place, trial: Trial, folder: Path) -> dict[str, Any]:
    """A zero-shot trial once more, filmed, as a run in ``folder``; its summary. With a deterministic model it is the
    same run."""
    experiment = experiment_of(load, trial, "run.video=auto")
    task = task_of(experiment, trial.task)
    book = book_of(experiment, place.book(trial) or NO_FILE, read_only=True) if _takes_book(experiment) else None
    components = components_of(experiment, lambda: environment_of(experiment, task, trial.scene), book, None)
    return do_one(components, task, trial.model_seed, folder, registry, public(experiment))


def _copy(file: str, to: Path) -> None:
    """A private copy of a book, or none where there is none: the run makes a new one."""
    to.parent.mkdir(parents=True, exist_ok=True)
    part = to.with_suffix(".part")
    part.unlink(missing_ok=True)
    if not file:
        return
    with closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as source, closing(sqlite3.connect(part)) as copy:
        source.backup(copy)
    part.rename(to)


def _shared(load: Load, place: Place, trial: Trial, group: Sequence[Trial]) -> dict[str, Any] | None:
    """The row of a trial that has been run and would come out the same; None where there is none."""
    experiment = experiment_of(load, trial)
    settings: EvaluationSettings = experiment.section("evaluation")
    deterministic: bool = experiment.create("llm").deterministic
    if (
        not settings.reuse
        or settings.replay
        or not deterministic
        or trial.mode != "zero-shot"
        or trial.ablation == PRESET
        or not _depends_on_retrieval_alone(experiment)
    ):
        return None
    memory = experiment.choice("method").backend.memory
    with book_of(experiment, place.book(trial) or NO_FILE, read_only=True) as book:
        for other in group:
            row = place.row(other)
            if row is None or row["same_as"] != other.id or other.mode != trial.mode or other.ablation == PRESET:
                continue
            if not _depends_on_retrieval_alone(experiment_of(load, other)):
                continue
            if not other.has_memory:
                continue  # it asked nothing, which says nothing about what it would have been served
            try:
                questions = read_questions(place.of(other) / QUESTIONS)
            except OSError:
                continue
            used = used_by(experiment.create("llm"), experiment.section("skillbook").functions)
            if same_answers(book, memory, questions, used):
                return row | _about(experiment, trial, place) | {"same_as": other.id, "wall_s": 0.0}
    return None


def _depends_on_retrieval_alone(experiment: Experiment) -> bool:
    """Whether the experiment's method is the language methods' loop, whose runs depend on the method only through what
    it retrieves."""
    return type(experiment.create("method")).run is LanguageMethod.run


def _about(experiment: Experiment, trial: Trial, place: Place) -> dict[str, Any]:
    return {
        "trial": trial.id,
        "method": trial.method,
        "memory": trial.has_memory,  # rows with and without are never averaged together
        "takes_feedback": experiment.choice("method").backend.takes_feedback,
        "ablation": trial.ablation,
        "mode": trial.mode,
        "task": trial.task,
        "scene": trial.scene,
        "number": trial.number,
        "history": trial.history,
        "hours": trial.hours,
        "given": trial.given,
        "book": place.digest(trial),
    }


def _row(
    experiment: Experiment, trial: Trial, summary: dict[str, Any], lesson: LessonServed, place: Place
) -> dict[str, Any]:
    effects = effects_of(place.of(trial) / RUN)
    at, why = _failure(summary)
    subtasks = [one["subtask"] for one in summary["subtasks"]]
    at_once = executed_in(effects) == len(subtasks) == len(set(subtasks))
    kept = ("reason", "ended", "corrections", "planning_remarks", "wall_s", "robot_s", "calls")
    tokens = {name: summary[name] for name in ("prompt_tokens", "completion_tokens", "cost")}
    tokens["cached_tokens"] = summary.get("cached_tokens", 0)  # a run of an older version has none
    return (
        _about(experiment, trial, place)
        | {"success": bool(summary["success"]), "first_programs": bool(summary["success"]) and at_once}
        | {name: summary[name] for name in kept}
        | tokens
        | {
            "attempts": sum(one["attempts"] for one in summary["subtasks"]),
            "subtasks": len(summary["subtasks"]),
            "programs": programs_in(effects),
            "failed_at": at,
            "why": why,
            "problem": summary["problem"] or "",
            "same_as": trial.id,  # the trial whose run this is: its own, or one that it would repeat
        }
        | served_in(effects)
        | {"lesson_needed": lesson.needed, "lesson_served": lesson.served}
    )


def _failure(summary: dict[str, Any]) -> tuple[str, str]:
    """The first subtask whose last code ended with an error, and that error; else the last subtask and what the success
    check says. Empty for a success."""
    if summary["success"]:
        return "", ""
    for one in summary["subtasks"]:
        if one["error"]:
            return one["subtask"], one["error"].splitlines()[0]
    last = summary["subtasks"][-1]["subtask"] if summary["subtasks"] else ""
    return last, summary["problem"] or summary["reason"]
