"""``memo bench drawer``: a lesson about a door meets a drawer, and a person says one sentence about it.

Per seed the microwave's lesson is taught once through the whole loop. For each sentence a copy of that book is used on
the drawer: the first attempt is what the lesson alone does there; then the sentence is said, whatever happened; the
retry and a run afterwards, with nobody watching, show what came of it. The fridge and the oven are opened as well, with
both books. Only the first subtask, the opening, is done; the task's own check judges it.
"""

from __future__ import annotations

import itertools
import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from memo_benchmarks.demo_sweep import Lesson
from memo_core.config import Experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.errors import InvalidArgument, Stopped
from memo_core.events import CodeEnded, EntryStored, Event, Retrieved, SkillCalled
from memo_core.interfaces.teacher import Teacher
from memo_core.plugins import Registry
from memo_core.runs.factories import book_of, environment_of, task_of
from memo_core.runs.folder import RunFolder, new_run_folder
from memo_core.runs.run import components_of, perform
from memo_core.teachers.scripted import Line, ScriptedTeacher, ScriptSettings

TASK = "put-the-cube-away"
DOORS = {"fridge": "open-the-fridge", "oven": "put-the-food-in-the-oven"}
SETTINGS = ("run.video=off", "run.subtasks=1", "run.attempts=2", "run.repairs=0", "run.repeats=1")
_BENT = 0.04  # largest sideways deviation of a straight path, over its length


@attrs.frozen
class Attempt:
    """What the code was served and the way of the hand with the handle. ``shape``: straight, arc, none; "arc failed":
    that motion was refused, or held back."""

    served: tuple[str, ...]  # "KIND KEY: TEXT", of a template its key alone
    shape: str
    opened: bool


@attrs.frozen
class Heard:
    """One sentence on one seed. ``doors_before`` and ``doors``: ``DOORS``, without and with what was noted."""

    seed: int
    says: str
    notes: tuple[str, ...]
    before: Attempt
    retry: Attempt
    later: Attempt
    doors_before: dict[str, Attempt]
    doors: dict[str, Attempt]


def sayings_in(path: Path) -> list[str]:
    """One sentence a line. Raises ``InvalidArgument``."""
    try:
        found = [line.strip() for line in path.read_text("utf-8").splitlines() if line.strip()]
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidArgument("FILE", f"{path} cannot be read ({error})", "a text file, one sentence a line") from None
    if not found:
        raise InvalidArgument("FILE", f"{path} holds no sentence", "a text file, one sentence a line")
    return found


def bench_drawer(
    experiment: Experiment,
    registry: Registry,
    out: Path,
    sayings: Sequence[str],
    seeds: Sequence[int],
    progress: Callable[[float], None] = lambda share: None,
) -> list[Heard]:
    """Every sentence on every seed, each with its own copy of the book. Raises ``Stopped`` when a person ends it."""
    heard: list[Heard] = []
    for seed in seeds:
        lesson = Lesson(experiment, registry, out, seed)
        lesson.teach()
        doors = _doors(lesson, registry, lesson.url)
        for number, says in enumerate(sayings):
            heard.append(_hear(lesson, registry, says, lesson.folder / f"said-{number}.db", doors))
            progress(len(heard) / (len(seeds) * len(sayings)))
    return heard


def summary(heard: Sequence[Heard]) -> dict[str, Any]:
    """Counts over all sentences and seeds."""
    report: dict[str, Any] = {"sentences": len({one.says for one in heard}), "trials": len(heard)}
    report["noted"] = sum(bool(one.notes) for one in heard)
    tried = {name: [getattr(one, name) for one in heard] for name in ("before", "retry", "later")}
    for door in DOORS:
        tried[f"{door}_before"] = [one.doors_before[door] for one in heard]
        tried[door] = [one.doors[door] for one in heard]
    for name, attempts in tried.items():
        report |= {f"{name}_{shape}": sum(shape in one.shape for one in attempts) for shape in ("arc", "straight")}
        report[f"{name}_opened"] = sum(one.opened for one in attempts)
        report[f"{name}_served_the_lesson"] = sum(any("(microwave)" in text for text in one.served) for one in attempts)
    return report


