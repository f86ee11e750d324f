"""``memo bench``: what MEMO promises about speed, measured on this machine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_benchmarks import durability_commands
from memo_benchmarks.perception.command import perception
from memo_benchmarks.reporting import print_report, with_progress
from memo_core.cli.options import ConfigFile, Json, Overrides, load
from memo_core.cli.output import print_json, print_table
from memo_core.cli.signal_handling import INTERRUPTED
from memo_core.errors import InvalidArgument, Stopped
from memo_core.text.terminal import console

if TYPE_CHECKING:
    from memo_core.interfaces.simulator import Simulator
    from memo_core.robot.description import RobotDescription

app = typer.Typer(help="Measure this machine.")
for _command in (durability_commands.signals, durability_commands.resume, durability_commands.kills):
    app.command()(_command)

QUIET = "run.video=off"  # drawing takes longer than the physics; --set run.video=auto draws all the same
app.command()(perception)
Out = Annotated[Path, typer.Option("--out", "-o", help="Where the run folders are made.")]


@app.command()
def startup(
    runs: Annotated[int, typer.Option("--runs", min=1, help="Rounds; medians are compared.")] = 15, json: Json = False
) -> None:
    """How long `memo --help` takes, against Python importing typer and rich."""
    import attrs

    from memo_benchmarks.startup import bench_startup

    print_report(with_progress("startup", lambda progress: attrs.asdict(bench_startup(runs, progress))), json)


@app.command()
def sim(
    rounds: Annotated[int, typer.Option("--rounds", min=1, help="Rounds; medians are compared.")] = 3,
    simulator: Annotated[
        list[str] | None,
        typer.Option("--simulator", help="Several side by side; repeatable. None: the experiment's alone."),
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """The speed of the motion stack relative to a simulation loop alone that replays its recorded controls in the same
    scene; and the cost of the simulator's checkpoints, images and memory."""
    import attrs

    from memo_benchmarks.sim import bench_sim
    from memo_benchmarks.sim_memory import sim_memory

    def measuring(made: Simulator, robot: RobotDescription) -> Callable[[Callable[[float], None]], dict[str, Any]]:
        return lambda progress: bench_sim(made, robot, rounds=rounds)

    names = list(dict.fromkeys(simulator or ()))
    chosen = [[*(overrides or ()), f"simulator.backend={name}"] for name in names] or [[*(overrides or ())]]
    experiments = [load(config, one)[1] for one in chosen]  # what is wrong is said before anything is measured
    found = []
    for one, experiment in zip(chosen, experiments, strict=True):
        measured = with_progress("sim", measuring(experiment.create("simulator"), experiment.create("robot")))
        name = {"simulator": experiment.choice("simulator").backend.name}
        found.append({"bench": "sim"} | name | measured | attrs.asdict(sim_memory(config, tuple(one))))
    if not names:
        print_report(found[0], json)
    elif json:
        print_json({"bench": "sim", "simulators": found})
    else:
        rows = [(key.replace("_", " "), *(one[key] for one in found)) for key in found[0] if key != "bench"]
        print_table(("sim", *([""] * len(found))), rows)


