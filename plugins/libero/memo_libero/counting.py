"""Counts of what reference programs did, from the lines that ``memo tasks verify --out`` writes."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterable, Iterator, Sequence
from itertools import takewhile
from pathlib import Path
from typing import Any

from memo_core.plugin import InvalidArgument
from memo_libero.settings import PARTS
from memo_libero.tasks import AT_END, EVER

_COMMAND = (
    "memo tasks verify --config examples/libero.yaml --seeds {seeds}{settings} --out FILE {names}; "
    "memo suites count FILE"
)
_NOTE = (
    "{episodes} by part. Poses from {poses}, JOINT_POSITION at kp 900 and 100 Hz, programs of ours, no model. "
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
    names = [part for part in PARTS if task.startswith(_beginning(part))]
    if not names:
        raise InvalidArgument("FILE", f"{where} is of {task!r}", "tasks of the suite libero")
    return max(names, key=len)


def _beginning(part: str) -> str:
    """Beginning of the names of a part's tasks."""
    return part.removeprefix("libero_").replace("_", "-") + "-"


def counted(rows: Iterable[dict[str, Any]], poses: str, settings: Sequence[str] = ()) -> dict[str, Any]:
    """A table by part, as the documentation's tables are made of.

    Args:
        rows: results of episodes (``rows_of``).
        poses: where the programs had the poses of things from, for the note.
        settings: what ``--set`` changed when the episodes ran, such as ``perception.backend=cameras``, for the command.

    Returns:
        Command, note and rows. The note says if some tasks ran on some of the seeds only.
    """
    by_part: dict[str, list[dict[str, Any]]] = {}
    tasks: dict[str, str] = {}
    seeds = set()
    for row in rows:
        by_part.setdefault(row["part"], []).append(row)
        tasks[row["task"]] = row["part"]
        seeds.add(row["seed"])
    ran, whole = sum(map(len, by_part.values())), len(tasks) * len(seeds)
    return {
        "command": _COMMAND.format(
            seeds=",".join(map(str, sorted(seeds))),
            settings="".join(f" -s {shlex.quote(setting)}" for setting in settings),
            names=_names(tasks),
        ),
        "note": _NOTE.format(poses=poses, episodes="episodes" if ran == whole else f"{ran} of these {whole} episodes"),
        "rows": [_row(part, by_part[part]) for part in sorted(by_part, key=PARTS.index)],
    }


def _names(tasks: dict[str, str]) -> str:
    """Names of tasks (task -> its part) as a shell with braces expands them: variants of a task together."""
    variants: dict[str, list[str]] = {}
    for task, part in sorted(tasks.items(), key=lambda one: (PARTS.index(one[1]), one[0])):
        beginning = _beginning(part)
        variants.setdefault(task.removeprefix(beginning), []).append(beginning)
    alike: dict[tuple[str, ...], list[str]] = {}
    for ending, beginnings in variants.items():
        alike.setdefault(tuple(beginnings), []).append(ending)
    return " ".join(_braced(beginnings) + _braced(endings) for beginnings, endings in alike.items())


def _braced(names: Sequence[str]) -> str:
    """Names in a shell's braces, without the words that all begin and end with."""
    if len(names) == 1:
        return names[0]
    words = [re.findall("[^-]+-?", name) for name in names]
    first = _shared(words)
    last = _shared([one[first:][::-1] for one in words])
    middle = ",".join("".join(one[first : len(one) - last]) for one in words)
    return "".join((*words[0][:first], "{", middle, "}", *words[0][len(words[0]) - last :]))


def _shared(lists: Sequence[list[str]]) -> int:
    """Number of words that all lists begin with."""
    return sum(1 for _ in takewhile(lambda words: len(set(words)) == 1, zip(*lists, strict=False)))


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
