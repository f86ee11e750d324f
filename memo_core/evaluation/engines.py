"""Doing groups of trials at once: in processes of this machine (joblib), or on a cluster (Ray) whose nodes share the
experiment's folder.

A group leaves a file for each trial that is over, so nothing is lost with a worker that is killed: its group is done
again, and what is over is passed over."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import MemoError, Stopped
from memo_core.evaluation.grid import Trial
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.evaluation.trial import Place, do_group
from memo_core.plugins import Registry
from memo_core.study.study import loader, shared_settings

MOST_DEATHS = 5  # of workers, before an evaluation gives up


@attrs.frozen
class Group:
    """What a worker gets: plain values, so that it can be another machine's."""

    folder: Path
    config: Path
    trials: tuple[Trial, ...]


@attrs.frozen
class Problem:
    """What kept a group from its end; ``stopped``: a person or a limit did."""

    text: str
    stopped: bool = False


def do_here(group: Group) -> Problem | None:
    """Do a group in this process, in a thread that is not the main one: Ctrl-C is for the process that waits."""
    problems: list[Problem] = []

    def work() -> None:
        try:
            registry = Registry()
            load = loader(registry, group.config, ALL_SECTIONS, shared_settings(group.folder / "evaluation"))
            do_group(load, registry, Place(group.folder), group.trials)
        except Stopped as stopped:
            problems.append(Problem(stopped.where, stopped=True))
        except MemoError as error:
            problems.append(Problem(str(error)))

    thread = threading.Thread(target=work, name="memo-trials")
    thread.start()
    thread.join()
    return problems[0] if problems else None


def on_joblib(groups: Sequence[Group], jobs: int, on_death: Callable[[str], None]) -> Iterator[Problem | None]:
    """What became of each group, as they end. Raises ``MemoError`` when workers die again and again."""
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    waiting, deaths = list(groups), 0
    while waiting:
        work = (delayed(_in_worker)(index, group) for index, group in enumerate(waiting))
        ended: set[int] = set()
        try:
            for index, problem in Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)(work):
                ended.add(index)
                yield problem
        except TerminatedWorkerError as error:
            deaths += 1
            if deaths >= MOST_DEATHS:
                raise WorkersDied(deaths, " ".join(str(error).split())[:200]) from None
            on_death("a worker process died; its trials are done again")
        waiting = [group for index, group in enumerate(waiting) if index not in ended]


def _in_worker(index: int, group: Group) -> tuple[int, Problem | None]:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    return index, do_here(group)


def on_ray(groups: Sequence[Group], address: str | None, on_death: Callable[[str], None]) -> Iterator[Problem | None]:
    """The same on a Ray cluster, which gives the groups of a dead node to the others. Raises ``MemoError``."""
    import ray

    began = not ray.is_initialized()
    if began:
        ray.init(address=address, log_to_driver=False, include_dashboard=False)
    try:
        task: Any = ray.remote(num_cpus=1, max_retries=MOST_DEATHS)(do_here)
        waiting = [task.remote(group) for group in groups]
        while waiting:
            ready, waiting = ray.wait(waiting, num_returns=1)
            for one in ready:
                try:
                    yield ray.get(one)
                except ray.exceptions.RayError as error:
                    raise WorkersDied(MOST_DEATHS, " ".join(str(error).split())[:200]) from None
    finally:
        if began:
            ray.shutdown()


@attrs.define(auto_exc=True, eq=False)
class WorkersDied(MemoError):
    """Workers of an evaluation died again and again; what is over is kept."""

    times: int
    problem: str

    def __str__(self) -> str:
        return f"workers died {self.times} times ({self.problem}); with less at once (--jobs) the same command goes on"
