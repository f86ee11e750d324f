"""Whether an evaluation can separate its methods: at floor or ceiling the rates are alike whatever the methods are."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from memo_core.report.findings import Findings
from memo_core.report.tables import rate_of

FLOOR, CEILING = 0.05, 0.95
RULE = (
    f"Floor or ceiling: all compared methods succeed in at most {100 * FLOOR:.0f} % or in at least "
    f"{100 * CEILING:.0f} % of their trials, each with its largest skillbook."
)


def warnings_of(findings: Findings) -> list[str]:
    """A sentence for each mode in which all tasks together are at floor or ceiling for the methods compared, and one
    for the tasks that are though the suite is not. Nothing is said of one method alone."""
    return [line for mode in ("zero-shot", "corrected") for line in _of_mode(findings, mode)]


def _of_mode(findings: Findings, mode: str) -> Iterator[str]:
    compared = {method: findings.largest(method, mode) for method in findings.methods}
    compared = {method: rows for method, rows in compared.items() if rows}
    if len(compared) < 2:
        return
    if at := _at(list(compared.values())):
        rates = "; ".join(f"{method} {rate_of(rows).text()} of {len(rows)}" for method, rows in compared.items())
        yield f"{mode}: the suite is at its {at} ({rates}). These rates do not separate the methods. {RULE}"
        return
    for extreme in ("floor", "ceiling"):
        if tasks := [task for task in findings.tasks if _at(_of_task(compared.values(), task)) == extreme]:
            yield f"{mode}: at {extreme} for all methods, and separating none of them: {', '.join(tasks)}. {RULE}"


def _of_task(compared: Any, task: str) -> list[list[dict[str, Any]]]:
    return [[row for row in rows if row["task"] == task] for rows in compared]


def _at(compared: Sequence[Sequence[dict[str, Any]]]) -> str:
    """``floor``, ``ceiling``, or nothing."""
    tried = [rows for rows in compared if rows]
    rates = [rate_of(rows).value for rows in tried]
    tests: dict[str, Callable[[float], bool]] = {"floor": lambda r: r <= FLOOR, "ceiling": lambda r: r >= CEILING}
    return next((name for name, test in tests.items() if len(rates) > 1 and all(map(test, rates))), "")