def _hear(lesson: Lesson, registry: Registry, says: str, file: Path, doors_before: dict[str, Attempt]) -> Heard:
    with (
        closing(sqlite3.connect(Path(lesson.url.removeprefix("sqlite:///")))) as taught,
        closing(sqlite3.connect(file)) as copy,
    ):
        taught.backup(copy)
    url = f"sqlite:///{file}"
    person = ScriptedTeacher(ScriptSettings(lines=(Line("OPEN(*)", says, attempt=1),)))
    before, retry = (watch := _Watch()).attempts_of(lesson, registry, TASK, url, person)
    [later] = _Watch().attempts_of(lesson, registry, TASK, url, None)
    doors = _doors(lesson, registry, url)
    return Heard(lesson.seed, says, tuple(watch.noted), before, retry, later, doors_before, doors)


def _doors(lesson: Lesson, registry: Registry, url: str) -> dict[str, Attempt]:
    """How each of ``DOORS`` is opened with a book."""
    return {name: _Watch().attempts_of(lesson, registry, task, url, None)[0] for name, task in DOORS.items()}


@attrs.define
class _Watch:
    """Hears one run: what was served, and the way of the hand from closing on the handle until it opens."""

    world: SimulatedEnvironment | None = None
    noted: list[str] = attrs.field(factory=list)
    attempts: list[Attempt] = attrs.field(factory=list)
    served: tuple[str, ...] = ()
    way: list[list[float]] | None = None
    at: list[float] | None = None
    let_go: bool = False
    failed: list[list[float]] | None = None

    def attempts_of(
        self, lesson: Lesson, registry: Registry, name: str, url: str, teacher: Teacher | None
    ) -> list[Attempt]:
        experiment = lesson.experiment
        task = task_of(experiment, name)

        def world() -> SimulatedEnvironment:
            self.world = environment_of(experiment, task, lesson.seed)
            return self.world

        book = book_of(experiment, url, read_only=teacher is None)
        report = perform(
            components_of(experiment, world, book, teacher),
            task,
            lesson.seed,
            lambda: RunFolder(new_run_folder(lesson.folder, f"{name}-{'taught' if teacher else 'later'}", lesson.seed)),
            registry,
            experiment.public() | {"task": name, "bench": "drawer"},
            self.heard,
        )
        if report.ended_by_person:
            raise Stopped(f"the run of {name}")
        expected = 1 if teacher is None else 2
        if len(self.attempts) != expected:
            raise InvalidArgument("drawer", f"{len(self.attempts)} attempts, {report.why}", f"{expected} attempts")
        return self.attempts

    @property
    def shape(self) -> str:
        """Of the attempt so far, as in ``Attempt``."""
        found = _shape(self.way or [])
        return f"{_shape(self.failed)} failed" if found == "none" and self.failed else found

    def heard(self, event: Event) -> None:
        if isinstance(event, Retrieved):
            self.served = tuple(
                f"{one.kind} {one.key}" + (f": {one.text}" if one.kind != "template" else "") for one in event.served
            )
        elif isinstance(event, EntryStored):
            self.noted.append(f"{event.kind} {event.key}: {event.text}")
        elif isinstance(event, SkillCalled):
            self._called(event)
        elif isinstance(event, CodeEnded) and self.world is not None:
            verdict = self.world.check_subtask(event.subtask)
            opened = verdict is not None and verdict.success
            self.attempts.append(Attempt(self.served, self.shape, opened))
            self.way, self.at, self.let_go, self.failed = None, None, False, None

    def _called(self, event: SkillCalled) -> None:
        points: list[list[float]] = []
        if event.skill == "follow_path":
            points = [waypoint[0] for waypoint in event.arguments["path"]]
        elif event.skill in ("move_straight", "move_to"):
            points = [event.arguments["position"]]
        elif event.skill == "close_gripper" and self.at is not None and self.way is None:
            self.way = [self.at]
        elif event.skill == "open_gripper" and self.way is not None:
            self.let_go = True
        if points and event.error:
            following = [waypoint[0] for waypoint in event.arguments.get("then") or []]
            self.failed = self.failed or [*([self.at] if self.at is not None else []), *points, *following]
        elif points:
            self.at = points[-1]
            if self.way is not None and not self.let_go:
                self.way += points


def _shape(way: Sequence[Sequence[float]]) -> str:
    points = np.array(way, dtype=float)
    if len(points) < 2:
        return "none"
    chord = points[-1] - points[0]
    length = sum(float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(points))
    if length < 1e-3:
        return "none"
    along = chord / max(float(np.linalg.norm(chord)), 1e-9)
    offsets = points - points[0]
    sideways = np.linalg.norm(offsets - np.outer(offsets @ along, along), axis=1).max()
    return "arc" if sideways / length > _BENT else "straight"
