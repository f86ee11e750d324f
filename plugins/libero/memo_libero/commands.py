"""``memo suites``: other people's benchmarks, each with its own Python."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from memo_core.cli import Json, agreed, note, print_json, print_table
from memo_core.plugin import InvalidArgument, UnknownName
from memo_libero.environment import GIGABYTES, SUITE, VERSION, folder

app = typer.Typer(help="Other people's benchmarks, each in an environment of its own.")

Folder = Annotated[
    Path | None,
    typer.Option("--folder", metavar="DIR", help="Where the environment is, or goes; the default is a cache."),
]


@app.command("list")
def list_suites(where: Folder = None, json: Json = False) -> None:
    """Show which suites can be installed, whether they are, and what is left out of them."""
    from memo_libero.installing import found
    from memo_libero.settings import LEFT_OUT, PARTS

    at = where or folder()
    versions = found(at)
    if json:
        told = {"suite": SUITE, "folder": str(at), "installed": versions, "parts": list(PARTS), "left_out": LEFT_OUT}
        print_json({"suites": [told]})
        return
    state = ", ".join(f"{name} {version}" for name, version in versions.items()) or f"not installed ({GIGABYTES} GB)"
    print_table(("suite", "folder", "state", "parts"), [(SUITE, str(at), state, str(len(PARTS)))])
    for part, why in LEFT_OUT.items():
        note(f"left out: {part}: {why}")


@app.command()
def count(
    files: Annotated[list[Path], typer.Argument(help="Files that `memo tasks verify --out` wrote.")],
    out: Annotated[Path | None, typer.Option("--out", metavar="FILE", help="Also write the table's data here.")] = None,
    poses: Annotated[
        str, typer.Option("--poses", metavar="TEXT", help="For the note: where poses came from, such as 'two cameras'.")
    ] = "simulator state",
    settings: Annotated[
        list[str] | None, typer.Option("--set", "-s", metavar="KEY=VALUE", help="For the command: as verify was given.")
    ] = None,
    json: Json = False,
) -> None:
    """Count what reference programs did on LIBERO, by part: by LIBERO's rule, and at the end."""
    from memo_libero.counting import counted, rows_of, write_table

    table = counted(rows_of(files), poses, settings or ())
    if out is not None:
        write_table(out, table)
    if json:
        print_json(table)
        return
    print_table(tuple(table["rows"][0]), [tuple(row.values()) for row in table["rows"]])


@app.command()
def install(
    suite: Annotated[str, typer.Argument(help=f"Which one: {SUITE}.")],
    newest: Annotated[
        bool, typer.Option("--newest", help="The newest MuJoCo instead of the published stack (MuJoCo 2.3.7).")
    ] = False,
    python: Annotated[
        Path | None,
        typer.Option("--python", metavar="FILE", help="Interpreter to make it with; published stack: 3.10 or 3.11."),
    ] = None,
    where: Folder = None,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do not ask first.")] = False,
    json: Json = False,
) -> None:
    """Make a suite's environment: a Python of its own with the suite in it.

    What is there already is left as it is; what an interrupted installation left is made anew.
    """
    from memo_libero.installing import Recipe, found, make

    if suite != SUITE:
        raise UnknownName("suite to install", suite, (SUITE,))
    at = (where or folder()).expanduser().absolute()
    versions = found(at)
    if not versions:
        recipe = Recipe(newest, python)
        maker = recipe.interpreter()
        note(f"{recipe.requirement} from your package index into {at}")
        note(f"needs {GIGABYTES} GB of disk and about a minute; MuJoCo runs in it beside MEMO's own")
        note("licences: code MIT, data CC BY 4.0; meshes have licences of their own")
        if not yes and not agreed(f"Install LIBERO-PRO {VERSION}? [y/n]"):
            raise InvalidArgument("the answer", "not yes: nothing was installed", "y, or --yes")
        versions = make(at, maker, recipe)
    told = {"suite": SUITE, "folder": str(at), "python": str(at / "bin" / "python"), "versions": versions}
    if json:
        print_json(told)
        return
    print(f"{SUITE} is ready in {at}: {', '.join(f'{name} {version}' for name, version in versions.items())}")
    if where is not None:
        python_file = told["python"]
        print(f"not the default folder: set suite.python and simulator.python to {python_file}")
