"""Output of commands: results on stdout (text for people, one JSON document for programs), everything else on
stderr."""

from __future__ import annotations

import datetime
import json
import sys
import textwrap
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from memo_core.errors import close_match, spelt_alike
from memo_core.text.terminal import console, discard_stdout

if TYPE_CHECKING:
    from rich.progress import Progress


def local_time(moment: float, layout: str = "%Y-%m-%d %H:%M") -> str:
    """``moment`` (s since 1970) for people; the number itself if no calendar has it, as in a damaged book."""
    try:
        return datetime.datetime.fromtimestamp(moment).strftime(layout)
    except (OverflowError, ValueError, OSError):
        return f"{moment:g}"


def note_unknown(kind: str, name: str | None, known: Collection[str]) -> None:
    """Say on stderr that the book has nothing under a name to filter by, or something under a name spelt alike."""
    if name is None:
        return
    alike = spelt_alike(name, known)
    if name not in known:
        note(f"memo: the book has no {kind} {name!r}{close_match(name, known)}")
    elif alike:
        note(f"memo: beside {name!r} the book has the {kind} {' and '.join(map(repr, alike))}")


def print_json(value: Any) -> None:
    """Print one JSON document on stdout.

    Args:
        value: dicts, lists, tuples and scalars. NaN and infinity, which JSON lacks, become null; any other type becomes
            its ``str``.
    """
    print(json.dumps(_finite(value), ensure_ascii=False, indent=2, default=str))


def print_table(columns: Sequence[str], rows: Iterable[Sequence[Any]], width: int = 400) -> None:
    """Print a table for people, without borders, so that cut and grep can process it.

    Args:
        columns: headings.
        rows: one cell for each column; None leaves a cell empty.
        width: characters of a line in a pipe or file, beyond which cells fold; a terminal has its own.
    """
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for column in columns:
        table.add_column(column, overflow="fold")
    for row in rows:
        table.add_row(*(Text("" if cell is None else str(cell)) for cell in row))
    # A pipe has no width: nothing is folded there unless the caller says so.
    console(width=None if sys.stdout.isatty() else width, highlight=False).print(table)


def print_wrapped(line: str, width: int) -> None:
    """A line for people; longer ones go on indented in the next."""
    print(*textwrap.wrap(line, width, subsequent_indent="  ", break_on_hyphens=False), sep="\n")


def progress_bar() -> Progress:
    """A progress bar on stderr, removed when it ends; nothing if stderr is not a terminal."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    shown = console(stderr=True)
    return Progress(*columns, console=shown, transient=True, disable=not shown.is_terminal)


@contextmanager
def while_read() -> Iterator[None]:
    """For output that a closed pipe does not end and whose exit code it does not change. Flushes stdout."""
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        discard_stdout()


def note(line: str) -> None:
    """Print a message for people on stderr.

    Args:
        line: the message, without a final newline.
    """
    print(line, file=sys.stderr, flush=True)


def _finite(value: Any) -> Any:
    if isinstance(value, float) and value - value != 0:
        return None
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return value
