"""The simulated teacher's verdicts against the success checks: who watches reference solutions, plain attempts and a
robot that does nothing.

The teacher is shown what it is shown in a run: the scene before and after and what was visible in between. The success
check is asked afterwards and never shown to it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.environment.task_verification import run_code
from memo_core.errors import UnknownName
from memo_core.interfaces.teacher import TaskEpisode, Teacher, Verdict
from memo_core.sandbox.sandbox import Sandbox

BEHAVIOURS = ("reference", "plain", "nothing")
AGREEMENT = {
    ("approve", True): "agrees",
    ("correct", False): "agrees",
    ("approve", False): "approved a failure",
    ("correct", True): "found fault with a success",
    ("silent", True): "said nothing",
    ("silent", False): "said nothing",
}


@attrs.frozen(eq=False)
class Watched:
    """One behaviour in one scene: what could be seen, and what the success check says of it."""

    task: str
    seed: int
    behaviour: str
    episode: TaskEpisode
    success: bool
    reason: str
    error: str = ""  # how the code ended, if not at its end


@attrs.frozen
class Judged:
    """What the teacher said of a behaviour, beside the success check."""

    task: str
    seed: int
    behaviour: str
    success: bool
    reason: str
    verdict: str
    words: str
    agreement: str


def watch(environment: SimulatedEnvironment, make_sandbox: Callable[[], Sandbox]) -> Iterator[Watched]:
    """The behaviours of an opened environment's task, each from its start."""
    codes = {"reference": environment.task.reference_solution, "plain": environment.task.plain_attempt, "nothing": None}
    start = environment.checkpoint()
    for behaviour in BEHAVIOURS:
        code = codes[behaviour]
        if code == "":
            continue
        environment.restore(start)
        before = environment.glance()
        environment.start_watching()
        error = ""
        try:
            if code is None:
                environment.settle(environment.task.settle)
            else:
                with make_sandbox() as sandbox:
                    error = run_code(environment, code, sandbox).error
        finally:
            seen = environment.stop_watching()
        episode = TaskEpisode(environment.instruction, before, environment.glance(), environment.goal, (), seen)
        outcome = environment.check()
        yield Watched(
            environment.task.name, environment.seed, behaviour, episode, outcome.success, outcome.reason, error
        )


def judge(watched: Watched, teacher: Teacher) -> Judged:
    """The verdict of an opened teacher on the whole task."""
    verdict: Verdict = teacher.judge_task(watched.episode)
    return Judged(
        task=watched.task,
        seed=watched.seed,
        behaviour=watched.behaviour,
        success=watched.success,
        reason=watched.reason,
        verdict=verdict.kind,
        words=verdict.words,
        agreement=AGREEMENT[verdict.kind, watched.success],
    )


@attrs.frozen
class VerdictTable:
    """One row a behaviour, and how often the teacher and the success check agreed."""

    rows: tuple[dict[str, Any], ...]
    counts: dict[str, int]


def bench_teacher(experiments: Sequence[Experiment], names: Sequence[str], seeds: Sequence[int]) -> VerdictTable:
    """The teacher of each experiment on its suite's tasks; without ``names`` all. Raises ``UnknownName`` for a task
    that no suite has."""
    from memo_core.runs.factories import environment_of, sandbox_of, tasks_of

    suites = [(experiment, tasks_of(experiment)) for experiment in experiments]
    known = {task.name for _, tasks in suites for task in tasks}
    for name in names:
        if name not in known:
            raise UnknownName("task", name, tuple(sorted(known)))
    rows = []
    for experiment, tasks in suites:
        for task in tasks:
            for seed in seeds if not names or task.name in names else ():
                teacher: Teacher = experiment.create("teacher")
                teacher.open()
                with environment_of(experiment, task, seed) as environment:
                    for watched in watch(environment, partial(sandbox_of, experiment)):
                        rows.append(attrs.asdict(judge(watched, teacher)))
                teacher.close()
    return VerdictTable(tuple(rows), dict(Counter(row["agreement"] for row in rows)))
