"""``memo config``: explaining, showing and checking experiment files, and their schema."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import attrs
import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, Seed, Task, load, load_registry, one_file
from memo_core.cli.output import note, print_json, print_table

if TYPE_CHECKING:
    from memo_core.config import Experiment, ShownValue
    from memo_core.config.explanations import Setting

_WIDTH = 110  # characters of a line of an explanation
_INDENT = "    "

app = typer.Typer(help="Experiment files.")

OptionalFile = Annotated[Path | None, typer.Argument(metavar="[FILE]", help="The experiment file; none: the defaults.")]


@app.command()
def check(
    file: OptionalFile = None,
    task: Task = None,
    seed: Seed = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Report all errors in an experiment, and what it needs that is missing here. Exit code 0 or 2."""
    from memo_core.config import ConfigErrors

    given = one_file(file, config)
    name = None if given is None else str(given)
    try:
        _, experiment = load(given, overrides, task, seed, _all_sections())
        _check_task(experiment)
    except ConfigErrors as errors:
        if not json:
            raise
        print_json({"file": name, "valid": False, "errors": [issue.as_json() for issue in errors.issues]})
        raise typer.Exit(errors.exit_code) from None
    missing = _missing(experiment)
    if json:
        print_json({"file": name, "valid": True, "errors": [], "missing": missing})
        return
    print(f"{name or 'the defaults'}: in order" + (", but it cannot be run here yet" if missing else ""))
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
def explain(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="[KEY|SECTION|WORDS]", help="A key (run.attempts, attempts), a section, or words to find."
        ),
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Say what settings mean, with type and default; with --config or --set also their value and its origin."""
    from memo_core.config.explanations import UnknownSetting, all_settings, settings_about, settings_named

    registry = load_registry()
    known = found = all_settings(registry, _all_sections())
    about = False
    if name is not None:
        try:
            found = settings_named(name, known)
        except UnknownSetting:
            found = settings_about(name, known)
            if not found:
                raise
            about = True
    values: dict[str, ShownValue] = {}
    chosen: dict[str, str] = {}
    if config is not None or overrides:
        _, experiment = load(config, overrides, sections=_all_sections())
        values = {one.path: one for one in experiment.values}
        chosen = {path.removesuffix(".backend"): str(one.value) for path, one in values.items()}
    here = [_value_here(one, values, chosen) for one in found]
    if json:
        print_json({"settings": [_explained(one, value) for one, value in zip(found, here, strict=True)]})
        return
    if about:
        note(f"memo: no key and no section is called {name!r}; these settings speak of it:")
        print_table(
            ("key", "meaning"), [(_headline(one), textwrap.shorten(one.meaning, 70, placeholder="…")) for one in found]
        )
        return
    for one, value in zip(found, here, strict=True):
        default = "required" if one.required else f"default {_text(one.default)}"
        print(f"{_headline(one)}  ({one.type}; {default})")
        if one.meaning:
            print(textwrap.fill(one.meaning, _WIDTH, initial_indent=_INDENT, subsequent_indent=_INDENT))
        if value is not None:
            print(f"{_INDENT}here: {_text(value.value)}, from {value.origin}")


def _headline(one: Setting) -> str:
    return one.path + (f" of {one.backend}" if one.backend else "")


def _value_here(one: Setting, values: dict[str, ShownValue], chosen: dict[str, str]) -> ShownValue | None:
    """The value that an experiment gives a setting, unless it chooses another backend than the one that has it."""
    section = one.path.rpartition(".")[0]
    return None if one.backend and chosen.get(section) != one.backend else values.get(one.path)


def _explained(one: Setting, value: ShownValue | None) -> dict[str, object]:
    here = {} if value is None else {"value": value.value, "file": value.origin.file, "line": value.origin.line}
    return {**attrs.asdict(one), **here}


@app.command()
def schema() -> None:
    """Print the JSON Schema of experiment files with the installed plugins, for editors."""
    from memo_core.config.schema import experiment_schema

    print_json(experiment_schema(load_registry(), _all_sections()))


@app.command()
def preset(
    name: Annotated[str, typer.Argument(metavar="NAME", help="The preset, such as paper.")], json: Json = False
) -> None:
    """Print the method's settings in a preset, beside the defaults and what the paper says of each."""
    from memo_core.runs.preset_table import COLUMNS, preset_table

    rows = preset_table(name)
    if json:
        print_json({"preset": name, "settings": [attrs.asdict(row) for row in rows]})
        return
    print_table(COLUMNS, [row.cells for row in rows])


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

    values: list[object] = [*experiment.choices.values(), *experiment.skills]
    settings = [choice.settings for choice in (*experiment.choices.values(), *experiment.skills)]
    for section in (*experiment.sections.values(), *settings):
        for value in attrs.asdict(section, recurse=False).values():
            values += value if isinstance(value, tuple) else [value]
    found = [value.unavailable() for value in values if isinstance(value, Choice)]
    return list(dict.fromkeys(str(one) for one in found if one is not None)) or _unpriced(experiment)


def _unpriced(experiment: Experiment) -> list[str]:
    """Why a limit in dollars cannot be kept, if there is one and the model's price is not known."""
    from memo_core.errors import MemoError
    from memo_core.llm.budget import Budget, Limit
    from memo_core.runs.factories import models_of

    run = experiment.section("run")
    if run.max_cost is None and run.study_max_cost is None:
        return []
    problems = []
    for choice in models_of(experiment):
        llm = choice.create()
        try:
            llm.open()
            Budget(Limit(run.max_cost), study=Limit(run.study_max_cost)).open(llm)
        except MemoError as error:
            problems.append(str(error))
        finally:
            llm.close()
    return problems


def _text(value: object) -> str:
    import json

    return json.dumps(value, ensure_ascii=False)
