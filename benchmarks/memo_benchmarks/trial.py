"""Trials a minute, on one core and on two, and where the time of a trial goes (``memo bench trial``).

A trial is one of an evaluation: a held-out task with an empty book, nobody watching, in a folder of its own. Where the
time goes is sampled: every few milliseconds the innermost function of ours that is at work."""

from __future__ import annotations

import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

from memo_core.environment.task_environment import generator
from memo_core.evaluation.grid import Trial
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.evaluation.trial import Place, do_group
from memo_core.interfaces.task import Task
from memo_core.plugins.registry import Registry
from memo_core.runs.run_errors import Halted, RunError
from memo_core.study.participants import Load
from memo_core.study.study import loader

SAMPLE_S = 0.004
POLICY_THREAD = "memo-policy"
WORKING_THREADS = ("memo-moving", "memo-retrieval")
# Part of a file's path -> what a thread that is in there does. The first that fits counts.
PLACES = (
    ("memo_sim_", "physics"),
    ("memo_core/arm/", "planning and control"),
    ("memo_core/scene/mechanism", "physics"),
    ("memo_tabletop/", "monitors"),
    ("memo_perception/", "perception"),
    ("memo_core/environment/", "perception"),
    ("memo_core/scene/", "perception"),
    ("memo_llm/", "language model"),
    ("memo_offline/", "language model"),
    ("memo_core/llm/", "language model"),
    ("memo_core/skillbook/", "skillbook"),
    ("memo_embedder/", "skillbook"),
    ("memo_vectorstore/", "skillbook"),
    ("memo_core/sandbox/", "sandbox"),
    ("memo_core/runlog/", "log and folder"),
    ("memo_core/runs/", "log and folder"),
    ("memo_core/policy/", "the loop"),
)
MOTION = ("physics", "planning and control")


def place_of(frame: FrameType | None) -> str:
    """What a thread does, by the innermost function of ours that it is in."""
    while frame is not None:
        file = frame.f_code.co_filename.replace("\\", "/")
        for part, place in PLACES:
            if part in file:
                return place
        frame = frame.f_back
    return "elsewhere"


class Sampler:
    """Counts where the policy's thread is while the block runs, or the thread that it waits for; ``shares`` when it is
    over. What the thread that prepares and closes a run does counts as ``start and end``."""

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)

    def __enter__(self) -> Sampler:
        self._thread.start()
        return self

    def __exit__(self, *_: Any) -> None:
        self._over.set()
        self._thread.join()

    def _sample(self) -> None:
        while not self._over.wait(SAMPLE_S):
            idents = {one.name: one.ident for one in threading.enumerate() if one.ident is not None}
            frames = sys._current_frames()
            # Programs and retrievals run in threads of their own, for which the policy's waits.
            at_work = next((idents[name] for name in (*WORKING_THREADS, POLICY_THREAD) if name in idents), None)
            self.counts["start and end" if at_work is None else place_of(frames.get(at_work))] += 1

    @property
    def shares(self) -> dict[str, float]:
        total = sum(self.counts.values())
        return {place: round(count / total, 3) for place, count in self.counts.most_common()} if total else {}


def bench_trial(
    config: Path | None,
    overrides: tuple[str, ...],
    tasks: tuple[str, ...],
    scenes: int,
    progress: Callable[[float], None] = lambda share: None,
) -> dict[str, Any]:
    """Each task in so many scenes, one after the other, then all again in two processes. Raises ``MemoError``."""
    trials = [Trial("memo", task, scene) for task in tasks for scene in range(scenes)]
    with tempfile.TemporaryDirectory(prefix="memo-bench-trial-") as folder:
        load, registry = _load(config, overrides), Registry()
        do_group(
            load, registry, Place(Path(folder) / "warm"), trials[:1], _carried_out
        )  # imports, tables, the first scene
        with Sampler() as sampler:
            started, cpu = time.monotonic(), time.process_time()
            for done, trial in enumerate(trials):
                do_group(load, registry, Place(Path(folder) / "one"), [trial], _carried_out)
                progress((done + 1) / (2 * len(trials)))
            one_s, cpu_s = time.monotonic() - started, time.process_time() - cpu
        two_s = _in_two(config, overrides, trials, Path(folder))
        progress(1.0)
    shares = sampler.shares
    return {
        "bench": "trial",
        "trials": len(trials),
        "trials_a_minute_one_core": round(60 * len(trials) / one_s, 2),
        "trials_a_minute_two_cores": round(60 * len(trials) / two_s, 2),
        "trials_a_processor_hour": round(3600 * len(trials) / cpu_s),
        "share_without_physics_and_planning": round(1 - sum(shares.get(place, 0.0) for place in MOTION), 3),
        "shares": shares,
    }


def has_grains(task: Task) -> bool:
    """Whether there is something to pour in the task's scenes: many free bodies are slow."""
    return any(body.heap for body, _ in task.scene(generator(0, "scene")).walk())


def _in_two(config: Path | None, overrides: tuple[str, ...], trials: list[Trial], folder: Path) -> float:
    """Seconds that two processes take, without the time in which they start."""
    from joblib import Parallel, delayed

    with Parallel(n_jobs=2, batch_size=1) as workers:
        workers(delayed(_done)(config, overrides, trials[:1], folder / f"warm-{number}") for number in range(2))
        started = time.monotonic()
        workers(delayed(_done)(config, overrides, [trial], folder / "two") for trial in trials)
        return time.monotonic() - started


def _done(config: Path | None, overrides: tuple[str, ...], trials: list[Trial], folder: Path) -> None:
    do_group(_load(config, overrides), Registry(), Place(folder), trials, _carried_out)


def _carried_out(error: RunError | None) -> None:
    """A trial that could not be carried out took no time that means anything. Raises ``Halted``."""
    if error is not None:
        raise Halted("trials", error)


def _load(config: Path | None, overrides: tuple[str, ...]) -> Load:
    return loader(Registry(), config, ALL_SECTIONS, [*overrides, "evaluation.reuse=false"])
