"""``memo new``: writes a plugin of any kind that works, to start from."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from memo_core.cli.options import Json
from memo_core.cli.output import note, print_json
from memo_core.cli.scaffolds import SCAFFOLDS, RobotSource, Scaffold, write_scaffold
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
    arguments: Annotated[
        list[str] | None,
        typer.Argument(help="Arguments of a xacro file: ur_type:=ur5e add_gripper:=true.", metavar="KEY:=VALUE"),
    ] = None,
    urdf: Annotated[
        Path | None, typer.Option("--urdf", help="Its URDF or xacro; without one, an example arm.", metavar="FILE")
    ] = None,
    mesh_folder: Annotated[
        list[Path] | None,
        typer.Option(
            "--mesh-folder",
            help="Where meshes and ROS packages that the URDF names lie; may be given several times.",
            metavar="DIR",
        ),
    ] = None,
    skip_missing_meshes: Annotated[
        bool, typer.Option("--skip-missing-meshes", help="Leave out collision shapes whose mesh lies nowhere.")
    ] = False,
    plain_hand: Annotated[
        bool, typer.Option("--plain-hand", help="Put a plain parallel hand in the place of its gripper.")
    ] = False,
    total_mass: Annotated[
        float | None,
        typer.Option(help="Mass of the whole arm: guesses the inertials that its URDF lacks, by volume.", metavar="KG"),
    ] = None,
    json: Json = False,
) -> None:
    if urdf is None and (arguments or mesh_folder or total_mass is not None):
        given = "--mesh-folder" if mesh_folder else (arguments or ["--total-mass"])[0]
        raise InvalidArgument(given, "says more about a URDF, and there is none", "--urdf FILE")
    source = None
    if urdf is not None:
        values = dict(map(_key_and_value, arguments or ()))
        source = RobotSource(urdf, values, tuple(mesh_folder or ()), skip_missing_meshes, plain_hand, total_mass)
    _write(SCAFFOLDS["robot"], name, folder, json, source)


def _key_and_value(argument: str) -> tuple[str, str]:
    key, sign, value = argument.partition(":=")
    if not (key and sign):
        raise InvalidArgument(argument, "is no argument of a xacro file", "KEY:=VALUE, such as ur_type:=ur5e")
    return key, value


def _write(scaffold: Scaffold, name: str, folder: Path | None, json: bool, source: RobotSource | None = None) -> None:
    where = folder or Path(name)
    scaffold.check_name(name)
    _check_free(scaffold, name)
    if where.exists() and (not where.is_dir() or any(where.iterdir())):
        raise InvalidArgument("--folder", f"{where} exists and is not empty", "a new or empty folder")
    written = write_scaffold(scaffold.kind, name, where, source)
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
    from memo_core.plugins.installing import released
    from memo_core.plugins.registry import Registry

    registry = Registry()
    for backend in registry.backends(scaffold.backend_kind):
        if name == backend.name or name in backend.aliases:
            owner = registry.plugin_of(backend).distribution
            right = "another name" if owner in released() else f"another name, or pip uninstall {owner} to begin anew"
            raise InvalidArgument("NAME", f"{owner} has a {scaffold.backend_kind} {name!r} already", right)
