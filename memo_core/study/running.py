"""Going on with all histories of a study: one after the other, or several at once in processes of their own."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from pathlib import Path

import attrs

from memo_core.errors import InvalidArgument, MemoError
from memo_core.plugins import Registry
from memo_core.runs.sections import SECTIONS
from memo_core.study.consent import Reception
from memo_core.study.history import Teaching, teach
from memo_core.study.participants import Load
from memo_core.study.people import People
from memo_core.study.settings import StudySettings
from memo_core.study.study import CONFIG, check, histories_of, loader, shared_settings


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
) -> None:
    """Go on until every history is over, or until ``sessions`` more have ended in each. ``jobs``: histories at once,
    each in a process of its own. Raises ``Stopped`` when a person ends it, ``MemoError``."""
    experiment = load()
    consent = check(load, experiment)
    histories = histories_of(experiment, folder)
    if jobs > 1 and reception is not None and not _all_simulated(load):
        raise InvalidArgument("--jobs", "several at once, and real people take part", "1")
    if jobs > 1 and len(histories) > 1:
        _in_processes(folder, len(histories), jobs, sessions, report)
        return
    teaching = Teaching(load, registry, consent, People(folder), reception, report, sessions=sessions)
    for history in histories:
        teach(history, teaching)


def _all_simulated(load: Load) -> bool:
    from memo_core.study.participants import participants_of, teacher_of

    settings: StudySettings = load().section("study")
    return all(teacher_of(load, one, None, 0, False).simulated for one in participants_of(settings))


def _in_processes(folder: Path, histories: int, jobs: int, sessions: int | None, report: Callable[[str], None]) -> None:
    from joblib import Parallel, delayed

    work = (delayed(_one_history)(folder, number, sessions) for number in range(histories))
    for number, lines in Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)(work):
        if isinstance(lines, Failed):
            raise InvalidArgument(str(folder / f"history-{number}"), lines.problem)
        for line in lines:
            report(line)


def _one_history(folder: Path, number: int, sessions: int | None) -> tuple[int, list[str] | Failed]:
    """In a process of its own: go on with one history. Ctrl-C is the parent's, which ends this process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    lines: list[str] = []
    failed: list[Failed] = []

    def work() -> None:
        registry = Registry()
        load = loader(registry, folder / CONFIG, study_sections(), shared_settings(folder))
        experiment = load()
        consent = check(load, experiment)
        teaching = Teaching(load, registry, consent, People(folder), report=lines.append, sessions=sessions)
        try:
            teach(histories_of(experiment, folder)[number], teaching)
        except MemoError as error:
            failed.append(Failed(str(error)))

    # Not in the main thread: there each run would take over the signals.
    thread = threading.Thread(target=work, name="memo-history")
    thread.start()
    thread.join()
    return number, failed[0] if failed else lines


def study_sections() -> dict[str, type]:
    """The sections of an experiment file that a study reads."""
    return SECTIONS | {"study": StudySettings}
