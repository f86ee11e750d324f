"""The Python interface for scripts and notebooks: load an experiment, run it, open its book, act in its environment.

All of it is exported by ``memo_core`` itself, and imported when it is first used::

    import memo_core as memo

    experiment = memo.load("experiment.yaml", "seed=4")
    report = memo.run(experiment, out="runs")
    print(report.success, report.why)
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

from memo_core.config import Experiment, load_experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.errors import InvalidArgument
from memo_core.events import Event
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import book_of, environment_of, task_of, tasks_of
from memo_core.runs.run import RunReport, run_experiment
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook.book import Skillbook


def load(
    file: str | Path | None = None, *overrides: str, task: str | None = None, seed: int | None = None
) -> Experiment:
    """Read and check an experiment.

    Args: file: an experiment file; without one, the defaults of the installed plugins. overrides: single values as
    after ``--set``, for instance ``"llm.backend=offline"``. task: name of the task; takes precedence over the file.
    seed: seed of the scene and of all random numbers; takes precedence over the file.

    Raises:
        ConfigErrors: with everything that is wrong, each with file, line and path.
    """
    path = None if file is None else Path(file)
    return load_experiment(registry(), path, overrides, SECTIONS, task, seed)


def tasks(experiment: Experiment) -> tuple[str, ...]:
    """Names of the tasks of the experiment's suite."""
    return tuple(task.name for task in tasks_of(experiment))


def run(experiment: Experiment, out: str | Path = "runs", listener: Callable[[Event], None] | None = None) -> RunReport:
    """Do the experiment's task once, in a new folder under ``out``, and return how it went.

    Call it in the main thread: it handles Ctrl-C meanwhile. ``listener`` is called with every event, in the policy's
    thread.

    Raises:
        MemoError: for errors before the run begins; later errors end the run and are in the report.
    """
    return run_experiment(experiment, registry(), Path(out), listener)


def open_book(book: str | Path | Experiment, read_only: bool = True) -> Skillbook:
    """An open skillbook: a file, a database URL, or the book of an experiment. Use it as a context manager, or
    ``close`` it.

    Raises:
        SkillbookError: for a book that cannot be opened, such as a missing one with ``read_only``.
    """
    experiment = book if isinstance(book, Experiment) else load()
    url = None if isinstance(book, Experiment) else str(book)
    opened = book_of(experiment, url, read_only)
    opened.open()
    return opened


def make_environment(experiment: Experiment, task: str | None = None, seed: int | None = None) -> SimulatedEnvironment:
    """An open environment of a task, with the robot in its home configuration. Use it as a context manager, or
    ``close`` it.

    It has ``look``, ``step``, ``render``, ``checkpoint``, ``restore``, ``check``, and ``control`` for the skills.

    Args:
        experiment: chooses simulator, robot and perception.
        task: name of the task; by default the experiment's.
        seed: of the scene; by default the experiment's.

    Raises: UnknownName: for a task that does not exist. BackendUnavailable: if a requirement of a backend is missing.
    """
    name = task or experiment.task
    if name is None:
        raise InvalidArgument("task", "which scene?", "the name of a task: memo_core.tasks(experiment)")
    environment = environment_of(experiment, task_of(experiment, name), experiment.seed if seed is None else seed)
    environment.open()
    return environment


@functools.cache
def registry() -> Registry:
    """The installed plugins, loaded once per process."""
    return Registry()
