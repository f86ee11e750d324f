"""``memo bench fuzz``."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from memo_core.cli.options import Json
from memo_core.cli.output import print_json, print_table, progress_bar
from memo_core.errors import UnknownName

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


def fuzz(
    kind: Annotated[list[str] | None, typer.Option("--kind", help="Only this one; repeatable. None: all.")] = None,
    count: Annotated[int, typer.Option("--count", min=1, help="Inputs of each kind.")] = 1_000,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Of everything that is drawn.")] = 0,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="What was read is kept there and not read again.")
    ] = Path("runs/fuzz"),
    json: Json = False,
) -> None:
    """Damaged and hostile programs, imports, configs, recordings, run folders and books, given to the commands that
    read them: no bug, no traceback, no hang, no control character, no secret, bounded memory. See docs/fuzzing.md.

    Exit code 1 when something was found.
    """
    from memo_benchmarks.fuzz.bench import bench_fuzz
    from memo_benchmarks.fuzz.child import kinds

    for name in kind or ():
        if name not in kinds():
            raise UnknownName("kind of input", name, tuple(kinds()))
    found = []
    out.mkdir(parents=True, exist_ok=True)
    for name in dict.fromkeys(kind or kinds()):
        with progress_bar() as bar:
            task = bar.add_task(name, total=count)
            done = partial(_show, bar, task)
            found.append(bench_fuzz(name, count, seed, out, done))
    if json:
        print_json({"bench": "fuzz", "kinds": found})
    else:
        columns = ("kind", "inputs", "real", "finds", "codes", "slowest_cpu_s", "most_mib")
        rows = [{**one, "finds": len(one["finds"])} for one in found]
        print_table(columns, [tuple(row[column] for column in columns) for row in rows])
        for one in found:
            for find in one["finds"]:
                print(f"{one['kind']} {find['input']}: {'; '.join(find['faults'])}")
    if any(one["finds"] for one in found):
        raise typer.Exit(1)


def _show(bar: Progress, task: TaskID, done: int) -> None:
    bar.update(task, completed=done)
