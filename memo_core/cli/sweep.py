"""``memo run --seeds``: runs the same experiment on several seeds and prints a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from memo_core.cli.options import load
from memo_core.cli.output import note, print_json, print_table, progress_bar, while_read
from memo_core.cli.signal_handling import INTERRUPTED

if TYPE_CHECKING:
    from memo_core.config import Experiment


def run_seeds(
    file: Path | None,
    overrides: list[str],
    task: str | None,
    seeds: Sequence[int],
    out: Path,
    code: bool,
    json: bool,
) -> None:
    """Do the task on each seed that is not done yet, and print what became of all. Exits like ``memo run``: 0 where
    each is done."""
    from memo_core.cli.narration import Narrator
    from memo_core.config import load_experiment
    from memo_core.runs.background import Consolidation, with_shared_limit
    from memo_core.runs.consolidation import in_background
    from memo_core.runs.sections import SECTIONS
    from memo_core.runs.sweep import sweep, sweep_folder

    registry, first = load(file, overrides, task, seeds[0])
    folder, wanted = sweep_folder(first, out), in_background(first)

    def shared(experiment: Experiment) -> Experiment:
        return with_shared_limit(experiment, folder, len(seeds)) if wanted else experiment

    def of_seed(seed: int) -> Experiment:
        return shared(load_experiment(registry, file, overrides, SECTIONS, task, seed))

    watched: dict[str, Any] = {}
    if code or first.create("teacher").reads_back:  # somebody reads along
        narrator = Narrator(code=code)
        watched = {"listener": narrator, "on_text": narrator.on_text}
    rows: list[dict[str, Any]] = []
    beside = Consolidation(shared(first), folder, first.section("skillbook").url, wanted, note)
    with beside, progress_bar() as bar:
        progress = bar.add_task(first.task or "", total=len(seeds))
        if watched:
            bar.stop()  # a person is asked on this terminal
        for seed, summary, known in sweep(of_seed, registry, seeds, folder, begun=beside.start, **watched):
            rows.append({"seed": seed, "known": known, "error": None} | summary)
            bar.advance(progress)
    with while_read():
        _print(rows, first, seeds, folder, json)
    if rows and rows[-1].get("ended_by_person"):
        raise typer.Exit(INTERRUPTED)
    if len(rows) < len(seeds) or not all(row["success"] for row in rows):
        raise typer.Exit(1)


def _print(rows: list[dict[str, Any]], experiment: Experiment, seeds: Sequence[int], folder: Path, json: bool) -> None:
    from memo_core.runs.run_errors import RunError, told

    done = sum(bool(row["success"]) for row in rows)
    errors = [RunError(**row["error"]) for row in rows if row["error"]]
    if json:
        counts = {"done": done, "errors": len(errors), "runs": rows, "folder": str(folder)}
        print_json({"task": experiment.task, "seeds": list(seeds)} | counts)
        return
    print_table(
        ("seed", "done", "subtasks", "corrections", "robot s", "wall s", "why"),
        [
            (
                row["seed"],
                "error" if row["error"] else "yes" if row["success"] else "no",
                len(row["subtasks"]),
                row["corrections"],
                round(row["robot_s"]),
                round(row["wall_s"]),
                row["problem"] or row["reason"],
            )
            for row in rows
        ],
    )
    print(f"{experiment.task}: {done} of {len(rows) - len(errors)} done; kept in {folder}")
    if errors:
        note(f"memo: {len(errors)} could not be carried out and are not counted: {told(errors)}")
    again = sum(row["known"] for row in rows)
    if again:
        note(f"memo: {again} of them had ended before and were not run again; another --out runs all")
    if len(rows) < len(seeds):
        note("memo: stopped; the same command goes on with the seeds that are left")
    elif errors:
        note("memo: the same command does them again")
