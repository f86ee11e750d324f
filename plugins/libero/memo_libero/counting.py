"""Counts of what reference programs did, from the lines that ``memo tasks verify --out`` writes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from memo_core.plugin import InvalidArgument
from memo_libero.settings import PARTS
from memo_libero.tasks import AT_END, EVER

_COMMAND = "memo tasks verify --config examples/libero.yaml --seeds 0-4 --out FILE NAME…; memo suites count FILE"
_NOTE = (
    "episodes by part. Poses from {poses}, JOINT_POSITION at kp 900 and 100 Hz, programs of ours, no model. "
    "These are no comparison with policies that see pictures."
)


def rows_of(files: Sequence[Path]) -> Iterator[dict[str, Any]]:
    """The results in some files, each task and seed once; tasks without a reference program are left out. Raises
    ``InvalidArgument`` for another file."""
    seen: dict[tuple[str, int], dict[str, Any]] = {}
    for file in files:
        try:
            for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1):
                row = json.loads(line)
                if row["measures"] == {}:  # nothing ran
                    continue
                float(row["measures"][EVER])
                seen[row["task"], row["seed"]] = row | {"part": _part(row["task"], f"line {number} of {file}")}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise InvalidArgument("FILE", f"{file} cannot be read ({error})", "a file of memo tasks verify") from None
    yield from seen.values()


def _part(task: str, where: str) -> str:
    """The longest part whose name a task begins with."""
    names = [part for part in PARTS if task.startswith(part.removeprefix("libero_").replace("_", "-") + "-")]
    if not names:
        raise InvalidArgument("FILE", f"{where} is of {task!r}", "tasks of the suite libero")
    return max(names, key=len)


def counted(rows: Iterable[dict[str, Any]], poses: str) -> dict[str, Any]:
    """A table by part, as the documentation's tables are made of.

    Args:
        rows: results of episodes (``rows_of``).
        poses: where the programs had the poses of things from, for the note.

    Returns:
        Command, note and rows.
    """
    by_part: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        by_part.setdefault(row["part"], []).append(row)
    return {
        "command": _COMMAND,
        "note": _NOTE.format(poses=poses),
        "rows": [_row(part, by_part[part]) for part in sorted(by_part, key=PARTS.index)],
    }


def write_table(file: Path, table: dict[str, Any]) -> None:
    """Write a table's data. Raises ``InvalidArgument`` if the file cannot be written."""
    try:
        file.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise InvalidArgument("--out", f"{file} cannot be written ({error.strerror})", "a file in a folder") from None


def _row(part: str, rows: Sequence[dict[str, Any]]) -> dict[str, str]:
    ever, end = (sum(int(row["measures"][name]) for row in rows) for name in (EVER, AT_END))
    return {
        "part": f"`{part}`",
        "tasks": str(len({row["task"] for row in rows})),
        "held at some moment": f"{ever} of {len(rows)}",
        "holds at the end": f"{end} of {len(rows)}",
        "doing nothing": f"{sum(row['null'] for row in rows)} of {len(rows)}",
    }
