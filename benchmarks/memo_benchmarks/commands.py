"""``memo bench``: what MEMO promises about speed, measured on this machine."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_benchmarks import durability_commands
from memo_benchmarks.fuzz.command import fuzz
from memo_benchmarks.perception.command import perception
from memo_benchmarks.reporting import print_report, with_progress
from memo_core.cli.options import ConfigFile, Json, Overrides, load
from memo_core.cli.output import print_json, print_table
from memo_core.cli.signal_handling import INTERRUPTED
from memo_core.errors import InvalidArgument, Stopped
from memo_core.terminal import console

if TYPE_CHECKING:
    from memo_core.interfaces.simulator import Simulator
    from memo_core.robot.description import RobotDescription

app = typer.Typer(help="Measure this machine.")
for _command in (durability_commands.signals, durability_commands.resume, durability_commands.kills):
    app.command()(_command)
app.command()(durability_commands.soak)

QUIET = "run.video=off"  # drawing takes longer than the physics; --set run.video=auto draws all the same
app.command()(fuzz)
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
def teacher(
    names: Annotated[list[str] | None, typer.Argument(metavar="[NAME]…", help="Tasks; none: all.")] = None,
    suites: Annotated[
        list[str] | None, typer.Option("--suite", help="Task suites; repeatable. None: the experiment's.")
    ] = None,
    seeds: Annotated[str, typer.Option("--seeds", metavar="A-B", help="Seeds, e.g. 0-1 or 3,5.")] = "0",
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Verdicts of the simulated teacher on reference solutions, plain attempts and doing nothing, compared with the
    success checks, which it never sees: see docs/simulated-teacher.md."""
    from memo_benchmarks.teacher import bench_teacher
    from memo_core.cli.tasks import read_seeds

    chosen = [[*(overrides or ()), "teacher.backend=simulated", "teacher.misjudges=0"]]
    if suites:
        chosen = [[*chosen[0], f"suite.backend={suite}"] for suite in suites]
    experiments = [load(config, one)[1] for one in chosen]
    table = bench_teacher(experiments, names or [], read_seeds(seeds))
    if json:
        print_json({"bench": "teacher", "counts": table.counts, "verdicts": table.rows})
        return
    columns = ("task", "seed", "behaviour", "success", "verdict", "agreement", "words")
    print_table(columns, [tuple(row[column] for column in columns) for row in table.rows])
    print_table(("agreement", "verdicts"), list(table.counts.items()))


