"""``memo report``: tables, figures and a page about an experiment, or about one run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from memo_core.cli.options import Json, load_registry
from memo_core.cli.output import note, print_json, print_table
from memo_core.errors import InvalidArgument

if TYPE_CHECKING:
    from memo_core.report.comparison import Comparison


def command(
    folder: Annotated[
        Path | None, typer.Argument(metavar="DIR", help="Folder of an experiment, or of one run.")
    ] = None,
    films: Annotated[
        bool, typer.Option("--films", help="First do a success and a failure of each method and task again, filmed.")
    ] = False,
    compare: Annotated[
        tuple[Path, Path] | None,
        typer.Option(
            "--compare", metavar="A B", help="In place of DIR: two evaluations side by side, their settings and rates."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Write the report of an experiment: tables (CSV, Markdown), figures (SVG, PNG) and one page that opens from disk.

    Of one run: a page with its code, words, notes, retrieved entries and films.
    """
    from memo_core.report.writing import write_report

    if compare is not None:
        if folder is not None or films:
            raise InvalidArgument("--compare", "stands alone", "two folders, without DIR or --films")
        _compare(*compare, json)
        return
    if folder is None:
        raise InvalidArgument("DIR", "missing", "the folder of an experiment or a run, or --compare A B")
    registry = load_registry()
    if films:
        _film(folder)
    written = write_report(registry, folder)
    if written.missing:
        note(f"memo: {written.missing}")
    if json:
        print_json({"page": str(written.page), "files": [str(file) for file in written.files]})
    else:
        print(f"{written.page}; {len(written.files)} further files beside it")


def _compare(a: Path, b: Path, json: bool) -> None:
    from memo_core.report.comparison import compare

    compared = compare(a, b)
    if json:
        print_json(compared.summary())
    else:
        _show(compared)


def _show(compared: Comparison) -> None:
    for name, one in (("A", compared.a), ("B", compared.b)):
        failed = f"; not carried out: {one.errors}" if one.errors else ""
        print(f"{name}: {one.folder}; trials: {len(one.rows)}{failed}\n   {one.made_with}")
    print()
    if compared.differing:
        print_table(("setting", "A", "B"), compared.differing)
    else:
        print("no setting differs")
    print()
    rows = [
        (
            rate.method,
            rate.mode,
            rate.book or "–",
            rate.task,
            f"{rate.a.text()} of {rate.a.trials}",
            f"{rate.b.text()} of {rate.b.trials}",
            "-" if rate.difference is None else f"{rate.difference.text(unit=' points')} of {rate.pairs}",
        )
        for rate in compared.rates
    ]
    print_table(("method", "mode", "skillbook", "task", "A", "B", "B - A, of pairs"), rows)
    print(*compared.notes, sep="\n")


def _film(folder: Path) -> None:
    from memo_core.cli.signal_handling import stopping
    from memo_core.evaluation.sections import ALL_SECTIONS
    from memo_core.report.films import make_films
    from memo_core.study.study import loader, shared_settings

    config = folder / "evaluation" / "config.yaml"
    if not config.exists():
        raise InvalidArgument("--films", f"{folder} holds no evaluation", "the --out of memo evaluate")
    registry = load_registry()
    load = loader(registry, config, ALL_SECTIONS, shared_settings(folder / "evaluation"))
    with stopping() as stop:
        make_films(load, registry, folder, stop, note)
