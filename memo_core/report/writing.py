"""Writing a report: tables as CSV and Markdown, figures as SVG and PNG, and one HTML page that opens from disk."""

from __future__ import annotations

import base64
import os
from importlib import resources
from pathlib import Path
from typing import Any

import attrs
import jinja2

from memo_core.plugins.installing import install
from memo_core.plugins.registry import Registry
from memo_core.report.beside_the_paper import paper_tables
from memo_core.report.figures import Figure, all_figures
from memo_core.report.films import Film, read_films
from memo_core.report.findings import Findings, gather
from memo_core.report.paper_layout import FILMS, contents
from memo_core.report.run_reader import read_story
from memo_core.report.separation import warnings_of
from memo_core.report.tables import Table, all_tables
from memo_core.runlog.whole_files import write_whole
from memo_core.text.parsing import resolved


@attrs.frozen(eq=False)
class Written:
    """The files that were written; ``missing`` says what the report lacks, and why."""

    page: Path
    files: tuple[Path, ...]
    missing: str = ""


def write_report(registry: Registry, folder: Path) -> Written:
    """The report of an experiment's folder, or of one run's. Raises ``InvalidArgument``."""
    return write_run_page(folder) if (folder / "events.jsonl").exists() else write_experiment_report(registry, folder)


def write_experiment_report(registry: Registry, folder: Path) -> Written:
    """``DIR/report``: index.html, tables.md, and a file a table and figure. Raises ``InvalidArgument``."""
    findings, out = gather(registry, folder), folder / "report"
    figures, missing = _figures(findings, out)
    if not (findings.rows or findings.errors or findings.journals):
        missing = f"{folder} holds no trial and no taught run yet, so the report is empty"
    films = read_films(folder)
    tables, paper = [_with_origin(table, findings) for table in all_tables(findings)], paper_tables(findings)
    made = {table.name for table in (*tables, *paper)} | {figure.name for figure in figures}
    made |= {FILMS} if films else set()
    paper.insert(0, contents(findings, made))
    files = [write_whole(out / f"{table.name}.csv", table.csv()) for table in (*tables, *paper)]
    files += [file for figure in figures for file in (figure.svg, figure.png)]
    warnings = warnings_of(findings)
    told = [f"Made with {findings.made_with}.", *_settings_of_methods(findings), *warnings]
    heading = f"# {_title(folder)}\n\n" + "".join(f"{line}\n\n" for line in told)
    markdown = heading + "\n".join(table.markdown() for table in (*tables, *paper))
    files.append(write_whole(out / "tables.md", markdown))
    page = _templates().get_template("experiment.html.j2")
    html = page.render(
        title=_title(folder),
        findings=findings,
        runs=len({row["same_as"] for row in findings.rows}),
        clock=_clock(findings),
        warnings=warnings,
        method_settings=_settings_of_methods(findings),
        figures=figures,
        tables=tables,
        paper=paper,
        cells=[_cell(film, folder, out) for film in films],
        image=_image,
    )
    return Written(write_whole(out / "index.html", html), tuple(files), missing)


def _with_origin(table: Table, findings: Findings) -> Table:
    """The table, whose note says what its figures were made with."""
    return attrs.evolve(table, note=f"{table.note} Made with {findings.made_with}.".lstrip())


def _settings_of_methods(findings: Findings) -> list[str]:
    return [f"Settings of {method}: {text}." for method, text in findings.method_settings.items()]


def write_run_page(folder: Path) -> Written:
    """``report.html`` in the folder of one run: its code, words, notes, retrieved entries and films."""
    story = read_story(folder)
    html = (
        _templates()
        .get_template("run.html.j2")
        .render(title=folder.name, story=story, relative=lambda path: os.path.relpath(path, folder))
    )
    return Written(write_whole(folder / "report.html", html), ())


def _figures(findings: Findings, out: Path) -> tuple[list[Figure], str]:
    try:
        return all_figures(findings, out), ""
    except ImportError as error:
        return [], f"no figures: {error} ({install('memo-core[experiment]')})"


def _title(folder: Path) -> str:
    return f"Experiment {resolved(folder).name}"


def _clock(findings: Findings) -> str:
    if findings.study.get("clock") != "simulated" or not findings.journals:
        return ""
    timing = findings.study["timing"]
    return (
        "Hours of teaching are by a simulated clock: the robot's own time, and by assumption "
        f"{timing['setup_s']:g} s to set a scene up, {timing['model_s']:g} s for each answer of a language model and "
        f"{timing['remark_s']:g} s for each attempt that somebody judges."
    )


def _cell(film: Film, folder: Path, out: Path) -> dict[str, Any]:
    told = film.row
    return {
        "method": told["method"],
        "task": told["task"],
        "success": told["success"],
        "why": told["why"],
        "reason": told["reason"],
        "trial": told["same_as"],
        "folder": os.path.relpath(folder / "evaluation" / "trials" / told["same_as"] / "run", out),
        "films": [os.path.relpath(file, out) for file in film.files],
    }


def _image(file: Path) -> str:
    """A picture as part of the page."""
    return "data:image/svg+xml;base64," + base64.b64encode(file.read_bytes()).decode()


def _templates() -> jinja2.Environment:
    def load(name: str) -> str:
        return resources.files("memo_core.report").joinpath(name).read_text(encoding="utf-8")

    return jinja2.Environment(loader=jinja2.FunctionLoader(load), autoescape=True, trim_blocks=True)
