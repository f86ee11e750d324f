"""Progress display and output of benchmarks."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from memo_core.cli.output import print_json, print_table
from memo_core.text.terminal import console


def with_progress(what: str, measure: Callable[[Callable[[float], None]], dict[str, Any]]) -> dict[str, Any]:
    """What ``measure`` found, with the benchmark's name; meanwhile its share of the work is shown on stderr."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console(stderr=True), transient=True) as bar:
        task = bar.add_task(f"measuring {what}", total=None)
        return {"bench": what} | measure(lambda share: bar.update(task, total=1.0, completed=share))


def print_report(measured: dict[str, Any], json: bool) -> None:
    """A table of names and values, or JSON."""
    if json:
        print_json(measured)
        return
    rows = [(name.replace("_", " "), value) for name, value in measured.items() if name != "bench"]
    print_table((measured["bench"], ""), rows)
