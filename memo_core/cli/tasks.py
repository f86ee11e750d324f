"""``memo tasks``: what there is to do, and proof that it can be done and does not do itself."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Annotated, Any

import attrs
import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, load
from memo_core.cli.output import note, print_json, print_table
from memo_core.errors import InvalidArgument

app = typer.Typer(help="The tasks there are.")

SHARE_REQUIRED = 0.95  # of the seeds, for reference solutions


@app.command("list")
def list_tasks(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """List the tasks of the suite."""
    from memo_core.experiment.assembly import tasks_of

    tasks = tasks_of(load(config, overrides)[1])
    if json:
        print_json({"tasks": [_summary(task) for task in tasks]})
    else:
        print_table(("task", "kind", "split", "instruction"), [(t.name, t.kind, t.split, t.instruction) for t in tasks])


@app.command()
def show(
    name: Annotated[str, typer.Argument(help="The task's name.")],
    seed: Annotated[int, typer.Option("--seed", min=0, help="Which scene of it.")] = 0,
    reference: Annotated[bool, typer.Option("--reference", help="Print its hand-written solution too.")] = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Show one task: its instruction, what stands in its scene, what watches it."""
    from memo_core.experiment.assembly import task_of
    from memo_core.experiment.world import generator

    task = task_of(load(config, overrides)[1], name)
    scene = task.scene(generator(seed, "scene"))
    bodies = [
        {"name": body.name, "label": body.label, "joint": type(body.joint).__name__.lower() if body.joint else "fixed"}
        for body, _ in scene.walk()
    ]
    monitors = [monitor.name for monitor in task.monitors()]
    if json:
        shown = _summary(task) | {"seed": seed, "bodies": bodies, "monitors": monitors, "time_limit_s": task.time_limit}
        print_json(shown | ({"reference": task.reference_solution} if reference else {}))
        return
    print(f"{task.name}: {task.instruction}")
    print(f"kind {task.kind or '-'}, split {task.split}, time limit {task.time_limit:g} s of the robot's time")
    print_table(("body", "label", "joint"), [(b["name"], b["label"], b["joint"]) for b in bodies])
    print(f"monitors: {', '.join(monitors) or 'none'}")
    if reference:
        print(f"\n{task.reference_solution}")


@app.command()
def verify(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]…", help="Tasks; none: all.")] = None,
    seeds: Annotated[str, typer.Option("--seeds", metavar="A-B", help="Seeds, e.g. 0-19 or 3,5.")] = "0-19",
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Processes to use.")] = 1,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Run each task's reference solution, and nothing at all, and let the success check judge both.

    Exit code 1 when a reference solution succeeds on fewer than 19 of 20 seeds, or doing nothing on any.
    """
    from memo_core.experiment.assembly import task_of, tasks_of

    wanted = read_seeds(seeds)
    _, experiment = load(config, overrides)
    chosen = [task_of(experiment, name).name for name in names] if names else [t.name for t in tasks_of(experiment)]
    trials = [Trial(config, tuple(overrides or ()), name, seed) for name in dict.fromkeys(chosen) for seed in wanted]
    results = _with_progress(trials, jobs)
    report = [_report(name, [r for r in results if r["task"] == name]) for name in dict.fromkeys(chosen)]
    if json:
        print_json({"tasks": report})
    else:
        rows = [(t["name"], f"{t['reference']}/{t['seeds']}", f"{t['null']}/{t['seeds']}", t["wall_s"]) for t in report]
        print_table(("task", "reference", "nothing", "seconds"), rows)
        for task in report:
            for failure in task["failures"]:
                note(f"{task['name']}, seed {failure['seed']}: {failure['what']}: {failure['why']}")
    if any(t["reference"] < SHARE_REQUIRED * t["seeds"] or t["null"] for t in report):
        raise typer.Exit(1)


@attrs.frozen
class Trial:
    """One task on one seed; travels to another process."""

    config: Path | None
    overrides: tuple[str, ...]
    task: str
    seed: int


def read_seeds(text: str) -> tuple[int, ...]:
    """``0-19``, ``7`` or ``1,4-6``. Raises ``InvalidArgument``."""
    seeds: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()) or (dash and int(last) < int(first)):
            raise InvalidArgument("--seeds", f"{text!r} cannot be read", "seeds such as 0-19 or 3,5")
        seeds += range(int(first), int(last or first) + 1)
    return tuple(dict.fromkeys(seeds))


def run_trial(trial: Trial) -> dict[str, Any]:
    """Verify one task on one seed (also the entry of a worker process)."""
    from memo_core.experiment.assembly import sandbox_of, task_of, world_of
    from memo_core.experiment.world import verify_task

    started = time.monotonic()
    _, experiment = load(trial.config, list(trial.overrides))
    task = task_of(experiment, trial.task)
    [found] = verify_task(lambda seed: world_of(experiment, task, seed), lambda: sandbox_of(experiment), [trial.seed])
    return {
        "task": trial.task,
        "seed": trial.seed,
        "reference": found.reference.success,
        "reference_why": found.error or found.reference.reason,
        "null": found.null.success,
        "null_why": found.null.reason,
        "wall_s": time.monotonic() - started,
        "sim_s": found.sim_s,
    }


def _with_progress(trials: list[Trial], jobs: int) -> list[dict[str, Any]]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        bar = progress.add_task("verifying", total=len(trials))
        results = []
        for result in _run(
            trials, jobs, lambda trial: progress.update(bar, description=f"{trial.task}, seed {trial.seed}")
        ):
            results.append(result)
            progress.advance(bar)
    return results


def _run(trials: list[Trial], jobs: int, began: Callable[[Trial], None]) -> Iterable[dict[str, Any]]:
    if jobs == 1:
        for trial in trials:
            began(trial)
            yield run_trial(trial)
        return
    # A fresh interpreter each: rendering contexts and solver threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_leave_interrupts_to_the_parent) as pool:
        waiting = {pool.submit(run_trial, trial): trial for trial in trials}
        try:
            for done in as_completed(waiting):
                began(waiting[done])
                yield done.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in multiprocessing.active_children():
                child.terminate()
            raise


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _report(name: str, results: list[dict[str, Any]]) -> dict[str, Any]:
    results = sorted(results, key=lambda result: result["seed"])
    failures = [
        {"seed": r["seed"], "what": "reference solution failed", "why": r["reference_why"]}
        for r in results
        if not r["reference"]
    ]
    failures += [
        {"seed": r["seed"], "what": "doing nothing succeeded", "why": r["null_why"]} for r in results if r["null"]
    ]
    return {
        "name": name,
        "seeds": len(results),
        "reference": sum(r["reference"] for r in results),
        "null": sum(r["null"] for r in results),
        "wall_s": round(sum(r["wall_s"] for r in results), 2),
        "sim_s": round(sum(r["sim_s"] for r in results), 2),
        "failures": failures,
    }


def _summary(task: Any) -> dict[str, Any]:
    return {"name": task.name, "instruction": task.instruction, "kind": task.kind, "split": task.split}
