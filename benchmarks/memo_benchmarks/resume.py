"""Runs killed (``kill -9``) at random moments and resumed, against the same runs left alone (``memo bench resume``).

A run is killed one to three times, each time at a random moment after a random line of its log, and resumed to its end.
Outcome, book and tokens must be those of the run that was left alone.
"""

from __future__ import annotations

import random
import shutil
import tempfile
from collections.abc import Callable, Iterator
from multiprocessing.context import ForkServerContext
from pathlib import Path
from typing import Any

import attrs

from memo_benchmarks.disturbed_runs import (
    MODELS,
    Disturbed,
    at_random_moment,
    begun,
    came_to,
    log_of,
    part,
    server,
    unpaid_or_twice,
)

_MOST_KILLS = 3  # of one run


@attrs.frozen
class Killed:
    """A run that was killed ``kills`` times, and in what it differs from the one that was left alone."""

    model: str
    kills: int
    faults: tuple[str, ...]


def bench_resume(kills: int, seed: int = 0, progress: Callable[[float], None] | None = None) -> dict[str, Any]:
    """Kill runs ``kills`` times altogether. ``kept`` says that none of them had a fault."""
    rng, forks = random.Random(seed), server()
    done: list[Killed] = []
    with tempfile.TemporaryDirectory(prefix="memo-bench-") as place:
        whole = {model: _left_alone(forks, Path(place) / model, model, seed) for model in MODELS}
        while (count := sum(run.kills for run in done)) < kills:
            model = MODELS[-1 if len(done) % 4 else 0]  # the scripted one takes less time
            most = min(_MOST_KILLS, kills - count)
            done.append(_killed(forks, Path(place) / f"killed-{len(done)}", model, seed, whole[model], most, rng))
            if progress is not None:
                progress(sum(run.kills for run in done) / kills)
        runs = {
            model: {"lines of the log": lines, "tokens": came["tokens"], "subtasks": len(came["subtasks"])}
            for model, (came, lines) in whole.items()
        }
    faults = [f"{run.model}, {run.kills} kills: {fault}" for run in done for fault in run.faults]
    return {
        "left alone": runs,
        "runs": len(done),
        "kills": count,
        "faults": faults,
        "kept": count == kills and not faults,
    }


def _left_alone(forks: ForkServerContext, folder: Path, model: str, seed: int) -> tuple[dict[str, Any], int]:
    process = Disturbed.start(forks, folder, part, folder, folder, model, seed, False)
    if process.wait():
        raise RuntimeError(f"the {model} run that is left alone failed: {process.said[-2000:]}")
    return came_to(folder), log_of(folder).read_bytes().count(b"\n")


def _killed(
    forks: ForkServerContext,
    folder: Path,
    model: str,
    seed: int,
    whole: tuple[dict[str, Any], int],
    most: int,
    rng: random.Random,
) -> Killed:
    wanted, lines = whole
    kills = 0
    while kills < most:
        process = Disturbed.start(forks, folder, part, folder, folder, model, seed, begun(folder))
        at_random_moment(process, log_of(folder), lines, rng)
        if not process.kill():
            break
        kills += 1
        if not begun(folder):
            shutil.rmtree(folder)  # nothing had happened yet
    faults = list(_to_its_end(forks, folder, model, seed, wanted, kills))
    if not faults:
        shutil.rmtree(folder)
    return Killed(model, kills, tuple(faults))


def _to_its_end(
    forks: ForkServerContext, folder: Path, model: str, seed: int, wanted: dict[str, Any], kills: int
) -> Iterator[str]:
    if not (folder / "run" / "summary.json").exists():
        process = Disturbed.start(forks, folder, part, folder, folder, model, seed, begun(folder))
        if (code := process.wait()) != 0:
            yield f"resumed it ended with {code}: {process.said[-500:]}"
            return
    came = came_to(folder)
    for name, value in wanted.items():
        if came[name] != value:
            yield f"{name}: {came[name]!r}, left alone {value!r}"[:2000]
    yield from unpaid_or_twice(folder, kills)
