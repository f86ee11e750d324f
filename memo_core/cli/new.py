"""``memo new``: writes a plugin of any kind that works, to start from."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from memo_core.cli.options import Json
from memo_core.cli.output import note, print_json
from memo_core.cli.scaffolds import SCAFFOLDS, Scaffold, write_scaffold
from memo_core.errors import InvalidArgument

app = typer.Typer(help="Write the beginning of a plugin.")

Name = Annotated[str, typer.Argument(help="Lower case and hyphens: put-the-block-on-the-mat, lab-camera.")]
Folder = Annotated[
    Path | None, typer.Option("--folder", "-f", help="Where to write it; default: ./NAME.", metavar="DIR")
]


def _command(scaffold: Scaffold) -> Callable[..., None]:
    def command(name: Name, folder: Folder = None, json: Json = False) -> None:
        _write(scaffold, name, folder, json)

    return command


for _scaffold in SCAFFOLDS.values():
    if _scaffold.kind != "robot":
        app.command(_scaffold.kind, help=_scaffold.about)(_command(_scaffold))


@app.command("robot", help=SCAFFOLDS["robot"].about)
def robot(
    name: Name,
    folder: Folder = None,
    urdf: Annotated[
        Path | None, typer.Option("--urdf", help="Its URDF; without one, an example arm.", metavar="FILE")
    ] = None,
    json: Json = False,
) -> None:
    _write(SCAFFOLDS["robot"], name, folder, json, urdf)


def _write(scaffold: Scaffold, name: str, folder: Path | None, json: bool, urdf: Path | None = None) -> None:
    where = folder or Path(name)
    scaffold.check_name(name)
    _check_free(scaffold, name)
    if where.exists() and (not where.is_dir() or any(where.iterdir())):
        raise InvalidArgument("--folder", f"{where} exists and is not empty", "a new or empty folder")
    written = write_scaffold(scaffold.kind, name, where, urdf)
    # pip takes a bare word for the name of something to download.
    project = where if where.is_absolute() else f"./{where}"
    commands = [f"pip install --editable {project}", *(line.format(name=name) for line in scaffold.next)]
    if json:
        document = {"kind": scaffold.kind, scaffold.kind: name, "files": [str(path) for path in written.files]}
        if scaffold.kind == "task":
            document["suite"] = name
        print_json(document | {"notes": list(written.notes), "next": commands})
        return
    for path in written.files:
        print(path)
    for line in written.notes:
        note(f"memo: {line}")
    print("next:", *commands, sep="\n  ")


def _check_free(scaffold: Scaffold, name: str) -> None:
    """Raise ``InvalidArgument`` for a name that something installed already has: neither could be chosen then."""
    if scaffold.kind == "command":
        from memo_core.cli.app import COMMANDS, plugin_commands

        if name in COMMANDS or name in {point.name for point in plugin_commands()}:
            raise InvalidArgument("NAME", f"there is a command {name!r} already", "another name")
        return
    from memo_core.plugins import Registry

    registry = Registry()
    for backend in registry.backends(scaffold.backend_kind):
        if name == backend.name or name in backend.aliases:
            owner = registry.plugin_of(backend).distribution
            raise InvalidArgument("NAME", f"{owner} has a {scaffold.backend_kind} {name!r} already", "another name")
