"""``memo reproduce``: study, books, evaluation and report in one command."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from memo_core.cli.evaluate import Jobs, Out
from memo_core.cli.options import Json, Overrides
from memo_core.cli.output import note, print_json
from memo_core.cli.signal_handling import INTERRUPTED, stopping
from memo_core.errors import Stopped

# What --small changes: one history through all training tasks once, one scene of each held-out task, three book sizes.
SMALL = (
    "study.histories=1",
    "study.rounds=1",
    "study.hours=3",
    "evaluation.hours=[0, 1, 3]",
    "evaluation.scenes=1",
)


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Experiment file, such as examples/paper.yaml.")],
    out: Out = None,
    overrides: Overrides = None,
    small: Annotated[bool, typer.Option("--small", help="One history, one round, one scene: ten minutes.")] = False,
    films: Annotated[bool, typer.Option("--films", help="Also films of a success and a failure a cell.")] = False,
    jobs: Jobs = None,
    json: Json = False,
) -> None:
    """From nothing to the report: study, books, evaluation, reference solutions, tables and figures.

    Stopped or killed at any moment, the same command goes on.
    """
    from memo_core.cli.evaluate import exit_for_errors, print_outcomes, run_evaluation
    from memo_core.cli.options import load_registry, tell_author
    from memo_core.cli.study import experiment_folder
    from memo_core.evaluation.evaluating import unread
    from memo_core.evaluation.references import measure_references
    from memo_core.evaluation.sections import ALL_SECTIONS
    from memo_core.report.films import make_films
    from memo_core.report.writing import write_report
    from memo_core.study.lock import working_in
    from memo_core.study.running import run_study
    from memo_core.study.study import DECIDED, loader, open_study, shared_settings

    folder = experiment_folder(file, out)
    if small and out is None:
        folder = folder.with_name(f"{folder.name}-small")
    given = [*(SMALL if small else ()), *(overrides or ())]
    given += [f"evaluation.jobs={jobs}"] if jobs else []
    registry, took = load_registry(), dict[str, float]()
    study = folder / "study"
    try:
        with _timed(took, "study"):
            load = open_study(registry, file, ALL_SECTIONS, given, study)
            tell_author((*load().notices, *load().unread("a study", DECIDED), *unread(load())))
            at_once = jobs or load().section("evaluation").jobs
            with working_in(folder):
                run_study(load, registry, study, at_once, report=note, stopping=stopping)
        evaluating = loader(registry, file, ALL_SECTIONS, [*given, *shared_settings(folder / "evaluation")])
        with _timed(took, "evaluation"):
            evaluated = run_evaluation(evaluating, folder)
        with stopping() as stop:
            with _timed(took, "references"):
                measure_references(evaluating(), folder / "evaluation", stop, note)
            if films:
                with _timed(took, "films"):
                    make_films(evaluating, registry, folder, stop, note)
    except Stopped as stopped:
        note(f"memo: {stopped}; the same command goes on")
        raise typer.Exit(INTERRUPTED) from None
    with _timed(took, "report"):
        written = write_report(registry, folder)
    shown = evaluated.summary() | {"page": str(written.page), "seconds": took}
    if json:
        print_json(shown)
    else:
        print_outcomes(evaluated)
        print(f"{shown['trials']} trials in {shown['runs']} runs; {sum(took.values()):.0f} s in all")
        print(f"the page to look at: {written.page}")
    exit_for_errors(evaluated)


class _timed:
    """Adds how long a block took (s) to a table."""

    def __init__(self, took: dict[str, float], name: str) -> None:
        self._took, self._name = took, name

    def __enter__(self) -> None:
        self._started = time.monotonic()

    def __exit__(self, *_: Any) -> None:
        self._took[self._name] = round(time.monotonic() - self._started, 1)
