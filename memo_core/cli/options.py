"""Options that several commands share, with one spelling and one help text."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from memo_core.config import Experiment
    from memo_core.plugins.registry import Registry

Json = Annotated[bool, typer.Option("--json", help="Print one JSON document instead of text.")]
ConfigFile = Annotated[
    Path | None,
    typer.Option("--config", "-c", metavar="FILE", help="Experiment file; without it, the plugins' defaults."),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", "-s", metavar="KEY=VALUE", help="Override one value, e.g. run.attempts=2."),
]
Task = Annotated[str | None, typer.Option("--task", "-t", help="The task (memo tasks list).")]
Seed = Annotated[int | None, typer.Option("--seed", min=0, help="Seed of the scene and of everything drawn.")]
MOST_NUMBER = 2**63 - 1  # of an entry or a revision: a database counts no further


def _named(book: str | None) -> str | None:
    """Refuse a blank name, as from an unset variable of the shell: the experiment's book would be taken instead."""
    if book is not None and not book.strip():
        from memo_core.errors import InvalidArgument

        raise InvalidArgument("--book", f"{book!r} names no book", "the path of a file or a database URL")
    return book


Book = Annotated[
    str | None,
    typer.Option(
        "--book",
        "-b",
        metavar="PATH|URL",
        callback=_named,
        help="The skillbook; without it, the experiment's.",
    ),
]


def one_file(file: Path | None, config: Path | None) -> Path | None:
    """The experiment file, given as an argument or with ``--config``. Raises ``InvalidArgument`` for two."""
    if file is not None and config is not None:
        from memo_core.errors import InvalidArgument

        raise InvalidArgument("--config", f"{config} beside {file}", "one file; a file can extend another")
    return file or config


def load_registry() -> Registry:
    """The installed plugins; their problems are reported on stderr."""
    from memo_core.cli.output import note
    from memo_core.plugins.registry import Registry

    registry = Registry()
    for problem in registry.problems:
        note(f"memo: warning: {problem}")
    return registry


def load(
    config: Path | None,
    overrides: list[str] | None,
    task: str | None = None,
    seed: int | None = None,
    sections: Mapping[str, type] | None = None,
) -> tuple[Registry, Experiment]:
    """Load the plugins and check the experiment; notices for its author go to stderr.

    Args:
        config: experiment file; None: the plugins' defaults.
        overrides: values of ``--set``, each ``KEY=VALUE``; None: no overrides.
        task: name of the task; takes precedence over the file.
        seed: seed of the scene and of all random numbers; takes precedence over the file.
        sections: attrs class of each section that belongs to no backend, by name; None: the sections of a run.

    Returns:
        The registry of plugins and the checked experiment.

    Raises:
        ConfigErrors: with all errors of the experiment.
    """
    from memo_core.config import load_experiment
    from memo_core.runs.sections import SECTIONS

    registry = load_registry()
    experiment = load_experiment(registry, config, overrides or (), sections or SECTIONS, task, seed)
    tell_author(experiment.notices)
    return registry, experiment


def tell_author(notices: Iterable[str]) -> None:
    """Notices about an experiment file, on stderr."""
    from memo_core.cli.output import note

    for notice in notices:
        note(f"memo: {notice}")
