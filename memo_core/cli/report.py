"""``memo report``: tables, figures and a page about an experiment, or about one run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from memo_core.cli.options import Json, load_registry
from memo_core.cli.output import note, print_json


def command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of an experiment, or of one run.")],
    films: Annotated[
        bool, typer.Option("--films", help="First do a success and a failure of each method and task again, filmed.")
    ] = False,
    json: Json = False,
) -> None:
    """Write the report of an experiment: tables (CSV, Markdown), figures (SVG, PNG) and one page that opens from disk.

    Of one run: a page with its code, words, notes, retrieved entries and films.
    """
    from memo_core.report.writing import write_report

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


def _film(folder: Path) -> None:
    from memo_core.cli.signal_handling import stopping
    from memo_core.errors import InvalidArgument
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
