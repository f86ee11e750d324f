"""``memo prompts``: shows and copies the prompt files; nothing is added to them in code."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, load
from memo_core.cli.output import print_json, print_table
from memo_core.errors import UnknownName

app = typer.Typer(help="Prompts.")


@app.command("list")
def list_(config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """List the prompts in use: version, digest, and the file if one replaces the built-in text."""
    from memo_core.llm.prompt_files import PLACEHOLDERS

    texts = _texts(config, overrides)
    if json:
        print_json({"prompts": {name: _about(text) for name, text in texts.items()}})
        return
    rows = [(t.name, t.version or "?", t.digest, t.source, ", ".join(PLACEHOLDERS[t.name])) for t in texts.values()]
    print_table(("prompt", "version", "digest", "from", "placeholders"), rows)


@app.command()
def show(
    phase: Annotated[
        str | None, typer.Argument(help="system, plan, code, feedback, template, …, or skills; none: all.")
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Print a phase's prompt with its placeholders; `skills` prints the documentation of the skills that is
    inserted."""
    from memo_core.llm.prompt_files import PLACEHOLDERS
    from memo_core.runs.factories import library_of
    from memo_core.skills.contract import documentation

    known = (*PLACEHOLDERS, "skills")
    if phase is not None and phase not in known:
        raise UnknownName("prompt", phase, known)
    texts = _texts(config, overrides) if phase != "skills" else {}
    shown = {name: text for name, text in texts.items() if phase in (None, name)}
    bodies = {name: text.text for name, text in shown.items()}
    if phase in (None, "skills"):
        bodies["skills"] = documentation(library_of(load(config, overrides)[1]))
    if json:
        print_json({"prompts": bodies, "versions": {name: _about(text) for name, text in shown.items()}})
    elif phase is not None:
        print(bodies[phase])
    else:
        for name, body in bodies.items():
            title = f"{shown[name].stamp} ({shown[name].source})" if name in shown else name
            print(f"{'=' * 12} {title} {'=' * max(4, 106 - len(title))}\n{body}")


@app.command()
def export(
    folder: Annotated[Path, typer.Argument(help="A new or empty folder.")],
    config: ConfigFile = None,
    overrides: Overrides = None,
) -> None:
    """Copy the prompts to a folder, to edit them there and use them with `prompts: {folder: …}` in a config."""
    from memo_core.errors import InvalidArgument
    from memo_core.llm.prompt_files import SUFFIX

    texts = _texts(config, overrides)
    there = [name + SUFFIX for name in texts if (folder / (name + SUFFIX)).exists()]
    if there:
        raise InvalidArgument("folder", f"{folder} already holds {', '.join(there)}", "a new or empty folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for text in texts.values():
            front = f"---\nversion: {text.version}\n---\n" if text.version else ""
            (folder / (text.name + SUFFIX)).write_text(front + text.text, encoding="utf-8")
    except OSError as error:
        raise InvalidArgument("folder", f"{folder}: {error.strerror}", "a folder that can be written") from None
    print(f"{len(texts)} prompts in {folder}; use them with --set prompts.folder={folder}")


def _texts(config: Path | None, overrides: list[str] | None) -> dict[str, Any]:
    from memo_core.llm.prompt_files import PLACEHOLDERS
    from memo_core.runs.factories import prompts_of

    prompts = prompts_of(load(config, overrides)[1])
    return {name: prompts.text(name) for name in PLACEHOLDERS}


def _about(text: Any) -> dict[str, str]:
    return {"version": text.version, "digest": text.digest, "from": text.source}
