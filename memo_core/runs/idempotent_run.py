"""A run that is one of many, as in a study or an evaluation: begun, or resumed where it was cut off, in a folder whose
name is known beforehand."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument, Stopped
from memo_core.interfaces.task import Task
from memo_core.llm.kept_calls import ASK
from memo_core.plugins.registry import Registry
from memo_core.runlog.log_file import FILE, read_lines
from memo_core.runlog.log_history import read_history
from memo_core.runs.folder import RunFolder
from memo_core.runs.resuming import CutOff, read_cut_off
from memo_core.runs.run import RunComponents, perform
from memo_core.runs.run_errors import NotCarriedOut
from memo_core.text.parsing import parse_json


def public(experiment: Experiment) -> dict[str, Any]:
    """Settings that one run of many records: those of a single run, without the sections of the whole experiment."""
    whole = ("study.", "books.", "evaluation.", "report.")
    return {path: value for path, value in experiment.public().items() if not path.startswith(whole)}


def do_one(
    components: RunComponents,
    task: Task,
    seed: int,
    folder: Path,
    registry: Registry,
    config: dict[str, Any],
    view: bool = False,
) -> dict[str, Any]:
    """The summary of the run in ``folder``, which is done, or resumed, unless it has ended already.

    Raises ``NotCarriedOut`` for a run that its model, simulator or robot could not carry out, ``Stopped`` for one that
    a person ended or that broke off at a limit: the same call goes on with it; ``MemoError`` for what keeps it from
    beginning; ``InvalidArgument`` for a damaged log."""
    if (ended := summary_of(folder)) is not None:
        return ended
    before = _cut_off(folder)

    def opened() -> RunFolder:
        return RunFolder(folder, again=before is not None)

    report = perform(components, task, seed, opened, registry, config, view=view, before=before)
    summary = report.summary()
    if report.error is not None:
        raise NotCarriedOut(str(folder), report.error)
    if summary["resumable"]:
        raise Stopped(f"doing {folder} ({summary['problem'] or summary['ended']})")
    return summary


def summary_of(folder: Path) -> dict[str, Any] | None:
    """The summary of a run that has come to its end; None for one that has not, or never began."""
    if not _began(folder) or not read_history(folder, read_lines(folder).records).ended:
        return None
    try:
        return dict(parse_json((folder / "summary.json").read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise InvalidArgument(str(folder / "summary.json"), f"cannot be read ({error})", "the run's folder") from None


def calls_that_count(folder: Path) -> int:
    """How often a model was asked in a run, without calls whose answer a killed process never used: the same however
    often the run was interrupted."""
    history = read_history(folder, read_lines(folder).records)
    return sum(entry.name == ASK and entry.ended for entry in history.replayed)


def wall_seconds(folder: Path) -> float:
    """How long a run took so far on the clock on the wall, without the time between its parts; 0 before it began."""
    return read_history(folder, read_lines(folder).records).wall_s if _began(folder) else 0.0


def _cut_off(folder: Path) -> CutOff | None:
    """What a run that was cut off did; None for one that is to begin. What a process left that was killed before the
    first effect is removed."""
    if _began(folder):
        return read_cut_off(folder)
    if folder.exists():
        shutil.rmtree(folder)
    return None


def _began(folder: Path) -> bool:
    """Whether a run's log has its first line."""
    file = folder / FILE
    return file.exists() and b"\n" in file.read_bytes() and (folder / "events.jsonl").exists()
