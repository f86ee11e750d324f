"""Running the benchmark: looks compared with the truth, and reference solutions with these eyes. What was done is kept
in a folder, one line of JSON each, and not done again."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import attrs
import cattrs
import numpy as np

from memo_benchmarks.perception.comparing import Comparison, compare
from memo_benchmarks.perception.scenes import seen_by
from memo_core.config import Experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.environment.task_environment import generator
from memo_core.environment.task_verification import run_code
from memo_core.interfaces.perception import Ask, PerceptionContext
from memo_core.interfaces.task import Task
from memo_core.runs.factories import environment_of, sandbox_of
from memo_core.scene.graph import SceneGraph


@attrs.frozen
class Looked:
    """One look of one variant: ``when`` is "start", "ajar" (doors open by chance) or "end" (after the solution)."""

    variant: str
    task: str
    seed: int
    when: str
    cpu_s: float
    comparison: Comparison


@attrs.frozen
class Solved:
    """A reference solution with these eyes."""

    variant: str
    task: str
    seed: int
    success: bool
    why: str
    looks: int
    cpu_s_a_look: float
    cpu_s: float | None = None  # of the whole case with its processes; None in results of before it was measured


class Kept:
    """Results in a file, one a line. A line that a kill left unfinished is dropped."""

    def __init__(self, file: Path, kind: type) -> None:
        self._file, self._kind = file, kind
        self.rows: list[Any] = []
        if file.is_file():
            for line in file.read_text(encoding="utf-8").splitlines():
                try:
                    self.rows.append(cattrs.structure(json.loads(line), kind))
                except (ValueError, KeyError, cattrs.BaseValidationError):
                    continue

    def add(self, row: Any) -> None:
        self.rows.append(row)
        self._file.parent.mkdir(parents=True, exist_ok=True)
        with self._file.open("a", encoding="utf-8") as file:
            file.write(json.dumps(cattrs.unstructure(row)) + "\n")


def looks(
    truth: Experiment,
    variants: dict[str, Experiment],
    tasks: Sequence[Task],
    seeds: Sequence[int],
    when: Sequence[str],
    cameras: int,
    out: Path,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Looked]:
    """Every task and seed at each moment, by every variant. ``truth``: an experiment whose perception is the truth."""
    kept = Kept(out / "looks.jsonl", Looked)
    wanted = {(v, t.name, s, w) for v in variants for t in tasks for s in seeds for w in when}
    done = {(row.variant, row.task, row.seed, row.when): row for row in kept.rows}
    for number, task in enumerate(tasks):
        for seed in seeds:
            for moment in when:
                left = {v: e for v, e in variants.items() if (v, task.name, seed, moment) not in done}
                if left and (moment != "end" or task.reference_solution):
                    for row in _look(truth, left, task, seed, moment, cameras):
                        kept.add(row)
                        done[row.variant, row.task, row.seed, row.when] = row
        progress((number + 1) / len(tasks))
    return [row for key, row in done.items() if key in wanted]


def _look(
    truth: Experiment, variants: dict[str, Experiment], task: Task, seed: int, when: str, cameras: int
) -> Iterator[Looked]:
    doors = generator(seed, f"doors of {task.name}") if when == "ajar" else None
    with environment_of(truth, seen_by(task, cameras, doors=doors), seed) as world:
        if when == "end":
            with sandbox_of(truth) as sandbox:
                run_code(world, task.reference_solution, sandbox)
        right = world.perception.glance()
        for variant, experiment in variants.items():
            seen, cpu_s, _ = timed_look(experiment, world, seed)
            yield Looked(variant, task.name, seed, when, cpu_s, compare(seen, right, world.description))


def timed_look(
    experiment: Experiment, world: SimulatedEnvironment, seed: int, ask: Ask | None = None
) -> tuple[SceneGraph, float, Any]:
    """One look with the experiment's perception, which may ``ask`` a model: the graph, CPU time (s), and the closed
    perception."""
    eyes = experiment.create("perception")
    eyes.open()
    try:
        if ask is not None:
            eyes.use_model(ask)
        eyes.start(_context(world, seed))
        began = time.process_time()
        return eyes.look(), round(time.process_time() - began, 3), eyes
    finally:
        eyes.close()


def _context(world: SimulatedEnvironment, seed: int) -> PerceptionContext:
    rng = np.random.default_rng([seed, *b"eyes"])
    return PerceptionContext(rng, world.robot, world.link, world.control.tool_pose, world.simulator, world.description)


def solutions(
    variants: dict[str, Experiment],
    tasks: Sequence[Task],
    seeds: Sequence[int],
    cameras: int,
    wrist: bool,
    out: Path,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Solved]:
    """Every task's reference solution on every seed with every variant's eyes, judged by the task's own check."""
    kept = Kept(out / "solutions.jsonl", Solved)
    done = {(row.variant, row.task, row.seed): row for row in kept.rows}
    wanted = [(v, t, s) for s in seeds for t in tasks for v in variants if t.reference_solution]
    for number, (variant, task, seed) in enumerate(wanted):
        if (variant, task.name, seed) not in done:
            row = _solve(variant, variants[variant], task, seed, cameras, wrist)
            kept.add(row)
            done[variant, task.name, seed] = row
        progress((number + 1) / len(wanted))
    return [done[variant, task.name, seed] for variant, task, seed in wanted]


def _solve(variant: str, experiment: Experiment, task: Task, seed: int, cameras: int, wrist: bool) -> Solved:
    before = sum(os.times()[:4])
    robot = experiment.create("robot") if wrist else None
    world = environment_of(experiment, seen_by(task, cameras, robot), seed)
    times: list[float] = []
    look = world.perception.look

    def timed() -> Any:
        began = time.process_time()
        try:
            return look()
        finally:
            times.append(time.process_time() - began)

    world.perception.look = timed  # type: ignore[method-assign]
    with world, sandbox_of(experiment) as sandbox:
        ended = run_code(world, task.reference_solution, sandbox)
        outcome = world.check()
    why = "; ".join(part for part in (outcome.reason, ended.error) if part)
    a_look = round(sum(times) / max(1, len(times)), 3)
    cpu_s = round(sum(os.times()[:4]) - before, 1)
    return Solved(variant, task.name, seed, outcome.success, why[:300], len(times), a_look, cpu_s)
