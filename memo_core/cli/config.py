"""``memo config``: showing and checking experiment files, and their schema."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import attrs
import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, load, load_registry, one_file
from memo_core.cli.output import note, print_json, print_table

if TYPE_CHECKING:
    from memo_core.config import Experiment

app = typer.Typer(help="Experiment files.")

File = Annotated[Path, typer.Argument(metavar="FILE", help="The experiment file.")]
OptionalFile = Annotated[Path | None, typer.Argument(metavar="[FILE]", help="The experiment file; none: the defaults.")]


@app.command()
def check(file: File, overrides: Overrides = None, json: Json = False) -> None:
    """Report all errors in an experiment file, and what it needs that is missing here. Exit code 0 or 2."""
    from memo_core.config import ConfigErrors

    try:
        _, experiment = load(file, overrides, sections=_all_sections())
        _check_task(experiment)
    except ConfigErrors as errors:
        if not json:
            raise
        print_json({"file": str(file), "valid": False, "errors": [issue.as_json() for issue in errors.issues]})
        raise typer.Exit(errors.exit_code) from None
    missing = _missing(experiment)
    if json:
        print_json({"file": str(file), "valid": True, "errors": [], "missing": missing})
        return
    print(f"{file}: in order" + (", but it cannot be run here yet" if missing else ""))
    for problem in missing:
        note(f"memo: {problem}")


@app.command()
def show(file: OptionalFile = None, config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """Print every value of the resolved experiment and its origin: file and line, --set, or default."""
    _, experiment = load(one_file(file, config), overrides, sections=_all_sections())
    if json:
        shown = [
            {"path": v.path, "value": v.value, "file": v.origin.file, "line": v.origin.line} for v in experiment.values
        ]
        print_json({"values": shown})
        return
    print_table(("key", "value", "from"), [(v.path, _text(v.value), v.origin) for v in experiment.values])


@app.command()
def schema() -> None:
    """Print the JSON Schema of experiment files with the installed plugins, for editors."""
    from memo_core.config.schema import experiment_schema

    print_json(experiment_schema(load_registry(), _all_sections()))


def _all_sections() -> dict[str, type]:
    """Those of a run, a study and an evaluation: they may stand in one file."""
    from memo_core.evaluation.sections import ALL_SECTIONS

    return ALL_SECTIONS


def _check_task(experiment: Experiment) -> None:
    """Raise ``ConfigErrors`` if the task is not in the suite."""
    from memo_core.config import ConfigErrors
    from memo_core.config.errors import Issue
    from memo_core.errors import UnknownName
    from memo_core.runs.factories import task_of

    if experiment.task is None:
        return
    try:
        task_of(experiment, experiment.task)
    except UnknownName as unknown:
        [origin] = [value.origin for value in experiment.values if value.path == "task"]
        raise ConfigErrors((Issue(origin, "task", str(unknown)),)) from None


def _missing(experiment: Experiment) -> list[str]:
    """Requirements of the chosen backends that this machine lacks, such as a key: no mistake of the file."""
    from memo_core.config.experiment import Choice

    values = [*experiment.choices.values(), *experiment.skills]
    for section in experiment.sections.values():
        for value in attrs.asdict(section, recurse=False).values():
            values += value if isinstance(value, tuple) else [value]
    found = [value.unavailable() for value in values if isinstance(value, Choice)]
    return list(dict.fromkeys(str(one) for one in found if one is not None))


def _text(value: object) -> str:
    import json

    return json.dumps(value, ensure_ascii=False)
