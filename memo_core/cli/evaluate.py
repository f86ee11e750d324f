"""``memo evaluate``: methods and books compared on held-out tasks."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from json import dumps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from memo_core.cli.options import Json, Overrides
from memo_core.cli.output import note, print_json, print_table, progress_bar
from memo_core.cli.signal_handling import INTERRUPTED, stopping
from memo_core.errors import Stopped
from memo_core.text.parsing import resolved

if TYPE_CHECKING:
    from memo_core.evaluation.evaluating import Evaluated
    from memo_core.study.participants import Load

Jobs = Annotated[int | None, typer.Option("--jobs", "-j", min=1, help="Trials at once.")]
Out = Annotated[
    Path | None, typer.Option("--out", "-o", metavar="DIR", help="Folder of the experiment; default: experiments/FILE.")
]


def command(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Experiment file with a section `evaluation`.")],
    out: Out = None,
    overrides: Overrides = None,
    ablation: Annotated[
        list[str] | None,
        typer.Option("--ablation", help="Also memo's largest book changed so; `all` for every change."),
    ] = None,
    book: Annotated[
        list[Path] | None,
        typer.Option(
            "--book", "-b", help="Also this book, of another study or simulator; or `empty`, or the suite's `lessons`."
        ),
    ] = None,
    model_in_the_loop: Annotated[
        bool,
        typer.Option("--model-in-the-loop", help="Every trial asks the model afresh, and keeps a recording of it."),
    ] = False,
    replay: Annotated[
        Path | None, typer.Option("--replay", metavar="DIR", help="Answer from the recordings of this experiment.")
    ] = None,
    engine: Annotated[str | None, typer.Option("--engine", help="joblib, or ray for a cluster.")] = None,
    jobs: Jobs = None,
    json: Json = False,
) -> None:
    """Compare methods on tasks that nobody taught, with the book that each would have after some hours of teaching.

    Every trial leaves a folder like that of any run, and a row in evaluation/trials.jsonl and .parquet. Killed or
    stopped at any moment, the same command goes on.
    """
    from memo_core.cli.options import load_registry, tell_author
    from memo_core.cli.study import experiment_folder
    from memo_core.evaluation.evaluating import unread
    from memo_core.evaluation.sections import ALL_SECTIONS
    from memo_core.evaluation.settings import ABLATIONS
    from memo_core.study.study import loader, shared_settings

    given = list(overrides or ())
    if ablation:
        given.append(f"evaluation.ablations={dumps(list(ABLATIONS) if 'all' in ablation else ablation)}")
    if book:
        given.append(f"evaluation.books={dumps([_book(one) for one in book])}")
    given += ["evaluation.record=true", "evaluation.reuse=false"] if model_in_the_loop else []
    given += [f"evaluation.replay={dumps(str(resolved(replay)))}"] if replay else []
    given += [f"evaluation.engine={engine}"] if engine else []
    given += [f"evaluation.jobs={jobs}"] if jobs else []
    folder = experiment_folder(file, out)
    load = loader(load_registry(), file, ALL_SECTIONS, [*given, *shared_settings(folder / "evaluation")])
    tell_author((*load().notices, *unread(load())))
    evaluated = run_evaluation(load, folder)
    shown = evaluated.summary()
    if json:
        print_json(shown)
    else:
        print_outcomes(evaluated)
        print(f"{shown['trials']} trials in {shown['runs']} runs, {shown['wall_s']:.0f} s")
        print(f"kept in {folder / 'evaluation'}; the report: memo report {folder}")
    exit_for_errors(evaluated)


def print_outcomes(evaluated: Evaluated) -> None:
    """Print how many trials succeeded, by method, skillbook and mode; intervals are in the report."""
    rows = [
        (one["method"], one["ablation"], one["skillbook"] or "–", one["mode"], f"{one['successes']} of {one['trials']}")
        for one in evaluated.summary()["outcomes"]
    ]
    if rows:
        print_table(("method", "ablation", "skillbook", "mode", "succeeded"), rows)


def exit_for_errors(evaluated: Evaluated) -> None:
    """Say which trials could not be carried out, and exit with 1 if there are any."""
    from memo_core.runs.run_errors import RunError, told

    if not evaluated.errors:
        return
    errors = [RunError(one["cause"], one["problem"], one["persistent"]) for one in evaluated.errors]
    said = f"{len(errors)} of {len(evaluated.rows) + len(errors)} trials could not be carried out"
    note(f"memo: {said} and are in no rate: {told(errors)}; the same command does them again")
    raise typer.Exit(1)


def _book(named: Path) -> str:
    from memo_core.evaluation.settings import EMPTY, LESSONS

    return str(named) if str(named) in (EMPTY, LESSONS) else str(resolved(named))


def run_evaluation(load: Load, folder: Path) -> Evaluated:
    """The evaluation with a progress bar, which a person at a real robot, who is asked there, does not get. Exits with
    130 when it was stopped."""
    from memo_core.evaluation.evaluating import Standing, evaluate
    from memo_core.evaluation.on_hardware import is_hardware
    from memo_core.study.lock import working_in

    shown: AbstractContextManager[Any] = nullcontext() if is_hardware(load()) else progress_bar()
    with working_in(folder), shown as bar, stopping() as stop:
        task: Any = None if bar is None else bar.add_task("trials", total=None)

        def show(standing: Standing) -> None:
            left = "" if standing.left_s is None else f", about {standing.left_s / 60:.0f} min left"
            if bar is not None:
                bar.update(task, total=standing.planned, completed=standing.done, description=f"trials{left}")

        try:
            return evaluate(load, folder, stop, note, show)
        except Stopped as stopped:
            note(f"memo: {stopped}")
            raise typer.Exit(INTERRUPTED) from None
