"""Rows of a long measurement, kept as they come, so that an interrupted command continues with the next."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from memo_core.config import load_experiment
from memo_core.errors import InvalidArgument
from memo_core.plugins.registry import Registry
from memo_core.runlog.json_lines import append_line, read_lines
from memo_core.runs.code_digest import code_digest
from memo_core.runs.sections import SECTIONS

Row = dict[str, Any]


def measured_rows(
    out: Path | None,
    bench: str,
    seed: int,
    count: int,
    measure: Callable[[int], Row],
    progress: Callable[[float], None] | None = None,
) -> list[Row]:
    """``measure(0)`` to ``measure(count - 1)``. Rows that ``out`` holds of this seed and of the code as it is are not
    measured again; ``out=None`` keeps nothing. A row may depend on its number and the seed, not on other rows. Raises
    ``InvalidArgument`` for a folder that cannot be used."""
    file = None
    if out is not None:
        code = code_digest(load_experiment(Registry(), sections=SECTIONS))
        file = out / f"{bench}-{seed}-{code}.jsonl"
    rows = {} if file is None else _read(file)
    for number in range(count):
        if number not in rows:
            rows[number] = measure(number)
            if file is not None:
                append_line(file, {"number": number} | rows[number])
        if progress is not None:
            progress((number + 1) / count)
    return [rows[number] for number in range(count)]


def _read(file: Path) -> dict[int, Row]:
    rows: dict[int, Row] = {}
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        for line, row in read_lines(file) if file.exists() else ():
            if not isinstance(row, dict) or not isinstance(row.get("number"), int):
                raise InvalidArgument("--out", f"line {line} of {file} is no row", "a file that this command wrote")
            rows[row.pop("number")] = row
    except OSError as error:
        raise InvalidArgument("--out", f"{file} cannot be used ({error})", "a folder to write to") from None
    return rows
