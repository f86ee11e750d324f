"""``memo bench transfer``: lessons that cross from one simulator to another, as a table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import attrs

from memo_core.cli.options import load, load_registry
from memo_core.cli.output import note, print_json, print_table, progress_bar
from memo_core.cli.tasks import read_seeds

_QUIET = "run.video=off"  # drawing takes longer than the physics; --set run.video=auto draws all the same


def transfer_table(
    config: Path | None,
    overrides: list[str],
    simulators: list[str],
    teach: list[str],
    tasks: list[str],
    seeds: str,
    out: Path,
    json: bool,
) -> None:
    """Run what is not in ``out`` yet and print the table. Raises ``MemoError`` for what cannot be run."""
    from memo_benchmarks.transfer import Transfer

    wanted = read_seeds(seeds)
    names = list(dict.fromkeys(simulators)) or list(load_registry().names("simulator"))
    demo = load(config, overrides)[1].choice("suite").backend.demo
    settings = [_QUIET, *(demo.settings if demo is not None else ()), *overrides]
    loaded = {name: load(config, [*settings, f"simulator.backend={name}"]) for name in names}
    registry = next(iter(loaded.values()))[0]
    transfer = Transfer({name: one for name, (_, one) in loaded.items()}, registry, out, wanted, teach, tasks)
    done = 0
    with progress_bar() as progress:
        bar = progress.add_task("transfer", total=transfer.size)
        for trial in transfer.trials():
            done += 1
            what = "lesson" if trial.lesson else f"book of {trial.taught_in or 'nobody'}"
            progress.update(bar, completed=done, description=f"{trial.task} in {trial.simulator}, {what}")
    rows = transfer.table()
    if json:
        print_json(_report(transfer, rows, done))
        return
    print_table(("taught", "in", "seed", "done", "corrections"), [_lesson(one) for one in transfer.lessons()])
    print()
    print_table(
        ("task", "in", "seeds", "empty book", "taught there", "taught elsewhere"),
        [
            (row.task, row.simulator, row.seeds, row.empty, row.taught_here, _elsewhere(row.taught_elsewhere))
            for row in rows
        ],
    )
    if done < transfer.size:
        note(f"{done} of {transfer.size} runs; the same command continues with the rest")


def _report(transfer: Any, rows: list[Any], done: int) -> dict[str, Any]:
    return {
        "bench": "transfer",
        "simulators": list(transfer.experiments),
        "taught": transfer.taught,
        "seeds": transfer.seeds,
        "runs": done,
        "runs_wanted": transfer.size,
        "trials": [attrs.asdict(one) for one in transfer.done()],
        "tasks": [attrs.asdict(row) for row in rows],
        "folder": str(transfer.folder),
    }


def _lesson(trial: Any) -> tuple[Any, ...]:
    return (trial.task, trial.simulator, trial.seed, "yes" if trial.success else "no", trial.corrections)


def _elsewhere(counts: dict[str, int]) -> str:
    return ", ".join(f"{count} ({name})" for name, count in counts.items())
