"""Trials on a real robot, one at a time: a person arranges each scene, releases the programs and judges the outcome.

The order is random, and neither what is asked nor the names of the trials' folders tell which method is tried. (What a
method does may: one that learns asks about its notes.) The table tells when all is over.

trials/ID/verdict.json   the person's verdict; ID is a number that hides the method
trials/ID/run/trial.json the sheet of the trial (memo_core.runs.trial_sheet)
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument, Stopped
from memo_core.evaluation.grid import Trial
from memo_core.evaluation.settings import EvaluationSettings
from memo_core.interfaces.task import Task
from memo_core.interfaces.teacher import Arrangement, Episode, Program, TaskEpisode, Teacher, Verdict
from memo_core.runlog.whole_files import write_whole
from memo_core.runs.folder import json_text
from memo_core.scene.graph import Observation, SceneGraph
from memo_core.scene.pose import Pose
from memo_core.text.parsing import parse_json
from memo_core.text.reading_limits import excerpt

VERDICT = "verdict.json"


def is_hardware(experiment: Experiment) -> bool:
    """Whether a robot driver moves a real robot."""
    return not experiment.create("robot_driver").simulated


def hidden_name(trial: Trial) -> str:
    """The name of a trial's folder, which tells nothing."""
    return hashlib.sha256(trial.id.encode()).hexdigest()[:10]


def in_random_order(trials: Sequence[Trial], seed: int) -> list[Trial]:
    """An order that depends on nothing but the seed, also where trials are added later."""
    return sorted(trials, key=lambda trial: hashlib.sha256(f"{seed} {trial.id}".encode()).digest())


def check_settings(settings: EvaluationSettings) -> None:
    """Raises ``InvalidArgument`` for what one robot and one person cannot do."""
    if settings.engine != "joblib":
        raise InvalidArgument("evaluation.engine", f"{settings.engine!r} with a real robot", "joblib")
    if settings.jobs != 1:
        raise InvalidArgument("evaluation.jobs", f"{settings.jobs} trials at once with one robot", "1")
    if settings.replay:
        raise InvalidArgument("evaluation.replay", "a real robot answers differently", "no replay")


def set_up(person: Teacher, trial: Trial, first_scene: int, task: Task, number: int, count: int) -> None:
    """Have the person arrange the scene. Raises ``Stopped`` when they pause."""
    person.open()
    try:
        ready = person.set_up(Arrangement(task.instruction, trial.scene - first_scene + 1, number, count))
    finally:
        person.close()
    if not ready:
        raise Stopped("waiting for a person to set up a scene; the same command goes on")


class Judge(Teacher):
    """The person beside a trial that nobody corrects. They release programs and judge the whole task; their words are
    kept with the verdict, and teach nothing. Ctrl-C ends the trial: it is not done."""

    def __init__(self, person: Teacher, folder: Path) -> None:
        self.person, self._file = person, folder / VERDICT
        self.who, self.simulated = person.who, person.simulated

    def open(self) -> None:
        self.person.open()
        self.who = self.person.who

    def close(self) -> None:
        self.person.close()

    @property
    def verdict(self) -> dict[str, Any] | None:
        """What they said; None before they were asked."""
        return dict(parse_json(self._file.read_text(encoding="utf-8"))) if self._file.exists() else None

    def over(self, left_s: float, attempts: int, subtasks: int) -> bool:
        """Whether the trial is to end, as ``Person.time_is_up``."""
        return self.verdict is not None

    def judge(self, episode: Episode) -> Verdict:
        return Verdict("silent")

    def interrupted(self, episode: Episode) -> Verdict:
        self._keep(False, f"stopped during {episode.subtask}")
        return Verdict("silent")

    def judge_task(self, episode: TaskEpisode) -> Verdict:
        verdict = self.person.judge_task(episode)
        self._keep(verdict.kind == "approve", verdict.words)
        return Verdict("approve" if verdict.kind == "approve" else "silent")

    @property
    def permits(self) -> bool:
        return self.person.permits

    def permit(self, program: Program) -> Verdict:
        """A program that they correct is not released, and the correction teaches nothing."""
        released = self.person.permit(program).kind == "approve" and self.verdict is None
        return Verdict("approve" if released else "silent")

    def confirm(self, episode: Episode) -> bool:
        return self.person.confirm(episode)

    def outcome(self, task: Task, ended: str) -> dict[str, Any]:
        """The verdict; asked for now where the run ended without one."""
        if self.verdict is None:
            nothing = SceneGraph((), (), Observation(Pose(), 0.0, False), 0.0)
            self.open()
            try:
                self.judge_task(TaskEpisode(task.instruction, nothing, nothing, task.goal))
            finally:
                self.close()
        said = self.verdict
        assert said is not None
        return said | {
            "reason": excerpt(said["words"]) or ("the person says that it is done" if said["success"] else ended)
        }

    def _keep(self, success: bool, words: str) -> None:
        write_whole(self._file, json_text({"success": success, "words": words, "who": self.who}))


def judged(summary: dict[str, Any], outcome: dict[str, Any]) -> dict[str, Any]:
    """A run's summary with the person's verdict instead of a success check's."""
    return summary | {"success": outcome["success"], "reason": outcome["reason"], "verdict": outcome["words"]}
