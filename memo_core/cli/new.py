"""``memo new``: creates a working plugin to start from."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from memo_core.cli.options import Json
from memo_core.cli.output import print_json
from memo_core.errors import InvalidArgument

app = typer.Typer(help="Write the beginning of a plugin.")

FILES = {"pyproject.toml.j2": "pyproject.toml", "module.py.j2": "memo_{module}.py"}


@app.callback()
def _group() -> None:
    """Keeps ``task`` a command of its own while it is the only one."""


@app.command()
def task(
    name: Annotated[str, typer.Argument(help="What is to be done, with hyphens: put-the-block-on-the-mat.")],
    folder: Annotated[
        Path | None, typer.Option("--folder", "-f", help="Where to write it; default: ./NAME.", metavar="DIR")
    ] = None,
    json: Json = False,
) -> None:
    """Write a plugin with one task: a scene, an instruction, a success check, a reference solution.

    It is a working task, a block to put on a mat; change it into yours.
    """
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        expected = "lower case and hyphens, beginning with a letter, such as " + (_hyphenated(name) or "lift-the-block")
        raise InvalidArgument("NAME", f"{name!r} is no task name", expected)
    where = folder or Path(name)
    if where.exists() and (not where.is_dir() or any(where.iterdir())):
        raise InvalidArgument("--folder", f"{where} exists and is not empty", "a new or empty folder")
    written = write_task(name, where)
    # pip takes a bare word for the name of something to download.
    project = where if where.is_absolute() else f"./{where}"
    commands = [f"pip install --editable {project}", f"memo tasks verify --suite {name} --seeds 0-4"]
    if json:
        print_json({"task": name, "suite": name, "files": [str(path) for path in written], "next": commands})
        return
    for path in written:
        print(path)
    print("next:", *commands, sep="\n  ")


def write_task(name: str, folder: Path) -> list[Path]:
    """Render the skeleton into a folder, which is made; returns the files. Raises ``InvalidArgument`` when it cannot be
    written."""
    from jinja2 import Environment, StrictUndefined

    words = name.split("-")
    values = {
        "name": name,
        "instruction": " ".join(words),
        "module": "_".join(words),
        "class_name": "".join(word.capitalize() for word in words),
    }
    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True, autoescape=False)
    skeleton = resources.files("memo_core.cli.skeletons") / "task"
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for template, target in FILES.items():
            text = environment.from_string((skeleton / template).read_text(encoding="utf-8")).render(values)
            path = folder / target.format(**values)
            path.write_text(text, encoding="utf-8")
            written.append(path)
    except OSError as error:
        raise InvalidArgument("--folder", f"{folder}: {error.strerror}", "a folder that can be written") from None
    return written


def _hyphenated(name: str) -> str:
    words = re.sub(r"[^a-z0-9]+", "-", re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", name).lower())
    return re.sub(r"^[^a-z]+|-+$", "", words)
