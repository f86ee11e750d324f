"""The table of an evaluation: a row a trial, as JSON lines and as Parquet."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from memo_core.evaluation.grid import Trial
from memo_core.evaluation.trial import Place
from memo_core.runlog.json_lines import read_lines
from memo_core.runlog.whole_files import write_whole

TRIALS, ERRORS = "trials.jsonl", "errors.jsonl"
VARYING = ("wall_s", "cost")  # columns that a repeated evaluation may have other values in
NUMBERS = ("hours", "robot_s", "wall_s", "cost")


def rows_of(place: Place, trials: Sequence[Trial]) -> list[dict[str, Any]]:
    """The rows of the trials that are over, in the grid's order."""
    return [row for trial in trials if (row := place.row(trial)) is not None]


def has_memory(row: Mapping[str, Any]) -> bool:
    """Whether a row is of a method with a skillbook, empty or not. Tables of former versions lack the column."""
    return bool(row.get("memory", row["history"] is not None or bool(row.get("given"))))


def book_name(row: Mapping[str, Any]) -> str:
    """The skillbook of a row: the hours of teaching, or the name of a given one; empty for none."""
    if row["given"]:
        return Path(row["given"]).stem
    return f"{row['hours']:g} h" if has_memory(row) and row["hours"] is not None else ""


def outcomes(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Trials and successes of each method, ablation, skillbook and mode, which are never added up."""
    found: dict[tuple[str, str, str, str], list[bool]] = {}
    for row in rows:
        found.setdefault((row["method"], row["ablation"], book_name(row), row["mode"]), []).append(row["success"])
    names = ("method", "ablation", "skillbook", "mode")
    return [
        dict(zip(names, key, strict=True)) | {"trials": len(done), "successes": sum(done)}
        for key, done in found.items()
    ]


def write_table(folder: Path, rows: Sequence[dict[str, Any]], errors: Sequence[dict[str, Any]] = ()) -> None:
    """``trials.jsonl`` and, where pyarrow is installed, ``trials.parquet``; ``errors.jsonl`` with the trials that could
    not be carried out."""
    write_whole(folder / TRIALS, _lines(rows))
    if errors:
        write_whole(folder / ERRORS, _lines(errors))
    else:
        (folder / ERRORS).unlink(missing_ok=True)
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        return
    if rows:
        floats = [row | {name: None if row[name] is None else float(row[name]) for name in NUMBERS} for row in rows]
        part = folder / "trials.parquet.part"
        pyarrow.parquet.write_table(pyarrow.Table.from_pylist(floats), part)
        part.rename(folder / "trials.parquet")


def _lines(rows: Sequence[dict[str, Any]]) -> str:
    return "".join(json.dumps(row, ensure_ascii=False) + "\n" for row in rows)


def read_table(folder: Path, name: str = TRIALS) -> list[dict[str, Any]]:
    """The rows of ``TRIALS`` or ``ERRORS``; none where there is no such file."""
    file = folder / name
    return [line for _, line in read_lines(file) if line is not None] if file.exists() else []