@app.command()
def trial(
    tasks: Annotated[
        list[str] | None, typer.Option("--task", help="Tasks; repeatable. None: the held-out ones without grains.")
    ] = None,
    scenes: Annotated[int, typer.Option("--scenes", min=1, help="Scenes of each task.")] = 3,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Trials of an evaluation a minute, on one core and on two, and where the time of a trial goes."""
    from memo_benchmarks.trial import bench_trial, has_grains
    from memo_core.runs.factories import task_of, tasks_of

    experiment = load(config, overrides)[1]
    held_out = [task.name for task in tasks_of(experiment) if task.split == "held-out" and not has_grains(task)]
    names = tuple(task_of(experiment, name).name for name in tasks) if tasks else tuple(held_out)
    given = tuple(overrides or ())
    print_report(with_progress("trial", lambda progress: bench_trial(config, given, names, scenes, progress)), json)


@app.command()
def retrieval(
    entries: Annotated[int, typer.Option("--entries", min=10, help="Entries in the book.")] = 20_000,
    keys: Annotated[int, typer.Option("--keys", min=2, help="Distinct keys.")] = 1_000,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """The time of a retrieval from a book of this size, without embedding, beside a plain search."""
    from memo_benchmarks.retrieval import bench_retrieval

    _, experiment = load(config, overrides)
    make, settings = lambda: experiment.create("vectorstore"), experiment.section("retrieval")
    measured = with_progress(
        "retrieval", lambda progress: bench_retrieval(make, entries, keys, settings=settings, progress=progress)
    )
    print_report(measured, json)


@app.command("retrieval-quality")
def retrieval_quality(
    sweep: Annotated[
        bool, typer.Option("--sweep/--no-sweep", help="Also sweep weights, reach and floor on the halves for choosing.")
    ] = False,
    book: Annotated[
        str | None, typer.Option("--book", metavar="BOOK", help="Also measure this book's corrections, by --labels.")
    ] = None,
    labels: Annotated[
        Path | None,
        typer.Option("--labels", metavar="FILE", help="Grades for --book: docs/retrieval.md."),
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Quality of retrieval from labelled notes, by the paper's formula, a plain cosine and ours: see
    docs/retrieval.md."""
    from memo_benchmarks.labelled_notes import of_book
    from memo_benchmarks.retrieval_quality import PLAIN, bench_retrieval_quality
    from memo_core.skillbook.book import Skillbook

    if (book is None) != (labels is None):
        raise InvalidArgument("--book", "one of --book and --labels was given without the other", "both, or neither")
    _, experiment = load(config, overrides)
    more = []
    if book is not None and labels is not None:
        with Skillbook(book, read_only=True) as opened:
            more.append(of_book(opened, labels, book))

    def measure(progress: Callable[[float], None]) -> dict[str, Any]:
        embedder = experiment.create("embedder")
        try:
            return bench_retrieval_quality(
                embedder,
                lambda: experiment.create("vectorstore"),
                experiment.section("retrieval"),
                sweep,
                more,
                progress,
            )
        finally:
            embedder.close()

    measured = with_progress("retrieval-quality", measure)
    if json:
        print_json(measured)
        return
    columns = ("f1", "recall", "precision", "ndcg", "opposites", "silent")
    for one in measured["sets"]:
        rows = [(row["name"], *(row[c] for c in columns)) for row in one["contenders"]]
        print_table((f"{one['name']}: {one['subtasks']} subtasks, {one['notes']} notes", *columns), rows)
        gained = {name: one["ours_minus"][PLAIN][name] for name in ("recall", "ndcg")}
        told = [f"{name} {d['mean']:+.3f} ({d['low']:+.3f} to {d['high']:+.3f})" for name, d in gained.items()]
        console().print(f"ours minus the plain cosine, 95 %: {', '.join(told)}")


@app.command()
def stop(
    signals: Annotated[int, typer.Option("--signals", min=1, help="Stops in each phase.")] = 20,
    phases: Annotated[list[str] | None, typer.Option("--phase", help="Only this phase; repeatable.")] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Time from a signal to the arm's last command and to the question what was wrong: p50 and p99 in each phase."""
    from memo_benchmarks.stop import PHASES, bench_stop

    _, experiment = load(config, overrides)
    measured = with_progress(
        "stop", lambda progress: bench_stop(experiment, signals, phases or PHASES, progress).summary()
    )
    if json:
        print_json(measured)
        return
    rows = measured["phases"]
    print_table(tuple(rows[0]), [tuple(row.values()) for row in rows])


@app.command()
def demo(
    seeds: Annotated[str, typer.Option("--seeds", metavar="A-B", help="Seeds, e.g. 0-19 or 3,5.")] = "0-19",
    out: Out = Path("runs"),
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Run the demo on many seeds: fails, is taught, succeeds, transfers. No videos unless asked for."""
    from memo_benchmarks.demo_sweep import demos
    from memo_core.cli.tasks import read_seeds
    from memo_core.demo.result import chapters_of

    wanted = read_seeds(seeds)
    registry, experiment = load(config, [QUIET, *(overrides or [])])

    def measure(progress: Callable[[float], None]) -> dict[str, Any]:
        rows = []
        for report in demos(experiment, registry, out, wanted):
            rows.append(report.summary())
            progress(len(rows) / len(wanted))
        return {"seeds": len(rows), "told": sum(row["told"] for row in rows), "stories": rows}

    measured = with_progress("demo", measure)
    if json:
        print_json(measured)
        return
    demo = experiment.choice("suite").backend.demo
    names = [part.name for part in chapters_of(demo)] if demo is not None else []
    outcomes = [(row["seed"], *(row[n] for n in names), row["told"], row["wall_s"]) for row in measured["stories"]]
    print_table(("seed", *names, "told", "seconds"), outcomes)
    for row in measured["stories"]:
        if not row["told"]:
            print(f"seed {row['seed']}: " + "; ".join(f"{name}: {row['reasons'].get(name)}" for name in names))
    print(f"{measured['told']} of {measured['seeds']} seeds tell the story")


@app.command()
def lesions(
    seeds: Annotated[str, typer.Option("--seeds", metavar="A-B", help="Seeds, e.g. 0-4 or 3,5.")] = "0-4",
    lesion: Annotated[list[str] | None, typer.Option("--lesion", help="Only this one; repeatable.")] = None,
    task: Annotated[str | None, typer.Option("--task", help="Another task than the demo's second.")] = None,
    out: Out = Path("runs"),
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Teach the demo's lesson, damage the book or change the scene, and measure where the benefit disappears. Pressing
    Ctrl-C twice ends it with a table of the finished runs.
    """
    import attrs

    from memo_benchmarks.demo_sweep import FOR_ONE_KEY, Lesson, known_lesion
    from memo_core.cli.tasks import read_seeds
    from memo_core.runs.factories import task_of

    wanted = read_seeds(seeds)
    chosen = [known_lesion(name) for name in dict.fromkeys(lesion or FOR_ONE_KEY)]
    registry, experiment = load(config, [QUIET, *(overrides or [])])
    if task is not None:
        task_of(experiment, task)  # said before anything is taught

    def measure(progress: Callable[[float], None]) -> dict[str, Any]:
        trials: list[dict[str, Any]] = []
        taught: list[dict[str, Any]] = []
        interrupted = False
        try:
            for seed in wanted:
                lesson = Lesson(experiment, registry, out, seed)
                report = lesson.teach()
                taught.append({"seed": seed, "success": report.success, "folder": str(lesson.folder)})
                for name in chosen:
                    trials.append(attrs.asdict(lesson.under(name, task)))
                    progress(len(trials) / (len(wanted) * len(chosen)))
        except Stopped:
            interrupted = True  # what ended before is reported all the same
        found = {"taught": taught, "lesions": _by_lesion(trials, chosen), "trials": trials}
        return found | {"interrupted": interrupted}

    measured = with_progress("lesions", measure)
    if json:
        print_json(measured)
    else:
        counted = measured["lesions"]
        rows = [(r["lesion"], f"{r['first']}/{r['trials']}", f"{r['success']}/{r['trials']}") for r in counted]
        print_table(("lesion", "first subtask", "whole task"), rows)
    if measured["interrupted"]:
        raise typer.Exit(INTERRUPTED)


@app.command()
def transfer(
    simulator: Annotated[
        list[str] | None, typer.Option("--simulator", help="One of those compared; repeatable. None: all installed.")
    ] = None,
    teach: Annotated[
        list[str] | None,
        typer.Option("--teach", help="A task to teach; repeatable. None: the one of the suite's demo."),
    ] = None,
    task: Annotated[
        list[str] | None, typer.Option("--task", help="A task to try; repeatable. None: all that are held out.")
    ] = None,
    seeds: Annotated[str, typer.Option("--seeds", metavar="A-B", help="Seeds, e.g. 0-4 or 3,5.")] = "0-4",
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="What ended is kept there and not done again.")
    ] = Path("runs/transfer"),
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Teach in one simulator and use the book in another, on tasks that were never corrected."""
    from memo_benchmarks.transfer_command import transfer_table

    transfer_table(config, overrides or [], simulator or [], teach or [], task or [], seeds, out, json)


@app.command()
def functions(
    simulator: Annotated[
        list[str] | None, typer.Option("--simulator", help="A simulator; repeatable. None: all installed.")
    ] = None,
    thing: Annotated[
        list[str] | None, typer.Option("--thing", metavar="SUITE:TASK", help="A task that begins with opening.")
    ] = None,
    seeds: Annotated[str, typer.Option("--seeds", metavar="A-B", help="Seeds, e.g. 0-4 or 3,5.")] = "0-9",
    damaged: Annotated[int, typer.Option("--damaged", min=0, help="Seeds on which damaged books are tried, too.")] = 3,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="DIR", help="What is done is kept there.")] = Path(
        "runs/functions"
    ),
    results: Annotated[
        Path | None, typer.Option("--results", metavar="FILE", help="Also write the table for the documentation.")
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Teach two doors, merge what was learnt into a function, and open things that were never taught with each book."""
    from memo_benchmarks.functions_command import functions_table

    functions_table(config, overrides or [], simulator or [], thing or [], seeds, damaged, out, results, json)


def _by_lesion(trials: list[dict[str, Any]], names: list[str]) -> list[dict[str, Any]]:
    found = []
    for name in names:
        mine = [trial for trial in trials if trial["lesion"] == name]
        done = {"first": sum(t["first"] is True for t in mine), "success": sum(t["success"] for t in mine)}
        found.append({"lesion": name, "trials": len(mine)} | done)
    return found
