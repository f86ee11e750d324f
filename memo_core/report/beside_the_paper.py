"""The paper's tables beside ours, each figure under its own method and task."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from memo_core.report.findings import Findings
from memo_core.report.statistics import poolable
from memo_core.report.tables import Table, paper_numbers, rate_of, said_by_the_paper

_PAPER, _OURS = "paper", "ours"


def paper_tables(findings: Findings) -> list[Table]:
    """The paper's figures, table by table, with our figures beside where there are any."""
    makers = (methods_beside_the_paper, table_2_beside_the_paper, table_1_beside_the_paper)
    return [*(maker(findings) for maker in makers), paper_numbers()]


def methods_beside_the_paper(findings: Findings) -> Table:
    said = said_by_the_paper()
    rows = []
    for method in dict.fromkeys((*said["table_2"]["overall"], *said["zero_shot"], *findings.methods)):
        zero, watched = findings.largest(method), findings.largest(method, "corrected")
        stated, real = said["zero_shot"].get(method), said["table_2"]["overall"].get(method, [])
        rows.append(
            (
                method,
                _percent(zero),
                " or ".join(stated["says"]) if stated else "-",
                _percent(watched),
                f"{real[0]} %" if real else "-",
                _corrections(watched),
                f"{real[1]:g}" if len(real) > 1 else "-",
            )
        )
    columns = (
        "method",
        "zero-shot, ours",
        "zero-shot, paper (simulation)",
        "corrected, ours",
        "corrected, paper (real robot)",
        "corrections a trial, ours",
        "feedback a task, paper",
    )
    note = f"Zero-shot: {_places(said['zero_shot'])}. Corrected: Table II. {_not_comparable(findings)}"
    return Table("paper-methods", "Methods beside the paper's", columns, tuple(rows), note)


def table_2_beside_the_paper(findings: Findings) -> Table:
    said = said_by_the_paper()["table_2"]
    stated = {_name(row["task"]): row for row in said["tasks"]}
    watched = [row for method in findings.methods for row in findings.largest(method, "corrected")]
    methods = tuple(dict.fromkeys((*said["overall"], *(row["method"] for row in watched))))
    rows: list[tuple[Any, ...]] = []
    for task in dict.fromkeys((*stated, *(row["task"] for row in watched))):
        if task in stated:
            rows.append((task, _PAPER, *(_cell(stated[task].get(method, [])) for method in methods)))
        if any(row["task"] == task for row in watched):
            rows.append((task, _OURS, *_our_cells(watched, methods, task)))
    rows.append(("all", _PAPER, *(_cell(said["overall"].get(method, [])) for method in methods)))
    if watched:
        rows.append(("all", _OURS, *_our_cells(watched, methods)))
    note = (
        "A cell: success in %, in brackets the average number of corrections. The paper: five attempts on a real "
        f"robot, at most five pieces of feedback an attempt. {_not_comparable(findings)}"
    )
    return Table("paper-table-2", "Table II beside the paper's", ("task", "whose", *methods), tuple(rows), note)


def table_1_beside_the_paper(findings: Findings) -> Table:
    said = said_by_the_paper()["table_1"]
    ours = {row["task"]: row["corrections"] + row["plan_remarks"] for row in findings.feedback}
    histories = max(1, len(findings.journals))
    stated = {_name(row["task"]): row for row in (*said["training"], *said["held_out"])}
    rows: list[tuple[Any, ...]] = []
    for task in dict.fromkeys((*stated, *ours)):
        row = stated.get(task, {})
        rows.append((task, row.get("type", "-"), row.get("feedback", "-"), _a_history(ours.get(task), histories)))
    rows.append(("all", "", said["total"], _a_history(sum(ours.values()) if ours else None, histories)))
    columns = ("task", "type", "feedback, paper", "corrections a history, ours")
    note = f"The paper: all three rounds together, in simulation. {_not_comparable(findings)}"
    return Table("paper-table-1", "Table I beside the paper's", columns, tuple(rows), note)


def _not_comparable(findings: Findings) -> str:
    return (
        f"Ours: {findings.made_with}. Where model, robot or people differ from "
        "the paper's, a difference says nothing about the methods."
    )


def _places(zero_shot: dict[str, Any]) -> str:
    return "; ".join(f"{method} {stated['where']}" for method, stated in zero_shot.items())


def _our_cells(watched: Sequence[dict[str, Any]], methods: Sequence[str], task: str | None = None) -> list[str]:
    """Cells of our corrected trials, by method; of one task or of all."""
    cells = []
    for method in methods:
        rows = [row for row in watched if row["method"] == method and task in (None, row["task"])]
        cells.append(_cell([100 * _mean(rows, "success"), _mean(rows, "corrections")] if rows else []))
    return cells


def _cell(figures: Sequence[float]) -> str:
    """``88 (1.52)``; without brackets where no corrections are given."""
    corrections = f" ({figures[1]:.3g})" if len(figures) > 1 else ""
    return f"{figures[0]:.0f}{corrections}" if figures else "-"


def _percent(rows: Sequence[dict[str, Any]]) -> str:
    return f"{rate_of(rows).text()} of {len(rows)}" if rows else "-"


def _corrections(rows: Sequence[dict[str, Any]]) -> str:
    return f"{_mean(rows, 'corrections'):.3g}" if rows else "-"


def _mean(rows: Sequence[dict[str, Any]], column: str) -> float:
    return sum(float(row[column]) for row in poolable(rows)) / len(rows)


def _a_history(count: int | None, histories: int) -> str:
    return "-" if count is None else f"{count / histories:.3g}"


def _name(task: str) -> str:
    """MEMO's name of a task that the paper names in words."""
    return task.lower().replace(" ", "-")
