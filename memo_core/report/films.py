"""Films of an evaluation: for each method and task a success and a failure, done again with a camera."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import attrs

from memo_core.evaluation.grid import Trial
from memo_core.evaluation.table import read_table
from memo_core.evaluation.trial import Place, film_trial
from memo_core.plugins.registry import Registry
from memo_core.process.stop_switch import StopSwitch
from memo_core.study.participants import Load


@attrs.frozen(eq=False)
class Film:
    """One trial that was filmed: its row, and a file for each attempt at a subtask."""

    row: dict[str, Any]
    files: tuple[Path, ...]


def wanted(rows: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Of the largest book, a success and a failure of each method and task, where there is one."""
    zero_shot = [row for row in rows if row["mode"] == "zero-shot" and not row["ablation"] and not row["given"]]
    most = max((row["hours"] for row in zero_shot if row["hours"] is not None), default=None)
    cells: dict[tuple[str, str, bool], dict[str, Any]] = {}
    for row in zero_shot:
        if row["hours"] in (most, None):
            cells.setdefault((row["method"], row["task"], row["success"]), row)
    yield from cells.values()


def make_films(
    load: Load, registry: Registry, folder: Path, stop: StopSwitch, report: Callable[[str], None] = lambda line: None
) -> int:
    """Film what is wanted and not filmed yet, in ``DIR/evaluation/films``; trials that share a run share a film.
    Returns how many trials were done again. Raises ``MemoError``, ``Stopped``."""
    made = 0
    for row in {row["same_as"]: row for row in wanted(read_table(folder / "evaluation"))}.values():
        stop.check("filming")
        if not _filmed(folder, row):
            report(f"film of {row['same_as']}")
            [original] = [one for one in read_table(folder / "evaluation") if one["trial"] == row["same_as"]]
            film_trial(load, registry, Place(folder), trial_of(original), _folder(folder, row))
            made += 1
    return made


def read_films(folder: Path) -> list[Film]:
    """What was filmed of what is wanted."""
    return [
        Film(row, tuple(sorted((_folder(folder, row) / "video").glob("*.mp4"))))
        for row in wanted(read_table(folder / "evaluation"))
        if _filmed(folder, row)
    ]


def trial_of(row: dict[str, Any]) -> Trial:
    """The trial of a row of the table."""
    names = [field.name for field in attrs.fields(Trial)]
    return Trial(**{name: row[name] for name in names})


def _folder(folder: Path, row: dict[str, Any]) -> Path:
    return folder / "evaluation" / "films" / str(row["same_as"])


def _filmed(folder: Path, row: dict[str, Any]) -> bool:
    return (_folder(folder, row) / "summary.json").exists()
