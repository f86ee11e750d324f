"""``memo bench signals``, ``resume`` and ``kills``: fault injection into commands, runs and books. Each ends
with exit code 1 if a guarantee was violated.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from memo_benchmarks.reporting import with_progress
from memo_core.cli.options import Json
from memo_core.cli.output import print_json, print_table

Seed = Annotated[int, typer.Option("--seed", help="Of the moments.")]
Out = Annotated[
    Path, typer.Option("--out", "-o", metavar="DIR", help="What was measured is kept there and not measured again.")
]


def signals(
    number: Annotated[int, typer.Option("--signals", min=1, help="Commands, each of which gets one signal.")] = 300,
    seed: Seed = 0,
    out: Out = Path("runs/signals"),
    json: Json = False,
) -> None:
    """Signals at random moments of real commands: exit codes, aborts, orphans, what is left behind, summaries."""
    from memo_benchmarks.signals import bench_signals

    _report(with_progress("signals", lambda told: bench_signals(number, seed, told, out)), ("kinds", "commands"), json)


def resume(
    number: Annotated[
        int, typer.Option("--kills", min=1, help="How often runs are killed, one to three times each.")
    ] = 100,
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Runs killed at random moments and resumed: outcome, book and tokens against the runs that were left alone."""
    from memo_benchmarks.resume import bench_resume

    _report(with_progress("resume", lambda told: bench_resume(number, seed, told)), (), json)


def kills(
    number: Annotated[
        int, typer.Option("--kills", min=1, help="Processes that are killed, a quarter of each kind.")
    ] = 1000,
    seed: Seed = 0,
    out: Out = Path("runs/kills"),
    json: Json = False,
) -> None:
    """Books whose writers, clusterings, imports and migrations are killed: what was acknowledged must be there."""
    from memo_benchmarks.kills import bench_kills

    _report(with_progress("kills", lambda told: bench_kills(number, seed, told, out)), ("kinds",), json)


def _report(measured: dict[str, Any], tables: tuple[str, ...], json: bool) -> None:
    if json:
        print_json(measured)
    else:
        for name in tables:
            rows = measured[name]
            print_table(tuple(rows[0]), [tuple(row.values()) for row in rows])
        told = {name: value for name, value in measured.items() if name not in (*tables, "bench", "faults", "kept")}
        print("\n".join(f"{name}: {value}" for name, value in told.items()))
        print("\n".join([*measured["faults"], f"kept: {'yes' if measured['kept'] else 'no'}"]))
    if not measured["kept"]:
        raise typer.Exit(1)
