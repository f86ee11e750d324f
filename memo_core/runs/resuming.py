"""Checks before an interrupted run is resumed (``memo run --resume DIR``); the run log does the rest."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import attrs
import yaml

from memo_core.errors import InvalidArgument
from memo_core.runlog.event_log import read_events
from memo_core.runlog.log_file import Lines, read_lines
from memo_core.runlog.log_history import History, read_history
from memo_core.runs.folder import flat, nested
from memo_core.skillbook.book import Skillbook

# What may be another in a later part: limits that were reached, what is filmed, how fast it is shown.
# Limits, and how a model is reached, also that of perception: what mends a run that could not be carried out.
MAY_DIFFER = (
    "run.max_",
    "run.study_",
    "run.video",
    "run.pace",
    "run.retr",
    "llm.timeout_s",
    "llm.api_base",
    "llm.api_key_env",
)


@attrs.frozen(eq=False)
class CutOff:
    """An interrupted run. ``sent``: the positions of the events that it sent, see ``RunLog.place``."""

    history: History
    sent: frozenset[str]
    subtask: str  # at hand; empty where one was to be planned
    attempt: int
    subtasks: tuple[tuple[str, str], ...] = ()  # (subtask, status), each that ended


def read_cut_off(folder: Path) -> CutOff:
    """Raises ``InvalidArgument`` if there is no run, it has ended, has another version, or its log is damaged."""
    lines: Lines = read_lines(folder)
    history = read_history(folder, lines.records)
    if history.ended:
        raise InvalidArgument("--resume", f"the run in {folder} has ended: {history.ended}", "an interrupted run")
    sent, ended, subtask, attempt = set(), [], "", 1
    for event in read_events(folder):
        if isinstance(event.get("at"), str):
            sent.add(event["at"])
        if event.get("event") == "SubtaskStarted":
            number = event.get("attempt")
            subtask, attempt = str(event.get("subtask", "")), number if isinstance(number, int) else 1
        elif event.get("event") == "SubtaskEnded":
            ended.append((subtask, str(event.get("status", ""))))
            subtask, attempt = "", 1
    return CutOff(history, frozenset(sent), subtask, attempt, tuple(ended))


def run_config(folder: Path) -> Path:
    """The resolved experiment of a run, which is an experiment file. Raises ``InvalidArgument``."""
    file = folder / "config.yaml"
    if not file.exists():
        raise InvalidArgument("--resume", f"{folder} holds no run ({file.name} is missing)", "the folder of a run")
    return file


def check_config(folder: Path, now: Mapping[str, Any]) -> None:
    """Raises ``InvalidArgument``, naming each value in which the experiment differs from the run's ``config.yaml``. A
    key that is missing there was added in a newer version and must have its default."""
    file = folder / "config.yaml"
    try:
        before = flat(yaml.safe_load(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, yaml.YAMLError) as error:
        problem = " ".join(str(getattr(error, "strerror", None) or error).split())
        raise InvalidArgument("--resume", f"{file}: {problem}", "the folder of a run") from None
    after = flat(nested(dict(now)))
    differ = [key for key in sorted(before) if before[key] != after.get(key)]
    differ = [key for key in differ if not key.removeprefix("perception.").startswith(MAY_DIFFER)]
    if differ:
        told = "; ".join(f"{key} was {before.get(key)!r}, is {after.get(key)!r}" for key in differ[:5])
        more = f" (and {len(differ) - 5} more)" if len(differ) > 5 else ""
        raise InvalidArgument("--resume", f"another config: {told}{more}", "the config the run began with")


def check_place(history: History, book_url: str, here: Path) -> None:
    """Raises ``InvalidArgument`` if the name of the run's book refers to a different file from the present working
    directory."""
    relative = "://" not in book_url and not Path(book_url).is_absolute()
    started_in = history.head.get("started_in", str(here))  # a log of another version may lack it
    if relative and str(here) != started_in:
        problem = f"the skillbook {book_url!r} is named from where the run was started"
        raise InvalidArgument("--resume", problem, f"the same command in {started_in}")


def book_changes(history: History, book: Skillbook, run: str) -> str:
    """Changes that others made to the book since the run's last step; empty if none."""
    before, when = history.book
    now = book.generation()
    if before is None or now == before:
        return ""
    own = {feedback.id for feedback in book.feedback_of_run(run)}
    since = [entry for entry in book.entries(superseded=True) if entry.created >= when]
    others = sum(entry.feedback not in own for entry in since)
    if not others and now > before and since:
        return ""
    return f"it was at generation {before} and is at {now}; {others} of the entries since are not of this run"
