"""``memo bench``: what MEMO promises about speed, measured on this machine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, load
from memo_core.cli.output import print_json, print_table
from memo_core.cli.stopping import INTERRUPTED
from memo_core.errors import Stopped

if TYPE_CHECKING:
    from memo_core.interfaces.robot import RobotDescription
    from memo_core.interfaces.simulator import Simulator

app = typer.Typer(help="Measure this machine.")

QUIET = "run.video=off"  # drawing takes longer than the physics; --set run.video=auto draws all the same
Out = Annotated[Path, typer.Option("--out", "-o", help="Where the run folders are made.")]


@app.command()
def startup(
    runs: Annotated[int, typer.Option("--runs", min=1, help="Rounds; medians are compared.")] = 15, json: Json = False
) -> None:
    """How long `memo --help` takes, against Python importing typer and rich."""
    import attrs

    from memo_core.experiment.bench_startup import bench_startup

    _report(_measured("startup", lambda progress: attrs.asdict(bench_startup(runs, progress))), json)


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
    """The whole motion stack against a bare loop that replays its recorded controls in the same scene; and what the
    simulator's checkpoints, pictures and memory cost."""
    import attrs

    from memo_core.experiment.bench_sim import bench_sim
    from memo_core.experiment.bench_sim_memory import sim_memory

    def measuring(made: Simulator, robot: RobotDescription) -> Callable[[Callable[[float], None]], dict[str, Any]]:
        return lambda progress: bench_sim(made, robot, rounds=rounds)

    names = list(dict.fromkeys(simulator or ()))
    chosen = [[*(overrides or ()), f"simulator.backend={name}"] for name in names] or [[*(overrides or ())]]
    experiments = [load(config, one)[1] for one in chosen]  # what is wrong is said before anything is measured
    found = []
    for one, experiment in zip(chosen, experiments, strict=True):
        measured = _measured("sim", measuring(experiment.create("simulator"), experiment.create("robot")))
        name = {"simulator": experiment.choice("simulator").backend.name}
        found.append({"bench": "sim"} | name | measured | attrs.asdict(sim_memory(config, tuple(one))))
    if not names:
        _report(found[0], json)
    elif json:
        print_json({"bench": "sim", "simulators": found})
    else:
        rows = [(key.replace("_", " "), *(one[key] for one in found)) for key in found[0] if key != "bench"]
        print_table(("sim", *([""] * len(found))), rows)


