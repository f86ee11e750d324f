"""``memo budget``: spending on language models of the runs that share a ledger."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from memo_core.cli.options import Json
from memo_core.cli.output import print_json, print_table
from memo_core.errors import InvalidArgument


def command(
    ledger: Annotated[Path, typer.Argument(metavar="LEDGER", help="The file that run.study_ledger names.")],
    json: Json = False,
) -> None:
    """Show what the runs that share a ledger have spent: calls, tokens and dollars, per run and in total.

    Calls without a recorded end are "unfinished": their run is still going on or was killed. Their prompt tokens are
    estimates.
    """
    from memo_core.llm.ledger import read_ledger

    if not ledger.is_file():
        problem = "is a folder" if ledger.is_dir() else "does not exist"
        raise InvalidArgument("LEDGER", f"{ledger} {problem}", "the file that run.study_ledger names")
    runs, total = read_ledger(ledger)
    if json:
        print_json({"runs": [{"run": run} | _numbers(spent) for run, spent in runs], "total": _numbers(total)})
        return
    columns = ("run", "calls", "tokens asked", "cached", "answered", "dollars", "unpriced", "unfinished")
    print_table(columns, [(run, *_cells(spent)) for run, spent in runs] + [("together", *_cells(total))])


def _numbers(spent: Any) -> dict[str, Any]:
    import attrs

    return attrs.asdict(spent)


def _cells(spent: Any) -> tuple[Any, ...]:
    cost = f"{spent.cost:.4f}"
    tokens = spent.prompt_tokens, spent.cached_tokens, spent.completion_tokens
    return spent.calls, *tokens, cost, spent.unpriced, spent.unfinished
