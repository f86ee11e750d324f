"""``trial.json`` in the folder of a run on a real robot: what a paper or a colleague asks about a trial afterwards."""

from __future__ import annotations

import getpass
import importlib.metadata
import subprocess
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.environment.commissioning import read_commissioning
from memo_core.errors import InvalidArgument
from memo_core.runlog.whole_files import write_whole
from memo_core.runs.folder import json_text

FILE = "trial.json"


def write_trial_sheet(experiment: Experiment, summary: dict[str, Any], folder: Path) -> Path | None:
    """Write the sheet of a run with this ``summary`` into its folder; None for a simulated robot."""
    driver = experiment.create("robot_driver")
    if driver.simulated:
        return None
    settings, robot = experiment.section("hardware"), experiment.create("robot")
    sheet: dict[str, Any] = {
        "person": settings.person or _user(),
        "ended_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "memo": importlib.metadata.version("memo-core"),
        "commit": _commit(),
        "robot": {"name": robot.name, "driver": experiment.choice("robot_driver").backend.name},
        "gripper": {
            "driver": experiment.choice("gripper_driver").backend.name,
            "kind": robot.gripper.kind,
            "stroke_m": robot.gripper.stroke,
        },
        "safety": attrs.asdict(settings.safety),
        "commissioning": _commissioning(settings.commissioning),
        "perception": experiment.choice("perception").backend.name,
        "judged_by": "the person who watched",
        **{name: summary[name] for name in _OF_THE_RUN},
    }
    sheet["robot"]["address"] = driver.address
    write_whole(folder / FILE, json_text(sheet))
    return folder / FILE


_OF_THE_RUN = (
    *("run", "task", "instruction", "method", "seed", "success", "reason", "problem", "verdict"),
    *("corrections", "planning_remarks", "interruptions", "ended_by_person", "parts", "wall_s", "robot_s"),
)


def _commissioning(file: str | None) -> dict[str, Any] | None:
    """The file's name and what it says; what is wrong with it has been reported by the run."""
    if file is None:
        return None
    try:
        return {"file": file, **attrs.asdict(read_commissioning(Path(file).expanduser()))}
    except InvalidArgument as error:
        return {"file": file, "problem": error.problem}


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return ""


def _commit() -> str | None:
    """Of the checkout that MEMO runs from, with "+" where files differ from it; None without a checkout or git."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return None
    try:
        commit = _git(root, "rev-parse", "HEAD")
        return commit + ("+" if _git(root, "status", "--porcelain", "--untracked-files=no") else "")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(root: Path, *words: str) -> str:
    done = subprocess.run(["git", *words], cwd=root, capture_output=True, text=True, check=True, timeout=20)
    return done.stdout.strip()
