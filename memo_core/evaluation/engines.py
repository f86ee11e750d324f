"""Doing groups of trials at once: in processes of this machine (joblib), or on a cluster (Ray) whose nodes share the
experiment's folder.

A group leaves a file for each trial that is over, so nothing is lost with a worker that is killed: its group is done
again, and what is over is passed over."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from functools import lru_cache
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import MemoError, Stopped
from memo_core.evaluation.grid import Trial
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.evaluation.trial import Place, do_group
from memo_core.plugins.registry import Registry
from memo_core.process.signal_safe import Wake
from memo_core.process.stop_switch import StopSwitch
from memo_core.process.worker_processes import MOST_DEATHS, POLL_S, WorkersDied, in_processes
from memo_core.runs.run_errors import UNEXPECTED, RunError
from memo_core.study.participants import Load
from memo_core.study.study import loader, shared_settings


@attrs.frozen
class Group:
    """What a worker gets: plain values, so that it can be another machine's."""

    folder: Path
    config: Path
    trials: tuple[Trial, ...]


@attrs.frozen
class GroupResult:
    """The outcome of a group: of each trial that was tried, in order, the error by which it could not be carried out;
    and what kept the group from its end, if something did (``stopped``: a person or a limit)."""

    errors: tuple[RunError | None, ...] = ()
    problem: str = ""
    stopped: bool = False


def do_here(group: Group, stop: StopSwitch | None = None) -> GroupResult:
    """Do a group in this process, in a thread that is not the main one: Ctrl-C is for the process that waits. On a stop
    the thread is abandoned, and the run that it is at is cut off like that of a killed process."""
    over, errors = Wake(), list[RunError | None]()
    results: list[GroupResult] = []

    def work() -> None:
        try:
            registry, load = _loaded(group.folder, group.config, group.config.stat().st_mtime_ns)
            do_group(load, registry, Place(group.folder), group.trials, errors.append)
            results.append(GroupResult(tuple(errors)))
        except Stopped as stopped:
            results.append(GroupResult(tuple(errors), stopped.where, stopped=True))
        except MemoError as error:
            results.append(GroupResult(tuple(errors), str(error)))
        except Exception as error:  # a bug, in MEMO or in a plugin: the other groups go on
            traceback.print_exc()
            said = f"unexpected {type(error).__name__}: {' '.join(str(error).split())}"
            results.append(GroupResult((*errors, RunError(UNEXPECTED, said)), said))
        finally:
            over.set()

    thread = threading.Thread(target=work, name="memo-trials", daemon=True)
    with stop.waking(over.set) if stop is not None else nullcontext():
        thread.start()
        over.wait()
    if stop is None or not stop.pressed:
        thread.join()
    return results[0] if results else GroupResult(tuple(errors), "it was given up", stopped=True)


@lru_cache(maxsize=1)
def _loaded(folder: Path, config: Path, changed: int) -> tuple[Registry, Load]:
    """What all groups of an evaluation share. ``changed``: when the configuration was written."""
    registry = Registry()
    return registry, loader(registry, config, ALL_SECTIONS, shared_settings(folder / "evaluation"))


def on_joblib(
    groups: Sequence[Group], jobs: int, stop: StopSwitch, on_death: Callable[[str], None]
) -> Iterator[GroupResult]:
    """What became of each group, as they end, in processes of this machine. Raises ``WorkersDied``."""
    return in_processes(do_here, groups, jobs, stop, on_death)


def on_ray(groups: Sequence[Group], address: str | None, stop: StopSwitch) -> Iterator[GroupResult]:
    """The same on a Ray cluster, which gives the groups of a dead node to the others. Raises ``MemoError``."""
    import ray

    began = not ray.is_initialized()
    if began:
        ray.init(address=address, log_to_driver=False, include_dashboard=False)
    try:
        task: Any = ray.remote(num_cpus=1, max_retries=MOST_DEATHS)(do_here)
        waiting = [task.remote(group) for group in groups]
        while waiting:
            ready, waiting = ray.wait(waiting, num_returns=1, timeout=POLL_S)
            if stop.pressed:
                for one in waiting:
                    ray.cancel(one, force=True)
                return
            for one in ready:
                try:
                    yield ray.get(one)
                except ray.exceptions.RayError as error:
                    raise WorkersDied(MOST_DEATHS, " ".join(str(error).split())[:200]) from None
    finally:
        if began:
            ray.shutdown()
