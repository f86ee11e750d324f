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

    Args:
        file: experiment file; None: the defaults of the installed plugins.
        overrides: single values as after ``--set``, such as ``"llm.backend=offline"``.
        task: name of the task; takes precedence over the file.
        seed: seed of the scene and of all random numbers; takes precedence over the file.

    Returns:
        The checked experiment; none of its parts is created yet.

    Raises:
        ConfigErrors: with all errors, each with its file, line and path.
    """
    path = None if file is None else Path(file)
    return load_experiment(registry(), path, overrides, SECTIONS, task, seed)


def tasks(experiment: Experiment) -> tuple[str, ...]:
    """Names of the tasks of the experiment's suite.

    Args:
        experiment: selects the suite.

    Returns:
        Names in the suite's order.

    Raises:
        NoDefaultBackend: if neither the experiment nor the installed plugins determine a suite.
        BackendUnavailable: if the suite cannot be created.
    """
    return tuple(task.name for task in tasks_of(experiment))


def run(experiment: Experiment, out: str | Path = "runs", listener: Callable[[Event], None] | None = None) -> RunReport:
    """Run the experiment's task once, in a new folder below ``out``.

    Call it in the main thread, where it handles Ctrl-C until it returns.

    Args:
        experiment: the task and all settings of the run.
        out: folder in which the run's folder is made.
        listener: called with every event, in the calling thread or the policy's; the robot waits until it returns.

    Returns:
        The report; a ``MemoError`` that ended the run is in its ``problem``.

    Raises:
        InvalidArgument: if the experiment names no task.
        MemoError: for any other error before the run begins.
    """
    return run_experiment(experiment, registry(), Path(out), listener)


def open_book(book: str | Path | Experiment, read_only: bool = True) -> Skillbook:
    """Open a skillbook. Use it as a context manager, or ``close`` it.

    Args:
        book: file, database URL, or an experiment for its own book; the first two use the default embedder and store.
        read_only: refuse writes, and do not create a missing book.

    Returns:
        The open book.

    Raises:
        SkillbookError: if the book cannot be opened, for instance a missing one with ``read_only``.
        BackendUnavailable: if the embedder or the vector store cannot be created.
    """
    experiment = book if isinstance(book, Experiment) else load()
    url = None if isinstance(book, Experiment) else str(book)
    opened = book_of(experiment, url, read_only)
    opened.open()
    return opened


def make_environment(experiment: Experiment, task: str | None = None, seed: int | None = None) -> SimulatedEnvironment:
    """Open an environment of a task, the robot at home. Use it as a context manager, or ``close`` it.

    It has ``look``, ``step``, ``render``, ``checkpoint``, ``restore``, ``check``, and ``control`` for the skills.

    Args:
        experiment: selects simulator, robot and perception.
        task: name of the task; None: the experiment's.
        seed: seed of the scene; None: the experiment's.

    Returns:
        The open environment.

    Raises:
        InvalidArgument: if neither the argument nor the experiment names a task.
        UnknownName: if the suite has no such task.
        BackendUnavailable: if a backend cannot be used here, or the robot's driver moves hardware.
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
