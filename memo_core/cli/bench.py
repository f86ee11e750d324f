"""``memo bench``: what MEMO promises about speed, measured on this machine."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, load
from memo_core.cli.output import print_json, print_table

app = typer.Typer(help="Measure this machine.")


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
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """The whole motion stack against a bare loop that replays its recorded controls in the same scene."""
    from memo_core.experiment.bench_sim import bench_sim

    _, experiment = load(config, overrides)
    simulator, robot = experiment.create("simulator"), experiment.create("robot")
    _report(_measured("sim", lambda progress: bench_sim(simulator, robot, rounds=rounds)), json)


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
