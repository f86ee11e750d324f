"""The trials of an evaluation, and what they are called."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

import attrs

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument
from memo_core.evaluation.settings import EvaluationSettings
from memo_core.interfaces.backend import Backend, Memory
from memo_core.policy.methods import METHODS
from memo_core.runs.factories import task_of, tasks_of

Mode = Literal["zero-shot", "corrected"]
ABLATED = "memo"  # method whose largest skillbook is ablated
MODEL_SEEDS = 1_000_003  # between the seeds that a model gets in two trials of one scene


@attrs.frozen
class Trial:
    """One run of the evaluation. ``history`` and ``hours`` say which book; None where the method has none, or where the
    book was given (``given`` is its file)."""

    method: str
    task: str
    scene: int  # seed of the scene
    mode: Mode = "zero-shot"
    history: int | None = None
    hours: float | None = None
    number: int = 0  # of several trials in one scene
    given: str = ""
    ablation: str = ""

    @property
    def id(self) -> str:
        """A name for its folder."""
        book = f"book.{Path(self.given).stem}" if self.given else "" if self.hours is None else f"h{self.hours:g}"
        history = "" if self.history is None else f"history{self.history}"
        parts = (self.method, self.ablation, book, history, self.task, f"scene{self.scene}", f"trial{self.number}")
        return "-".join(part for part in (*parts, self.mode) if part)

    @property
    def has_memory(self) -> bool:
        """Whether its method has a skillbook, empty or not."""
        return self.history is not None or bool(self.given)

    @property
    def model_seed(self) -> int:
        return self.scene + self.number * MODEL_SEEDS

    @property
    def group(self) -> tuple[str, int, int, str]:
        """Trials that may come out the same: one scene of a task, whatever the book."""
        return (self.task, self.scene, self.number, self.mode)


def evaluated_tasks(experiment: Experiment, settings: EvaluationSettings) -> tuple[str, ...]:
    """Raises ``UnknownName``, ``InvalidArgument``."""
    if settings.tasks:
        return tuple(task_of(experiment, name).name for name in settings.tasks)
    names = tuple(task.name for task in tasks_of(experiment) if task.split == "held-out")
    if not names:
        raise InvalidArgument("evaluation.tasks", "the suite has no held-out tasks", "names of tasks")
    return names


def memory_of(experiment: Experiment, method: str) -> Memory:
    """The memory of a method that is compared or ablated."""
    compared = {one.backend.name: one.backend.memory for one in experiment.section("evaluation").methods}
    return compared[method] if method != ABLATED else METHODS[ABLATED]


def trials_of(experiment: Experiment, histories: int) -> tuple[Trial, ...]:
    """The whole grid, small books first; of a method only what it declares to be capable of: trials with books, and
    corrected trials. Raises ``UnknownName``, ``InvalidArgument``."""
    settings: EvaluationSettings = experiment.section("evaluation")
    methods = [choice.backend for choice in settings.methods]
    tasks = evaluated_tasks(experiment, settings)
    scenes = range(settings.first_scene, settings.first_scene + settings.scenes)
    places = [(task, scene, number) for task in tasks for scene in scenes for number in range(settings.trials)]
    corrected, watched = _corrected_hours(settings), settings.corrected.corrections > 0
    found: list[Trial] = []
    for task, scene, number in places:
        with_book = [method for method in methods if method.memory.any]
        for hours in sorted(settings.hours):
            for history in range(histories):
                for method in with_book:
                    where = Trial(method.name, task, scene, history=history, hours=hours, number=number)
                    found += _in_modes(where, method, hours in corrected)
        for given in settings.books:
            for method in with_book:
                found += _in_modes(Trial(method.name, task, scene, given=given, number=number), method, watched)
        for method in methods:
            if not method.memory.any:
                found += _in_modes(Trial(method.name, task, scene, number=number), method, watched)
        found += _ablated(settings, histories, task, scene, number)
    return tuple(found)


def _in_modes(trial: Trial, method: Backend, corrected: bool) -> list[Trial]:
    """The zero-shot trial and, where it is wanted and the method takes feedback, the corrected one."""
    return [trial, *([attrs.evolve(trial, mode="corrected")] if corrected and method.takes_feedback else [])]


def _corrected_hours(settings: EvaluationSettings) -> Sequence[float]:
    if not settings.corrected.corrections:
        return ()
    wanted = settings.corrected.hours or sorted(settings.hours)[-1:]
    if missing := sorted(set(wanted) - set(settings.hours)):
        problem = f"{missing[0]:g} is none of evaluation.hours"
        raise InvalidArgument("evaluation.corrected.hours", problem, "hours of which there is a book")
    return wanted


def _ablated(settings: EvaluationSettings, histories: int, task: str, scene: int, number: int) -> list[Trial]:
    hours = max(settings.hours, default=0.0)
    return [
        Trial(ABLATED, task, scene, history=history, hours=hours, number=number, ablation=name)
        for name in settings.ablations
        for history in range(histories if settings.hours else 0)
    ]
