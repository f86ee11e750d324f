"""``memo bench functions``: the table, and the file from which the documentation shows it."""

from __future__ import annotations

from pathlib import Path

from memo_benchmarks.functions import BOOKS, SETTINGS, TAUGHT, THINGS, FunctionBench, measure, table
from memo_benchmarks.kept_rows import Row
from memo_benchmarks.reporting import with_progress
from memo_core.cli.options import load, load_registry
from memo_core.cli.output import print_json, print_table
from memo_core.cli.tasks import read_seeds
from memo_core.errors import InvalidArgument
from memo_core.runlog.whole_files import write_whole
from memo_core.runs.factories import task_of
from memo_core.runs.folder import json_text


def functions_table(
    config: Path | None,
    overrides: list[str],
    simulators: list[str],
    things: list[str],
    seeds: str,
    damaged: int,
    out: Path,
    results: Path | None,
    json: bool,
) -> None:
    """Do what is not in ``out`` yet, print the table, write undamaged books to ``results``. Raises ``MemoError``."""
    wanted = read_seeds(seeds)
    names = list(dict.fromkeys(simulators)) or list(load_registry().names("simulator"))
    tried = list(dict.fromkeys(things)) or list(THINGS)
    benches = [_bench(config, [*SETTINGS, *overrides, f"simulator.backend={name}"], tried, out) for name in names]
    measured = with_progress("functions", lambda progress: {"rows": measure(benches, wanted, tried, damaged, progress)})
    lines = table(measured["rows"])
    if results is not None:
        file = {
            "command": f"memo bench functions --seeds {seeds}",
            "note": _note(measured["rows"], names),
            "rows": [line for line in lines if line["book"] in BOOKS.values()],
        }
        write_whole(results, json_text(file))
    if json:
        print_json(measured | {"table": lines})
    else:
        print_table(tuple(lines[0]), [tuple(line.values()) for line in lines])


def _note(rows: list[Row], simulators: list[str]) -> str:
    taught = " and ".join(f"`{task.split(':')[1]}`" for task in TAUGHT)
    merged = sum(row["calls"] == [len(TAUGHT)] for row in rows)
    first = rows[0]["openings"][0]["thing"]
    called = round(sum(row["called"] for row in rows) / len(rows))
    return (
        f"opened in {', in '.join(simulators)}; offline backend. Taught: {taught}, in {merged} of {len(rows)} books "
        f"merged into one function with {len(TAUGHT)} calls. Prompts are means of the first question for code, which "
        f"shows the function as a template; where a model can call it instead, that for `{first.split(':')[1]}` has "
        f"{called} characters."
    )


def _bench(config: Path | None, overrides: list[str], things: list[str], out: Path) -> FunctionBench:
    experiments = {}
    for task in (*TAUGHT, *things):
        suite, colon, name = task.partition(":")
        if not colon:
            raise InvalidArgument("--thing", f"{task!r} names no suite", "SUITE:TASK, such as " + THINGS[0])
        if suite not in experiments:
            registry, experiments[suite] = load(config, [*overrides, f"suite.backend={suite}"])
        task_of(experiments[suite], name)
    return FunctionBench(experiments, registry, out)
