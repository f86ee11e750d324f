"""``memo skills list``: the functions that robot code may call, the robot's own and those of a skillbook."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import typer

from memo_core.cli.options import Book, ConfigFile, Json, Overrides, load
from memo_core.cli.output import print_json, print_table

if TYPE_CHECKING:
    from memo_core.skillbook.functions import FunctionRecord

app = typer.Typer(help="Functions that robot code may call.")


@app.callback()
def _group() -> None: ...


@app.command("list")
def list_skills(book: Book = None, config: ConfigFile = None, overrides: Overrides = None, json: Json = False) -> None:
    """List the robot's functions and those learnt: where each was tested, by whom it was taught, how often approved."""
    from memo_core.runs.factories import book_of, library_of
    from memo_core.skillbook.functions import functions_of, record_of

    _, experiment = load(config, overrides)
    robot = [(skill.name, skill.signature, _first_sentence(skill.doc)) for skill in library_of(experiment).values()]
    opened = book_of(experiment, book, read_only=True)
    learnt = []
    if opened.is_there or book is not None:
        with opened:
            learnt = [record_of(opened, one) for one in functions_of(opened)]
    if json:
        own = [{"name": name, "signature": signature, "summary": summary} for name, signature, summary in robot]
        print_json({"robot": own, "learnt": [_as_json(one) for one in learnt]})
        return
    print_table(("the robot's", ""), [(signature, summary) for _, signature, summary in robot])
    print()
    columns = ("learnt", "", "stands for", "tested", "taught by", "approved/served")
    print_table(columns, [_row(one) for one in learnt]) if learnt else print(
        "no function was learnt yet (memo cluster)"
    )


def _first_sentence(text: str) -> str:
    return re.split(r"(?<=[\w)]{2}\.) ", " ".join(text.split()), maxsplit=1)[0]


def _row(one: FunctionRecord) -> tuple[Any, ...]:
    function, entry = one.learnt.function, one.learnt.entry
    stands_for = ", ".join(str(call.key) for call in one.learnt.calls)
    used = f"{entry.confirmed_uses}/{entry.uses}"
    return (
        function.signature,
        _first_sentence(function.docstring),
        stands_for,
        one.tested,
        ", ".join(one.people),
        used,
    )


def _as_json(one: FunctionRecord) -> dict[str, Any]:
    function, entry = one.learnt.function, one.learnt.entry
    return {
        "entry": entry.id,
        "name": function.name,
        "signature": function.signature,
        "docstring": function.docstring,
        "calls": [
            {
                "entry": call.id,
                "key": str(call.key),
                "call": call.text,
                "trials": [
                    {"start": trial.start, "success": trial.success, "reason": trial.reason}
                    for trial in one.trials.get(call.id, [])
                ],
            }
            for call in one.learnt.calls
        ],
        "tested": one.standing.tested,
        "people": list(one.people),
        "confirmed_uses": entry.confirmed_uses,
        "uses": entry.uses,
    }
