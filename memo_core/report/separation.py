"""Whether an evaluation can separate its methods: at floor or ceiling the rates are alike whatever the methods are."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from memo_core.report.findings import Findings
from memo_core.report.tables import rate_of

FLOOR, CEILING = 0.05, 0.95
RULE = (
    f"Floor or ceiling: everything that is compared succeeds in at most {100 * FLOOR:.0f} %, or in at least "
    f"{100 * CEILING:.0f} %, of its trials."
)
Rows = Sequence[dict[str, Any]]


def extreme(rates: Sequence[float]) -> str:
    """Whether several success rates are too alike at an end of the scale to separate methods.

    Args:
        rates: success rates in [0, 1], one for each method that is compared.

    Returns:
        ``floor`` or ``ceiling``; empty if neither, or if there are fewer than two rates.
    """
    if len(rates) < 2:
        return ""
    if all(rate <= FLOOR for rate in rates):
        return "floor"
    return "ceiling" if all(rate >= CEILING for rate in rates) else ""


def warnings_of(findings: Findings) -> list[str]:
    """A sentence for each mode in which all tasks together are at floor or ceiling, else for the tasks that are, for
    all methods with their largest skillbooks and all given skillbooks."""
    return [line for mode in ("zero-shot", "corrected") for line in _of_mode(findings, mode)]


def _of_mode(findings: Findings, mode: str) -> Iterator[str]:
    compared = _compared(findings, mode)
    if at := _at(compared):
        rates = "; ".join(f"{name} {rate_of(rows).text()} of {len(rows)}" for name, rows in compared.items())
        yield f"{mode}: the suite is at its {at} ({rates}). These rates do not separate the methods. {RULE}"
        return
    by_task = {task: _at({name: _of_task(rows, task) for name, rows in compared.items()}) for task in findings.tasks}
    for where in ("floor", "ceiling"):
        if tasks := [task for task, at in by_task.items() if at == where]:
            yield f"{mode}: at {where} for all methods, and separating none of them: {', '.join(tasks)}. {RULE}"


def _compared(findings: Findings, mode: str) -> dict[str, Rows]:
    """The trials of each method with its largest skillbook, and with each given one."""
    found: dict[str, Rows] = {}
    for method in findings.methods:
        found[method] = findings.largest(method, mode)
        for given in dict.fromkeys(row["given"] for row in findings.chosen(method=method, mode=mode) if row["given"]):
            name = f"{method} with {Path(given).stem}"
            found[name] = findings.chosen(method=method, mode=mode, ablation="", given=given)
    return {name: rows for name, rows in found.items() if rows}


def _of_task(rows: Rows, task: str) -> Rows:
    return [row for row in rows if row["task"] == task]


def _at(compared: Mapping[str, Rows]) -> str:
    return extreme([rate_of(rows).value for rows in compared.values() if rows])
