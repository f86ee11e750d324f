"""Work of an experiment in several processes of this machine, those of joblib's loky."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import TypeVar

import attrs

from memo_core.errors import MemoError
from memo_core.process.stop_switch import StopSwitch

Item = TypeVar("Item")
Result = TypeVar("Result")

MOST_DEATHS = 5  # of workers, before it is given up
POLL_S = 0.2
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")  # of each worker's numerical libraries


@attrs.define(auto_exc=True, eq=False)
class WorkersDied(MemoError):
    """Worker processes died again and again; what is over is kept."""

    times: int
    problem: str

    def __str__(self) -> str:
        return f"workers died {self.times} times ({self.problem}); with less at once (--jobs) the same command goes on"


def in_processes(
    do: Callable[[Item], Result],
    items: Sequence[Item],
    jobs: int,
    stop: StopSwitch,
    on_death: Callable[[str], None],
    most_deaths: int = MOST_DEATHS,
) -> Iterator[Result]:
    """The results as they come, of ``jobs`` at once. What a worker that died was at is done again; on a stop all are
    killed and nothing more comes. Raises ``WorkersDied``."""
    from joblib import cpu_count
    from joblib.externals.loky import get_reusable_executor
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    threads = {name: str(max(cpu_count() // jobs, 1)) for name in _THREADS}
    waiting, deaths = list(items), 0
    while waiting:
        pool = get_reusable_executor(max_workers=jobs, env=threads, initializer=_begin_worker, initargs=(os.getpid(),))
        under_way: dict[Future[Result], Item] = {}
        try:
            while waiting or under_way:
                while (
                    waiting and len(under_way) < jobs
                ):  # loky's queue stays empty: killing what is in it is no clean end
                    item = waiting.pop(0)
                    under_way[pool.submit(do, item)] = item
                for future in wait(under_way, POLL_S, FIRST_COMPLETED).done:
                    result = future.result()
                    del under_way[future]
                    yield result
                if stop.pressed:
                    return
        except TerminatedWorkerError as error:
            deaths += 1
            if deaths >= most_deaths:
                raise WorkersDied(deaths, " ".join(str(error).split())[:200]) from None
            on_death("a worker process died; what it was at is done again")
        finally:
            if under_way:  # stopped, or whoever asked wants no more
                pool.shutdown(kill_workers=True)
        waiting = [*under_way.values(), *waiting]


def _begin_worker(parent: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that waits
    threading.Thread(target=_end_with, args=(parent,), name="memo-parent", daemon=True).start()


def _end_with(parent: int) -> None:
    """End this process once its parent was killed: the same command may be given again meanwhile, and two processes
    may not work at one run."""
    while os.getppid() == parent:
        time.sleep(POLL_S)
    os._exit(1)
