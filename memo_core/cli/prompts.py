"""``memo prompts``: the texts that language models are sent, as they are in the code: nothing is added in secret."""

from __future__ import annotations

from typing import Annotated

import typer

from memo_core.cli.options import ConfigFile, Json, Overrides, load
from memo_core.cli.output import print_json
from memo_core.errors import UnknownName

app = typer.Typer(help="Prompts.")


@app.command()
def show(
    phase: Annotated[
        str | None, typer.Argument(help="system, plan, code, feedback, template, skills; none: all.")
    ] = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Print a phase's prompt with its placeholders; `skills` is the documentation of the skills that goes into one."""
    from memo_core.experiment.assembly import library_of
    from memo_core.policy.prompting import PHASES, prompt_source

    known = ("system", *PHASES, "skills")
    if phase is not None and phase not in known:
        raise UnknownName("prompt", phase, known)
    texts = {name: prompt_source(name) for name in known if name != "skills" and phase in (None, name)}
    if phase in (None, "skills"):
        library = library_of(load(config, overrides)[1])
        texts["skills"] = "\n\n".join(skill.documentation() for skill in library.values())
    if json:
        print_json({"prompts": texts})
    elif phase is not None:
        print(texts[phase])
    else:
        for name, text in texts.items():
            print(f"{'=' * 12} {name} {'=' * (106 - len(name))}\n{text}")
