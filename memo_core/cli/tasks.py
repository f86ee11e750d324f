"""``memo tasks``: lists and draws tasks, and verifies that each can be solved and is not solved by doing nothing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, load
from memo_core.cli.output import note, print_json, print_table
from memo_core.errors import InvalidArgument, UnknownName

if TYPE_CHECKING:
    from memo_core.config import Experiment
    from memo_core.interfaces.task import Task
    from memo_core.plugins.registry import Registry

app = typer.Typer(help="The tasks there are.")

MOST_SEEDS = 10_000

Suite = Annotated[str | None, typer.Option("--suite", metavar="NAME", help="Another suite than the experiment's.")]


@app.command("list")
def list_tasks(suite: Suite = None, config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """List the tasks of the suite."""
    from memo_core.interfaces.task import TASK_TYPES
    from memo_core.llm.measured import measured_of, summary
    from memo_core.runs.factories import tasks_of

    experiment = load(config, _with_suite(overrides, suite))[1]
    tasks, suite = tasks_of(experiment), experiment.choice("suite").backend.name
    model = experiment.choice("llm").backend
    measured = measured_of(model)
    if json:
        print_json(
            {"suite": suite, "tasks": [_summary(t) | {"suite": suite} | summary(measured, t.name) for t in tasks]}
        )
        return
    rows = [(t.name, t.kind, t.split, t.instruction, *summary(measured, t.name).values()) for t in tasks]
    reach = () if measured is None else (f"llm {model.name}",)
    print_table(("task", "type", "split", "instruction", *reach), rows)
    types = [f"{kind} {meaning}" for kind, meaning in TASK_TYPES.items() if any(t.kind == kind for t in tasks)]
    if types:
        note(f"types: {', '.join(types)}")
    if measured is not None:
        note(f"untaught, taught, no: what llm {model.name!r} did when it was measured, by")
        for done, command in measured.commands.items():
            note(f"  {done}: {command}")


@app.command()
def show(
    name: Annotated[str, typer.Argument(help="The task's name.")],
    seed: Annotated[int, typer.Option("--seed", min=0, help="Which scene of it.")] = 0,
    reference: Annotated[bool, typer.Option("--reference", help="Print its hand-written solution too.")] = False,
    prompt: Annotated[
        bool, typer.Option("--prompt", help="Print what the prompts say of its scene too, as first seen.")
    ] = False,
    suite: Suite = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Show one task: its instruction, what stands in its scene, what watches it."""
    from memo_core.environment.task_code import scene_of
    from memo_core.environment.task_environment import generator
    from memo_core.runs.factories import environment_of
    from memo_core.scene.scene_table import scene_table

    registry, experiment = load(config, _with_suite(overrides, suite))
    task, table = _task(registry, experiment, name), ""
    if prompt:
        with environment_of(experiment, task, seed) as world:
            table = scene_table(world.look())
    scene = scene_of(task, generator(seed, "scene"))
    bodies = [
        {"name": body.name, "label": body.label, "joint": type(body.joint).__name__.lower() if body.joint else "fixed"}
        for body, _ in scene.walk()
    ]
    monitors = [monitor.name for monitor in task.monitors()]
    if json:
        shown = _summary(task) | {"seed": seed, "bodies": bodies, "monitors": monitors, "time_limit_s": task.time_limit}
        more = ({"reference": task.reference_solution} if reference else {}) | ({"scene": table} if prompt else {})
        print_json(shown | more)
        return
    print(f"{task.name}: {task.instruction}")
    for sentence in task.goal:
        print(f"  done when {sentence}")
    print(f"type {task.kind or '-'}, split {task.split}, time limit {task.time_limit:g} s of the robot's time")
    print_table(("body", "label", "joint"), [(b["name"], b["label"], b["joint"]) for b in bodies])
    print(f"monitors: {', '.join(monitors) or 'none'}")
    if prompt:
        print(f"\n{table}")
    if reference:
        print(f"\n{task.reference_solution}")


