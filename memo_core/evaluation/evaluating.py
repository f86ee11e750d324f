"""A whole evaluation in an experiment's folder: its books, its trials, its table. Going on is the same call again.

study/                   what was taught (memo_core.study)
books/                   the book of each method after each hour
evaluation/config.yaml   the resolved experiment, which workers read
evaluation/code          digest of MEMO's and the plugins' files when it was begun
evaluation/trials/ID/    each trial
evaluation/trials.jsonl  the table, and trials.parquet
evaluation/errors.jsonl  trials that could not be carried out; missing where there are none
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import attrs
import yaml

from memo_core.config import Experiment, Unread
from memo_core.errors import InvalidArgument, Stopped
from memo_core.evaluation.books import contents, make_books, note_evaluation
from memo_core.evaluation.engines import Group, GroupResult, do_here, on_joblib, on_ray
from memo_core.evaluation.grid import Trial, trials_of
from memo_core.evaluation.on_hardware import check_settings, in_random_order, is_hardware
from memo_core.evaluation.settings import EvaluationSettings
from memo_core.evaluation.table import outcomes, rows_of, write_table
from memo_core.evaluation.trial import Place, do_on_robot, experiment_of
from memo_core.plugins.registry import Registry
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.whole_files import write_whole
from memo_core.runs.code_digest import code_digest
from memo_core.runs.factories import task_of, world_of
from memo_core.runs.folder import nested
from memo_core.runs.resuming import check_config
from memo_core.runs.run import check_release
from memo_core.runs.run_errors import Halted, RunError, reason_to_stop
from memo_core.study.journal import Journal
from memo_core.study.participants import Load
from memo_core.study.study import CONFIG, journals_of

_GRID = ("study.", "books.", "evaluation.", "report.")  # sections whose values may change: the grid may grow
_GOES_ON = "evaluating; the same command goes on"
POLL_S = 1.0
CODE = "code"  # file with the digest
DECIDED = (
    Unread("task", "evaluation.tasks says what is tried"),
    Unread("skillbook.url", "evaluation.hours and evaluation.books say which books are read"),
    Unread("skillbook.cluster", "books.clustering says when books are clustered", unless="off"),
    Unread("run.video", "trials are not filmed; memo reproduce --films makes films afterwards", unless="off"),
)
DECIDED_IN_SIMULATION = (Unread("teacher.backend", "evaluation.corrected.teacher says who corrects"),)


def unread(experiment: Experiment) -> tuple[str, ...]:
    """A sentence for each value of the experiment that an evaluation does not read."""
    decided = DECIDED if is_hardware(experiment) else (*DECIDED, *DECIDED_IN_SIMULATION)
    names = [choice.backend.name for choice in experiment.section("evaluation").methods]
    if experiment.choice("method").backend.name not in names:  # else an entry may leave keys to that section
        decided = (*decided, Unread("method.backend", "evaluation.methods says which are compared"))
    return experiment.unread("an evaluation", decided)


@attrs.frozen
class Standing:
    """How far an evaluation is. ``left_s``: an estimate from the pace so far; None before there is a pace."""

    done: int
    planned: int
    left_s: float | None


@attrs.frozen(eq=False)
class Evaluated:
    """What came of it."""

    folder: Path
    rows: tuple[dict[str, Any], ...]
    planned: int
    books: tuple[dict[str, Any], ...]
    wall_s: float
    errors: tuple[dict[str, Any], ...] = ()  # trials that could not be carried out, as ``Place.error``

    def summary(self) -> dict[str, Any]:
        """As ``memo evaluate --json`` prints it."""
        ran = sum(row["same_as"] == row["trial"] for row in self.rows)
        return {
            "folder": str(self.folder),
            "trials": len(self.rows),
            "planned": self.planned,
            "runs": ran,
            "shared": len(self.rows) - ran,
            "outcomes": outcomes(self.rows),
            "errors": len(self.errors),
            "wall_s": round(self.wall_s, 1),
        }


def evaluate(
    load: Load,
    folder: Path,
    stop: StopSwitch,
    note: Callable[[str], None] = lambda line: None,
    progress: Callable[[Standing], None] = lambda standing: None,
) -> Evaluated:
    """Do what is left of the evaluation in ``folder``. Raises ``Stopped``, and ``MemoError`` for what is wrong before
    anything begins or ends all of it; trials that are over stay."""
    started, experiment = time.monotonic(), load()
    settings: EvaluationSettings = experiment.section("evaluation")
    journals = _journals(experiment, settings, folder, note)
    trials = trials_of(experiment, len(journals))
    hardware = is_hardware(experiment)
    place = Place(folder, hidden=hardware)
    _check(load, experiment, trials)
    _keep_config(experiment, folder / "evaluation")
    _keep_code(experiment, folder / "evaluation", note)
    make_books(experiment, journals, place.books, trials, stop, note)
    note_evaluation(experiment, journals, trials, folder / "evaluation")
    problems: list[str] = []
    errors: list[RunError | None] = []
    try:
        if hardware:
            do_on_robot(load, Registry(), place, in_random_order(trials, experiment.seed), stop)
        with _watched(place, trials, progress):
            for result in _done(experiment, settings, folder, place, trials, stop, note):
                errors += result.errors
                if stop.pressed or result.stopped:
                    raise Stopped(_GOES_ON)
                if result.problem:
                    problems.append(result.problem)
                    note(result.problem)
                if (error := reason_to_stop(errors)) is not None:
                    raise Halted("trials", error)
        if stop.pressed:
            raise Stopped(_GOES_ON)
    finally:
        rows = rows_of(place, trials)
        failed = [kept for trial in trials if place.row(trial) is None and (kept := place.error(trial)) is not None]
        write_table(folder / "evaluation", rows, failed)
    if problems:
        raise InvalidArgument("evaluation", f"{len(problems)} groups of trials broke off: {problems[0]}")
    books = tuple(contents(place.books))
    return Evaluated(folder, tuple(rows), len(trials), books, time.monotonic() - started, tuple(failed))


def _done(
    experiment: Experiment,
    settings: EvaluationSettings,
    folder: Path,
    place: Place,
    trials: Sequence[Trial],
    stop: StopSwitch,
    note: Callable[[str], None],
) -> Iterator[GroupResult]:
    groups = _groups(experiment, settings, folder, place, trials)
    if settings.engine == "ray":
        return on_ray(groups, settings.ray_address, stop)
    if settings.jobs > 1:
        return on_joblib(groups, settings.jobs, stop, note)
    return (do_here(group, stop) for group in groups)


def _groups(
    experiment: Experiment, settings: EvaluationSettings, folder: Path, place: Place, trials: Sequence[Trial]
) -> list[Group]:
    """What is left to do, by scene where runs may be shared, else trial by trial."""
    config = folder / "evaluation" / CONFIG
    shared = settings.reuse and not settings.replay and experiment.create("llm").deterministic
    groups: dict[Any, list[Trial]] = {}
    for trial in trials:
        alone = not shared or trial.mode == "corrected"
        groups.setdefault(trial.id if alone else trial.group, []).append(trial)
    left = [group for group in groups.values() if any(place.row(trial) is None for trial in group)]
    return [Group(folder, config, tuple(group)) for group in left]


def _journals(
    experiment: Experiment, settings: EvaluationSettings, folder: Path, note: Callable[[str], None]
) -> list[Journal]:
    """The histories that were taught; none where only given books are evaluated."""
    if not settings.hours:
        return []
    journals = journals_of(experiment, folder / "study")
    for number, journal in enumerate(journals):
        if not journal.runs:
            problem = f"{folder / 'study'} has no history {number}"
            raise InvalidArgument("evaluation.hours", problem, "memo study run first, or hours: [] with `books`")
        if journal.active_s / 3600 < max(settings.hours):
            taught = f"{journal.active_s / 3600:.2f} h of teaching"
            note(f"history {number} has {taught}: books of more hours hold what there is")
    return journals


def _check(load: Load, experiment: Experiment, trials: Sequence[Trial]) -> None:
    """Raises ``MemoError`` for what would go wrong in every trial."""
    if not trials:
        raise InvalidArgument("evaluation", "no trials", "hours, books, or a method without memory")
    if twice := len(trials) - len({trial.id for trial in trials}):
        raise InvalidArgument("evaluation", f"{twice} trials twice", "each method, task, hour and book once")
    if is_hardware(experiment):
        check_settings(experiment.section("evaluation"))
        check_release(experiment, experiment.create("teacher"))
    for choice in experiment.section("evaluation").methods:
        choice.create()
    for trial in {(trial.mode, trial.ablation): trial for trial in trials}.values():
        checked = experiment_of(load, trial)
        world_of(checked, task_of(checked, trial.task), trial.scene)


def _keep_config(experiment: Experiment, folder: Path) -> None:
    """For workers, and to refuse another experiment in this folder."""
    values = experiment.public()
    if (folder / CONFIG).exists():
        _check_same(folder, values)
    write_whole(folder / CONFIG, yaml.safe_dump(nested(values), sort_keys=False, allow_unicode=True))


def _keep_code(experiment: Experiment, folder: Path, note: Callable[[str], None]) -> None:
    """Keep what code the evaluation began with, and say so where it is another now: trials that are over stay."""
    methods = experiment.section("evaluation").methods
    file, now = folder / CODE, code_digest(experiment, further=methods)
    if not file.exists():
        write_whole(file, now)
    elif file.read_text(encoding="utf-8") != now:
        said = "trials that are over stay as they are; use a new folder to do them again"
        note(f"MEMO or a plugin has changed since {folder} was begun: {said}")


def _check_same(folder: Path, values: dict[str, Any]) -> None:
    before = yaml.safe_load((folder / CONFIG).read_text(encoding="utf-8"))
    then, now = methods_of(before), methods_of(nested(values))
    both = {f"evaluation.methods.{name}": (then[name], now[name]) for name in then if name in now}
    kept = {name: section for name, section in before.items() if f"{name}." not in _GRID}
    kept |= nested({path: settings for path, (settings, _) in both.items()})
    fixed = {path: value for path, value in values.items() if not path.startswith(_GRID)}
    write_whole(folder / "fixed" / CONFIG, yaml.safe_dump(kept, sort_keys=False, allow_unicode=True))
    try:
        check_config(folder / "fixed", fixed | {path: settings for path, (_, settings) in both.items()})
    except InvalidArgument as error:
        problem = f"{folder.parent} holds an evaluation with {error.problem}"
        raise InvalidArgument("--out", problem, "another folder, or the same experiment") from None


def methods_of(settings: dict[str, Any]) -> dict[str, Any]:
    """The settings of the methods that an evaluation compares, by method."""
    listed = settings.get("evaluation", {}).get("methods", ())
    entries = [{"backend": entry} if isinstance(entry, str) else entry for entry in listed]  # text: a former version's
    return {entry["backend"]: entry for entry in entries}


@contextmanager
def _watched(place: Place, trials: Sequence[Trial], progress: Callable[[Standing], None]) -> Iterator[None]:
    """Tell how far it is, once a second. The estimate is by the pace so far, shared runs included."""
    planned, over = len(trials), threading.Event()
    left = [trial for trial in trials if place.row(trial) is None]
    before, started = planned - len(left), time.monotonic()

    def watch() -> None:
        nonlocal left
        while True:
            left = [trial for trial in left if place.row(trial) is None]
            done, took = planned - len(left), time.monotonic() - started
            pace = (done - before) / took if done > before else None
            progress(Standing(done, planned, None if pace is None else len(left) / pace))
            if over.wait(POLL_S):
                return

    thread = threading.Thread(target=watch, name="memo-progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