@app.command()
def planning(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """Plan motions with doors and drawers, and compare seeds from the table of poses with seeds that do not depend on
    the pose."""
    from memo_benchmarks.planning import bench_planning

    _, experiment = load(config, overrides)
    robot = experiment.create("robot")
    print_report(with_progress("planning", lambda progress: bench_planning(robot, progress)), json)


@app.command()
def force(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """Accuracy of force estimation and force control (N), compared with the simulator's contact forces: see
    docs/force.md."""
    from memo_benchmarks.force import bench_force

    _, experiment = load(config, overrides)
    simulator, robot = experiment.create("simulator"), experiment.create("robot")
    print_report(with_progress("force", lambda progress: bench_force(simulator, robot, progress)), json)


@app.command()
def retrieval(
    entries: Annotated[int, typer.Option("--entries", min=10, help="Entries in the book.")] = 10_000,
    keys: Annotated[int, typer.Option("--keys", min=2, help="Distinct keys.")] = 300,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """A complete retrieval by key, including reading the rows, without embedding, compared with a flat index over all
    entries."""
    from memo_benchmarks.retrieval import bench_retrieval

    _, experiment = load(config, overrides)

    def measure(progress: Callable[[float], None]) -> dict[str, Any]:
        return bench_retrieval(
            lambda: experiment.create("embedder"),
            lambda: experiment.create("vectorstore"),
            entries,
            keys,
            settings=experiment.section("retrieval"),
        )

    print_report(with_progress("retrieval", measure), json)


@app.command()
def vectorstore(
    keys: Annotated[int, typer.Option("--keys", min=20, help="Vectors in the store.")] = 300,
    queries: Annotated[int, typer.Option("--queries", min=1, help="Searches.")] = 100,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Recall of the experiment's vector store against exact search (--set vectorstore=chroma): see docs."""
    from memo_benchmarks.vectorstore import bench_vectorstore

    _, experiment = load(config, overrides)
    make = lambda: experiment.create("vectorstore")
    print_report(with_progress("vector store", lambda progress: bench_vectorstore(make, keys, queries, progress)), json)


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


@app.command("quirks-serving")
def quirks_serving(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """Whether the lesson for a held-out quirk is retrieved at its decisive subtask: see docs/retrieval.md."""
    from memo_benchmarks.quirks_serving import bench_quirks_serving, first_look, quirks

    _, experiment = load(config, ["suite.backend=quirks", *(overrides or ())])

    def measure(progress: Callable[[float], None]) -> dict[str, Any]:
        found = quirks(experiment.create("suite"), lambda name: first_look(experiment, name))
        embedder = experiment.create("embedder")
        try:
            embedder.open()
            make = lambda: experiment.create("vectorstore")
            return bench_quirks_serving(found, embedder, make, experiment.section("retrieval"))
        finally:
            embedder.close()

    measured = with_progress("quirks-serving", measure)
    if json:
        print_json(measured)
        return
    columns = ("contender", "others", "task", "subtask", "place")
    print_table(columns, [tuple(row[name] for name in columns) for row in measured["rows"]])
    summed = tuple(measured["summary"][0])
    print_table(summed, [tuple(row.values()) for row in measured["summary"]])


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
    from memo_benchmarks.generated_book import BookSize
    from memo_benchmarks.skillbook import Source, bench_skillbook

    load(config, overrides)  # what is wrong is said before anything is measured
    source, size = Source(config, tuple(overrides or ())), BookSize(entries, keys, general, seed=seed)
    measured = with_progress(
        "skillbook", lambda progress: bench_skillbook(source, size, questions, seconds, folder, stores, progress)
    )
    if json:
        print_json(measured)
        return
    print_report({name: value for name, value in measured.items() if name != "contenders"}, False)
    columns = ("contender", "over", "entries", "open_s", "questions", "p50_ms", "p99_ms", "cpu_p50_ms", "peak_mib")
    print_table(columns, [tuple(one[name] for name in columns) for one in measured["contenders"]])


@app.command()
def clustering(
    keys: Annotated[int, typer.Option("--keys", min=1, max=190, help="Keys in the book; about 12 notes each.")] = 60,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of the book.")] = 0,
    keep: Annotated[
        Path | None, typer.Option("--keep", metavar="DIR", help="A new folder for the book, questions and answers.")
    ] = None,
    ablation: Annotated[
        bool, typer.Option("--ablation", help="Also with clustering.drop_covered the other way round.")
    ] = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Cluster a book with planted contradictions and repetitions: how many are removed, and how much of the rest is
    kept."""
    import attrs

    from memo_benchmarks.clustering import bench_clustering

    _, experiment = load(config, overrides)
    chosen = {"clustering": (experiment, keep)}
    if ablation:
        other = not experiment.section("clustering").drop_covered
        _, changed = load(config, [*(overrides or ()), f"clustering.drop_covered={str(other).lower()}"])
        chosen["ablation"] = (changed, keep and keep / "ablation")

    def row(name: str) -> dict[str, Any]:
        one, folder = chosen[name]
        return with_progress(name, lambda progress: attrs.asdict(bench_clustering(one, keys, seed, folder, progress)))

    rows = {name: row(name) for name in chosen}
    if json:
        print_report(rows["clustering"] | ({"ablation": rows["ablation"]} if ablation else {}), json)
        return
    for measured in rows.values():
        missed, problems = measured["missed"], measured["problems"]
        print_report(measured | {"missed": len(missed), "problems": len(problems)}, json)
        print("\n".join(["", *missed, *problems]))


@app.command()
def understanding(
    file: Annotated[Path, typer.Argument(help="YAML list of sentences with what is meant, as in tests/sayings.")],
    all_sentences: Annotated[bool, typer.Option("--all", help="Show every sentence, not only totals.")] = False,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """How the language model reads everyday sentences: understood as meant, asked back, without effect, misread."""
    from memo_benchmarks.understanding import bench_understanding, sayings_in, shares
    from memo_core.runs.factories import library_of, prompts_of

    sayings = sayings_in(file)
    _, experiment = load(config, overrides)
    model = experiment.create("llm")
    heard: list[Any] = []

    def measure(progress: Callable[[float], None]) -> dict[str, Any]:
        model.open()
        try:
            heard.extend(bench_understanding(model, sayings, library_of(experiment), prompts_of(experiment), progress))
        finally:
            model.close()
        return shares(heard)

    measured = with_progress("understanding", measure)
    if json:
        print_json(measured | {"all": [one.told for one in heard]})
        return
    print_report(measured, json)
    if all_sentences:
        for one in heard:
            print(f"\n[{one.verdict}] {one.saying.subtask}: {one.saying.says}\n  meant: {one.saying.means}")
            for line in (*one.notes, *([f"asked: {one.asked}"] if one.asked else []), *one.changed):
                print(f"  - {line}")


@app.command()
def agreement(
    file: Annotated[Path, typer.Argument(help='JSON Lines, a sentence each, with "judges": two verdicts.')],
    json: Json = False,
) -> None:
    """What two judges made of sentences: shares of each verdict, agreement, Cohen's kappa."""
    from memo_benchmarks.understanding import agreement as agreed

    print_report(agreed(file), json)


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
    from memo_core.runs.demo_result import CHAPTERS

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
    """Teach the demo's lesson, damage the book or change the scene, and measure where the benefit disappears. Pressing
    Ctrl-C twice ends it with a table of the finished runs.
    """
    import attrs

    from memo_benchmarks.demo_sweep import KNOWN, Lesson, known_lesion
    from memo_core.cli.tasks import read_seeds
    from memo_core.runs.factories import task_of

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
def drawer(
    file: Annotated[Path, typer.Argument(help="What a person says of the drawer, one sentence a line.")],
    seeds: Annotated[str, typer.Option("--seeds", metavar="A-B", help="Seeds, e.g. 0-4 or 3,5.")] = "0",
    out: Out = Path("runs"),
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """The effect of a lesson about a door on a drawer, before and after one remark: see docs/offline-backend.md."""
    import attrs

    from memo_benchmarks.drawer import DOORS, SETTINGS, bench_drawer, sayings_in, summary
    from memo_core.cli.tasks import read_seeds

    sayings, wanted = sayings_in(file), read_seeds(seeds)
    registry, experiment = load(config, [*SETTINGS, *(overrides or ())])
    heard: list[Any] = []

    def measure(progress: Callable[[float], None]) -> dict[str, Any]:
        heard.extend(bench_drawer(experiment, registry, out, sayings, wanted, progress))
        return summary(heard)

    measured = with_progress("drawer", measure)
    if json:
        print_json({"bench": "drawer"} | measured | {"all": [attrs.asdict(one) for one in heard]})
        return
    rows = [
        (
            one.seed,
            one.says,
            len(one.notes),
            *map(_tried, (one.before, one.retry, one.later, *(one.doors[door] for door in DOORS))),
        )
        for one in heard
    ]
    print_table(("seed", "said", "notes", "before", "retry", "later run", *DOORS), rows)
    print_report(measured, json)


def _tried(attempt: Any) -> str:
    return f"{attempt.shape}, {'opened' if attempt.opened else 'shut'}"


def _by_lesion(trials: list[dict[str, Any]], names: list[str]) -> list[dict[str, Any]]:
    found = []
    for name in names:
        mine = [trial for trial in trials if trial["lesion"] == name]
        done = {"first": sum(t["first"] is True for t in mine), "success": sum(t["success"] for t in mine)}
        found.append({"lesion": name, "trials": len(mine)} | done)
    return found