@app.command()
def verify(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]…", help="Tasks; none: all.")] = None,
    seeds: Annotated[str, typer.Option("--seeds", metavar="A-B", help="Seeds, e.g. 0-19 or 3,5.")] = "0-19",
    jobs: Annotated[int, typer.Option("--jobs", "-j", min=1, help="Processes to use.")] = 1,
    plain: Annotated[
        bool, typer.Option("--plain", help="Also what one would try first, untaught, of tasks with a trick: must fail.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Keep each result as a JSON line; what is in it is not run again."),
    ] = None,
    suite: Suite = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Run each task's reference solution, and nothing at all, and let the success check judge both.

    Exit code 1 when a reference solution succeeds on fewer than 19 of 20 seeds, or anything else on any, when the
    simulated teacher cannot judge a sentence of the goal, or when robot, simulator or the task's code fails: such a
    trial counts for nothing. "x real time" is how many seconds are simulated in a second of one core's time, planning
    included. Named besides: a goal that the simulated teacher sees fulfilled at the start, sentences that it does not
    see fulfilled in a success, and things that move before the robot does or start inside the table.
    """
    from memo_core.cli import verification
    from memo_core.runs.factories import tasks_of

    wanted, overrides = read_seeds(seeds), _with_suite(overrides, suite)
    registry, experiment = load(config, overrides)
    tasks = [_task(registry, experiment, name) for name in names] if names else tasks_of(experiment)
    chosen = list(dict.fromkeys(task.name for task in tasks))
    trials = [
        verification.VerifiedTrial(config, tuple(overrides), name, seed, plain, out is not None)
        for name in chosen
        for seed in wanted
    ]
    log = verification.TrialLog(out, verification.digest_of(experiment))
    results = verification.run_trials(trials, jobs, log)
    report = [verification.report_of(name, [r for r in results if r["task"] == name]) for name in chosen]
    if json:
        print_json({"suite": experiment.choice("suite").backend.name, "tasks": report})
    else:
        rows = [
            (
                t["name"],
                f"{t['reference']}/{t['seeds']}",
                f"{t['null']}/{t['seeds']}",
                *([f"{t['plain'] or 0}/{t['plain_seeds']}"] if plain else []),
                t["wall_s"],
                t["real_time_factor"],
            )
            for t in report
        ]
        untaught = ("plain attempt",) if plain else ()
        print_table(("task", "reference", "nothing", *untaught, "seconds", "x real time"), rows)
        for task in report:
            for failure in task["failures"]:
                note(f"{task['name']}, seed {failure['seed']}: {failure['what']}: {failure['why']}")
        for task in report:
            for line in task["sunk"]:
                note(f"{task['name']}: {line}")
            for body, most in task["unsettled"].items():
                touches = f" (it touches {', '.join(map(repr, most['touches']))})" if most["touches"] else ""
                note(
                    f"{task['name']}, seed {most['seed']}: {body!r} moves by {1000 * most['m']:.1f} mm at the start, "
                    f"before the robot does{touches}: put it where it can stay"
                )
            if task["goal_at_start"]:
                note(f"{task['name']}: to the simulated teacher the whole goal is fulfilled at the start already")
            for line in task["goal_unseen"]:
                note(f"{task['name']}: the simulated teacher does not judge its goal: {line}")
            for line, where in task["goal_unmet"].items():
                note(
                    f"{task['name']}: to the simulated teacher {line} where the success check says done "
                    f"({len(where)} of {task['reference']} seeds, first {where[0]})"
                )
        faults = ("goal_unseen", "goal_unmet", "goal_at_start", "not_carried_out")
        if not any(task[fault] for task in report for fault in faults):
            done = all(task["reference"] for task in report)
            note("goals: the simulated teacher understands each sentence" + done * " and sees it fulfilled at the end")
    if not all(verification.holds(task) for task in report):
        raise typer.Exit(1)


@app.command()
def pictures(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]…", help="Tasks; none: all.")] = None,
    folder: Annotated[Path, typer.Option("--folder", "-f", help="Where the pictures go.", metavar="DIR")] = Path("."),
    seed: Annotated[int, typer.Option("--seed", min=0, help="Which scene of each.")] = 0,
    camera: Annotated[str, typer.Option("--camera", help="Whose view; a task without it: its first.")] = "front",
    width: Annotated[int, typer.Option("--width", min=64, max=1920, help="Pixels; 4:3.")] = 480,
    suite: Suite = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Draw each task at its start and where its reference solution ends: NAME-start.jpg and NAME-end.jpg.

    Exit code 1 when a reference solution did not succeed; its picture is drawn all the same.
    """
    from memo_core.cli.pictures import draw
    from memo_core.runs.factories import tasks_of

    registry, experiment = load(config, _with_suite(overrides, suite))
    chosen = [_task(registry, experiment, name) for name in dict.fromkeys(names)] if names else tasks_of(experiment)
    drawn = list(draw(experiment, chosen, folder, seed, camera, width))
    if json:
        print_json({"pictures": drawn})
    else:
        print_table(("task", "start", "end", "done"), [(d["task"], d["start"], d["end"], d["success"]) for d in drawn])
        for found in drawn:
            if not found["success"]:
                note(f"{found['task']}: {found['why']}")
    if not all(found["success"] for found in drawn):
        raise typer.Exit(1)


def read_seeds(text: str) -> tuple[int, ...]:
    """``0-19``, ``7`` or ``1,4-6``; ten thousand at most. Raises ``InvalidArgument``."""
    seeds: list[int] = []
    for part in text.split(","):
        first, dash, last = part.strip().partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()) or (dash and int(last) < int(first)):
            raise InvalidArgument("--seeds", f"{text!r} cannot be read", "seeds such as 0-19 or 3,5")
        if len(seeds) + int(last or first) - int(first) >= MOST_SEEDS:
            raise InvalidArgument("--seeds", f"{text!r} are too many", f"at most {MOST_SEEDS}")
        seeds += range(int(first), int(last or first) + 1)
    return tuple(dict.fromkeys(seeds))


def _task(registry: Registry, experiment: Experiment, name: str) -> Task:
    """One task by name. Raises ``InvalidArgument``, which names the suite that has it if another one does."""
    from memo_core.config.experiment import unknown_task
    from memo_core.runs.factories import task_of, tasks_of

    try:
        return task_of(experiment, name)
    except UnknownName:
        names = tuple(task.name for task in tasks_of(experiment))
        said = unknown_task(registry, experiment.choice("suite").backend.name, name, names)
        raise InvalidArgument("NAME", said) from None


def _with_suite(overrides: list[str] | None, suite: str | None) -> list[str]:
    from memo_core.config.layers import FromOption

    return [*(overrides or ()), *([FromOption(f"suite.backend={suite}", "--suite")] if suite else ())]


def _summary(task: Any) -> dict[str, Any]:
    told = {"name": task.name, "instruction": task.instruction, "goal": list(task.goal)}
    return told | {"type": task.kind, "split": task.split}