@app.command()
def planning(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """Plan motions with doors and drawers, and compare starts looked up in the table of poses with blind ones."""
    from memo_core.experiment.bench_planning import bench_planning

    _, experiment = load(config, overrides)
    robot = experiment.create("robot")
    _report(_measured("planning", lambda progress: bench_planning(robot, progress)), json)


@app.command()
def force(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """How well the robot feels and presses (N), against the simulator's own contact forces: see docs/force.md."""
    from memo_core.experiment.bench_force import bench_force

    _, experiment = load(config, overrides)
    simulator, robot = experiment.create("simulator"), experiment.create("robot")
    _report(_measured("force", lambda progress: bench_force(simulator, robot, progress)), json)


@app.command()
def retrieval(
    entries: Annotated[int, typer.Option("--entries", min=10, help="Entries in the book.")] = 10_000,
    keys: Annotated[int, typer.Option("--keys", min=2, help="Distinct keys.")] = 300,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """A whole retrieval by key, rows fetched, embedding excluded, against a flat index over all entries."""
    from memo_core.experiment.bench_retrieval import bench_retrieval

    _, experiment = load(config, overrides)

    def measure(progress: Callable[[float], None]) -> dict[str, Any]:
        return bench_retrieval(
            lambda: experiment.create("embedder"),
            lambda: experiment.create("vectorstore"),
            entries,
            keys,
            settings=experiment.section("retrieval"),
        )

    _report(_measured("retrieval", measure), json)


@app.command()
def vectorstore(
    keys: Annotated[int, typer.Option("--keys", min=20, help="Vectors in the store.")] = 300,
    queries: Annotated[int, typer.Option("--queries", min=1, help="Searches.")] = 100,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """What the experiment's vector store finds of the best there is (--set vectorstore=chroma): see docs."""
    from memo_core.experiment.bench_vectorstore import bench_vectorstore

    _, experiment = load(config, overrides)
    make = lambda: experiment.create("vectorstore")
    _report(_measured("vector store", lambda progress: bench_vectorstore(make, keys, queries, progress)), json)


@app.command("retrieval-quality")
def retrieval_quality(
    sweep: Annotated[
        bool, typer.Option("--sweep/--no-sweep", help="Also sweep wording, weights and cut on one half.")
    ] = True,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """What subtasks are served from a labelled book, by the authors' settings and ours: see docs/retrieval.md."""
    from memo_core.experiment.bench_retrieval_quality import bench_retrieval_quality

    _, experiment = load(config, overrides)

    def measure(progress: Callable[[float], None]) -> dict[str, Any]:
        embedder = experiment.create("embedder")
        try:
            return bench_retrieval_quality(
                embedder, lambda: experiment.create("vectorstore"), experiment.section("retrieval"), sweep, progress
            )
        finally:
            embedder.close()

    measured = _measured("retrieval-quality", measure)
    if json:
        print_json(measured)
        return
    columns = ("f1", "recall", "precision", "ndcg", "opposites")
    for half in measured["queries"]:
        rows = [(one["name"], one["settings"]["cut"], *(one[half][c] for c in columns)) for one in measured["compared"]]
        print_table((half, "cut", *columns), rows)


@app.command()
def skillbook(
    entries: Annotated[int, typer.Option("--entries", min=10, help="Entries in the book.")] = 20_000,
    keys: Annotated[int, typer.Option("--keys", min=2, help="Distinct keys.")] = 300,
    general: Annotated[
        float, typer.Option("--general", min=0.0, max=0.5, help="Share that are general statements.")
    ] = 0.005,
    questions: Annotated[int, typer.Option("--questions", min=10, help="Subtasks that are asked for.")] = 500,
    seconds: Annotated[float, typer.Option("--seconds", min=1.0, help="For filling one store with entries.")] = 20.0,
    stores: Annotated[
        list[str] | None, typer.Option("--store", help="Only this one of the others; repeatable.")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the book.")] = 0,
    folder: Annotated[
        Path | None, typer.Option("--folder", metavar="DIR", help="Keep the book there for next time; 1M: 3 GB.")
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """A large book beside every vector store with one vector an entry, and a plain loop: see docs/retrieval.md."""
    from memo_core.experiment.bench_skillbook import Source, bench_skillbook
    from memo_core.experiment.generated_book import BookSize

    load(config, overrides)  # what is wrong is said before anything is measured
    source, size = Source(config, tuple(overrides or ())), BookSize(entries, keys, general, seed=seed)
    measured = _measured(
        "skillbook", lambda progress: bench_skillbook(source, size, questions, seconds, folder, stores, progress)
    )
    if json:
        print_json(measured)
        return
    _report({name: value for name, value in measured.items() if name != "contenders"}, False)
    columns = ("contender", "over", "entries", "open_s", "questions", "p50_ms", "p99_ms", "cpu_p50_ms", "peak_mib")
    print_table(columns, [tuple(one[name] for name in columns) for one in measured["contenders"]])


@app.command()
def clustering(
    keys: Annotated[int, typer.Option("--keys", min=1, max=190, help="Keys in the book; about 12 notes each.")] = 60,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the book.")] = 0,
    keep: Annotated[
        Path | None, typer.Option("--keep", metavar="DIR", help="A new folder for the book, questions and answers.")
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Cluster a book with planted contradictions and repetitions: what is gone of them, what is kept of the rest."""
    import attrs

    from memo_core.experiment.bench_clustering import bench_clustering

    _, experiment = load(config, overrides)
    measured = _measured(
        "clustering", lambda progress: attrs.asdict(bench_clustering(experiment, keys, seed, keep, progress))
    )
    missed, problems = measured["missed"], measured["problems"]
    _report(measured if json else measured | {"missed": len(missed), "problems": len(problems)}, json)
    if not json:
        print("\n".join(["", *missed, *problems]))


@app.command()
def stop(
    signals: Annotated[int, typer.Option("--signals", min=1, help="Stops in each phase.")] = 20,
    phases: Annotated[list[str] | None, typer.Option("--phase", help="Only this phase; repeatable.")] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """From a signal to the arm's last command and to the question what was wrong: p50 and p99 in each phase."""
    from memo_core.experiment.bench_stop import PHASES, bench_stop

    _, experiment = load(config, overrides)
    measured = _measured("stop", lambda progress: bench_stop(experiment, signals, phases or PHASES, progress).summary())
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
    """Tell the demo's story on many seeds: fails, is taught, succeeds, carries over. No videos unless asked for."""
    from memo_core.cli.tasks import read_seeds
    from memo_core.experiment.demo import CHAPTERS
    from memo_core.experiment.sweep import demos

    wanted = read_seeds(seeds)
    registry, experiment = load(config, [QUIET, *(overrides or [])])

    def measure(progress: Callable[[float], None]) -> dict[str, Any]:
        rows = []
        for report in demos(experiment, registry, out, wanted):
            rows.append(report.summary())
            progress(len(rows) / len(wanted))
        return {"seeds": len(rows), "told": sum(row["told"] for row in rows), "stories": rows}

    measured = _measured("demo", measure)
    if json:
        print_json(measured)
        return
    names = [part.name for part in CHAPTERS]
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
    """Teach the demo's lesson, damage the book or change the scene, and see where the benefit goes.

    Ctrl-C, twice, ends it with a table of what had ended.
    """
    import attrs

    from memo_core.cli.tasks import read_seeds
    from memo_core.experiment.assembly import task_of
    from memo_core.experiment.sweep import KNOWN, Lesson, known_lesion

    wanted = read_seeds(seeds)
    chosen = [known_lesion(name) for name in dict.fromkeys(lesion or KNOWN)]
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

    measured = _measured("lesions", measure)
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
    """Teach in one simulator, use the book in another: what is learnt of it on tasks that nobody ever corrected."""
    from memo_core.cli.transfer import transfer_table

    transfer_table(config, overrides or [], simulator or [], teach or [], task or [], seeds, out, json)


def _by_lesion(trials: list[dict[str, Any]], names: list[str]) -> list[dict[str, Any]]:
    found = []
    for name in names:
        mine = [trial for trial in trials if trial["lesion"] == name]
        done = {"first": sum(t["first"] is True for t in mine), "success": sum(t["success"] for t in mine)}
        found.append({"lesion": name, "trials": len(mine)} | done)
    return found


def _measured(what: str, measure: Callable[[Callable[[float], None]], dict[str, Any]]) -> dict[str, Any]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(f"measuring {what}", total=None)
        return {"bench": what} | measure(lambda share: bar.update(task, total=1.0, completed=share))


def _report(measured: dict[str, Any], json: bool) -> None:
    if json:
        print_json(measured)
        return
    rows = [(name.replace("_", " "), value) for name, value in measured.items() if name != "bench"]
    print_table((measured["bench"], ""), rows)
