"""Going on with all histories of a study: one after the other, or several at once in processes of their own."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import attrs

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument, MemoError
from memo_core.interfaces.reception import Reception
from memo_core.plugins.registry import Registry
from memo_core.process.stop_switch import StopSwitch
from memo_core.process.worker_processes import in_processes
from memo_core.runs.background import Consolidation
from memo_core.runs.consolidation import in_background
from memo_core.runs.run_errors import Halted, NotCarriedOut
from memo_core.study.history import BOOK, Teaching, TeachingHistory, teach
from memo_core.study.participants import Load
from memo_core.study.people import People
from memo_core.study.settings import StudySettings
from memo_core.study.study import CONFIG, check, histories_of, loader, shared_settings, study_sections

Stopping = Callable[[], AbstractContextManager[StopSwitch]]


@attrs.frozen
class Failed:
    """An error of another process, as text."""

    problem: str


def run_study(
    load: Load,
    registry: Registry,
    folder: Path,
    jobs: int = 1,
    sessions: int | None = None,
    reception: Reception | None = None,
    report: Callable[[str], None] = lambda line: None,
    stopping: Stopping = lambda: nullcontext(StopSwitch()),
    view: bool = False,
) -> None:
    """Go on until every history is over, or until ``sessions`` more have ended in each. ``jobs``: histories at once,
    each in a process of its own; ``stopping`` gives the switch that ends them (a run in this process listens to Ctrl-C
    by itself); ``view``: each run opens the simulator's window. Raises ``Stopped`` when a person ends it,
    ``MemoError``."""
    experiment = load()
    consent = check(load, experiment)
    histories = histories_of(experiment, folder)
    if view:
        _check_view(experiment, jobs)
    if jobs > 1 and reception is not None and not _all_simulated(load):
        raise InvalidArgument("--jobs", "several at once, and real people take part", "1")
    if jobs > 1 and len(histories) > 1:
        with stopping() as stop:
            _at_once(folder, len(histories), jobs, sessions, report, stop)
        return
    teaching = Teaching(load, registry, consent, People(folder), reception, report, sessions, view=view)
    for history in histories:
        _teach(history, teaching)


def _teach(history: TeachingHistory, teaching: Teaching) -> None:
    """Teach as ``teach`` does. Raises ``Halted`` when a run could not be carried out: the study is paused, the run
    counts for nothing and is gone on with."""
    experiment, book = teaching.load(), str(history.folder / BOOK)
    wanted = in_background(experiment, book)
    try:
        with Consolidation(experiment, history.folder, book, wanted, teaching.report) as beside:
            teach(history, attrs.evolve(teaching, begun=beside.start))
    except NotCarriedOut as error:
        raise Halted("runs", error.error) from error


def _check_view(experiment: Experiment, jobs: int) -> None:
    """Raises ``MemoError`` where no window can be opened: before anybody is asked anything."""
    if jobs > 1:
        raise InvalidArgument("--view", "several histories at once would share a screen", "--jobs 1")
    experiment.create("simulator").check_view()


def _all_simulated(load: Load) -> bool:
    from memo_core.study.participants import participants_of, teacher_of

    settings: StudySettings = load().section("study")
    return all(teacher_of(load, one, None, 0, False).simulated for one in participants_of(settings))


def _at_once(
    folder: Path, histories: int, jobs: int, sessions: int | None, report: Callable[[str], None], stop: StopSwitch
) -> None:
    do = functools.partial(_one_history, folder, sessions)
    for number, lines in in_processes(do, range(histories), jobs, stop, report):
        if isinstance(lines, Failed):
            raise InvalidArgument(str(folder / f"history-{number}"), lines.problem)
        for line in lines:
            report(line)
    stop.check("teaching")


def _one_history(folder: Path, sessions: int | None, number: int) -> tuple[int, list[str] | Failed]:
    """In a process of its own: go on with one history."""
    lines: list[str] = []
    failed: list[Failed] = []

    def work() -> None:
        registry = Registry()
        load = loader(registry, folder / CONFIG, study_sections(), shared_settings(folder))
        experiment = load()
        consent = check(load, experiment)
        teaching = Teaching(load, registry, consent, People(folder), report=lines.append, sessions=sessions)
        try:
            _teach(histories_of(experiment, folder)[number], teaching)
        except MemoError as error:
            failed.append(Failed(str(error)))

    # Not in the main thread: there each run would take over the signals.
    thread = threading.Thread(target=work, name="memo-history")
    thread.start()
    thread.join()
    return number, failed[0] if failed else lines
