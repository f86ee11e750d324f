"""Floor and ceiling of the tasks: doing nothing and the reference solution, in the evaluation's scenes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from memo_core.config import Experiment
from memo_core.environment.task_verification import Verified, verify_task
from memo_core.evaluation.grid import evaluated_tasks
from memo_core.evaluation.settings import EvaluationSettings
from memo_core.interfaces.task import Task
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.whole_files import write_whole
from memo_core.runs.factories import environment_of, sandbox_of, task_of
from memo_core.runs.folder import json_text
from memo_core.text.parsing import parse_json

FILE = "references.json"


def measure_references(
    experiment: Experiment, folder: Path, stop: StopSwitch, report: Callable[[str], None] = lambda line: None
) -> dict[str, dict[str, Any]]:
    """By task: successes of the reference and of doing nothing, in ``folder``/references.json; what is in there for as
    many scenes is not measured again. Raises ``Stopped``, ``MemoError``."""
    settings: EvaluationSettings = experiment.section("evaluation")
    known = read_references(folder)
    scenes = list(range(settings.first_scene, settings.first_scene + settings.scenes))
    for name in evaluated_tasks(experiment, settings):
        if known.get(name, {}).get("seeds") == scenes:
            continue
        done = nothing = 0
        for scene in scenes:
            stop.check("measuring reference solutions")
            found = _verified(experiment, task_of(experiment, name), scene)
            done, nothing = done + found.reference.success, nothing + found.null.success
        report(f"reference of {name}: {done} of {len(scenes)}; nothing: {nothing}")
        known[name] = {"reference": done, "nothing": nothing, "scenes": len(scenes), "seeds": scenes}
        write_whole(folder / FILE, json_text(known))
    return known


def _verified(experiment: Experiment, task: Task, scene: int) -> Verified:
    [found] = verify_task(lambda seed: environment_of(experiment, task, seed), lambda: sandbox_of(experiment), [scene])
    return found


def read_references(folder: Path) -> dict[str, dict[str, Any]]:
    """What was measured so far."""
    file = folder / FILE
    return parse_json(file.read_text(encoding="utf-8")) if file.exists() else {}
