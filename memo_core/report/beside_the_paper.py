"""The paper's tables beside ours, each figure under its own method and task."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from memo_core.report.findings import Findings
from memo_core.report.paper_layout import consolidation, people, rounds
from memo_core.report.statistics import Outcomes, difference, interval, poolable
from memo_core.report.tables import Table, rate_of, said_by_the_paper
from memo_core.study.journal import Journal

_PAPER, _OURS = "paper", "ours"
_POUR = "pour-the-can"


def paper_tables(findings: Findings) -> list[Table]:
    """The paper's figures, table by table, with our figures beside where there are any."""
    makers = (
        methods_beside_the_paper,
        table_2_beside_the_paper,
        table_1_beside_the_paper,
        people,
        rounds,
        consolidation,
        single_figures,
    )
    return [table for maker in makers if (table := maker(findings)).rows]


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


def single_figures(findings: Findings) -> Table:
    """Single figures of the paper with their places and ours; those that contradict each other stand side by side."""
    told, ours = said_by_the_paper(), _single_figures(findings)
    rows = [
        (row["what"], " or ".join(row["says"]), ours[row["ours"]] or "-", row["where"], row.get("note", ""))
        for row in told["figures"]
    ]
    note = (
        f"{', '.join(told['authors'])}: {told['title']}, {told['source']}. "
        f'"or": the paper gives both. {_not_comparable(findings)}'
    )
    return Table(
        "paper", "What the paper says", ("what", "paper", "ours", "where it stands", "note"), tuple(rows), note
    )


def _single_figures(findings: Findings) -> dict[str, str]:
    """Ours by the names that ``paper_numbers.yaml`` gives them; empty where there is none."""
    largest = {method: findings.largest(method) for method in ("memo", "memo-c", "droc-v")}
    others = [findings.largest(method) for method in findings.methods if method != "memo"]
    pour = [[row for row in largest[method] if row["task"] == _POUR] for method in ("memo-c", "memo")]
    settings = findings.settings.get("evaluation", {})
    return {
        "tasks": f"{len(findings.feedback)}, {len(findings.tasks)}" if findings.feedback or findings.rows else "",
        "sessions": _sessions(findings),
        "hours": _range([journal.active_s / 3600 for journal in findings.journals], "{:.1f} h"),
        "feedback": _range([_pieces(journal) for journal in findings.journals], "{:.0f}"),
        "trials": str(settings["scenes"] * settings["trials"]) if "scenes" in settings else "",
        "limit": str(settings["corrected"]["corrections"]) if "corrected" in settings else "",
        "empty": _rate(findings.zero_shot(method="memo", hours=0.0, given="")),
        "full": _rate(largest["memo"]),
        "next best": _rate(max(others, key=lambda rows: _mean(rows, "success") if rows else -1.0, default=[])),
        "clustering": _gain(largest["memo"], largest["memo-c"]),
        "droc-v": _rate(largest["droc-v"]),
        "pour": ", ".join(_rate(rows) for rows in pour if rows),
        "memo-c": _corrections(findings.largest("memo-c", "corrected")),
    }


def _sessions(findings: Findings) -> str:
    """``40 of 30 minutes``; of all histories."""
    count = sum(len(journal.sessions) for journal in findings.journals)
    return f"{count} of {findings.study['session_minutes']:g} minutes" if count else ""


def _pieces(journal: Journal) -> int:
    """Pieces of feedback in a history."""
    ends = [run.end for run in journal.runs if run.end is not None]
    return sum(end["corrections"] + end["planning_remarks"] for end in ends)


def _range(values: Sequence[float], shown: str) -> str:
    """One value, or the least and the greatest of several histories."""
    texts = list(dict.fromkeys(shown.format(value) for value in sorted(values)))
    return " to ".join(dict.fromkeys((texts[0], texts[-1]))) if texts else ""


def _rate(rows: Sequence[dict[str, Any]]) -> str:
    return f"{rate_of(rows).text()} of {len(rows)}" if rows else ""


def _gain(rows: Sequence[dict[str, Any]], others: Sequence[dict[str, Any]]) -> str:
    both = [Outcomes.of(rows), Outcomes.of(others)]
    return interval(both, difference).text(unit=" points") if rows and others else ""


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
