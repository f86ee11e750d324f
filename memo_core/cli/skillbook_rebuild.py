"""``memo skillbook rebuild``: a method's book, rebuilt from the feedback in another book."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Annotated, Any

import attrs
import typer

from memo_core.cli.options import Book, ConfigFile, Json, Overrides, load
from memo_core.cli.output import note, print_json
from memo_core.cli.signal_handling import INTERRUPTED, stopping
from memo_core.errors import InvalidArgument, Stopped


def register(app: typer.Typer) -> None:
    """Add the command to ``memo skillbook``."""
    app.command()(rebuild)


def rebuild(
    out: Annotated[Path, typer.Option("--out", "-o", help="File of the new book.")],
    method: Annotated[str, typer.Option("--method", help="A method with a skillbook, also of a plugin.")] = "memo",
    until: Annotated[
        str | None, typer.Option("--until", help="Up to this feedback's number, or before a time (2026-01-31T12:00).")
    ] = None,
    book: Book = None,
    config: ConfigFile = None,
    overrides: Overrides = None,
    json: Json = False,
) -> None:
    """Make a method's book from what people said, in the order in which they said it.

    A model is asked only about words that nothing was made of yet, and to condense (memo). Its answers are kept in the
    book that is read, so that the same command makes the same book again.
    """
    from memo_core.maintenance.rebuild_book import rebuild_book
    from memo_core.runs.factories import book_of

    if out.exists():
        raise InvalidArgument("--out", f"{out} exists already", "a new file")
    end = _until(until)
    registry, experiment = load(config, overrides)
    made_for = registry.get("method", method)
    if not made_for.memory.any:
        raise InvalidArgument("--method", f"{made_for.name!r} has no skillbook", "a method that has one, such as memo")
    with book_of(experiment, book, read_only=True):
        pass  # a mistyped path is an error, not a new empty book
    try:
        with stopping() as stop, book_of(experiment, book, read_only=False) as source:
            result = rebuild_book(experiment, source, out, made_for.name, made_for.memory, end, stop)
    except Stopped:
        note(f"memo: stopped; {out} is not whole and is removed; answers so far are kept")
        raise typer.Exit(INTERRUPTED) from None
    shown: dict[str, Any] = {"book": str(out), "method": made_for.name} | attrs.asdict(result)
    if json:
        print_json(shown)
        return
    print(
        f"{out}: {result.entries} entries from {result.feedback} pieces of feedback; {result.read_backs} read-backs "
        f"applied, {result.clusters} clusters; {result.asked} questions asked, {result.kept} answered from before"
    )
    if result.unmatched:
        note(f"{result.unmatched} read-backs are of notes that this book has none like")


def _until(text: str | None) -> int | float | None:
    if text is None or text.isdecimal():
        return None if text is None else int(text)
    try:
        return datetime.datetime.fromisoformat(text).timestamp()
    except ValueError:
        expected = "the number of a feedback, or a date and time such as 2026-01-31T12:00"
        raise InvalidArgument("--until", f"{text!r} is neither", expected) from None
