"""The suite's tasks as MEMO's: scene, instruction, goal as one sees it, and the suite's own judge."""

from __future__ import annotations

import contextlib
import functools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, overload

import attrs
import numpy as np

from memo_core.plugin import Outcome, SceneDescription, Task, WorldState
from memo_libero.connection import Place, Server, borrowed
from memo_libero.environment import python_of
from memo_libero.names import goal_sentences, labels_of
from memo_libero.reference import reference_program, without_program
from memo_libero.scene import LINKS, LiberoScene, scene_of
from memo_libero.settings import SuiteSettings

STATES = 50  # initial states of a task
EVER, AT_END = "held_at_some_moment", "holds_at_the_end"  # measures of a verdict
_CATALOGUE_S = 180.0
CATALOGUE = "memo-tasks.json"  # in the suite's environment
_DESCRIBED = 64  # scenes that are kept described


class LiberoTask(Task):
    """One task of one part of the suite."""

    settle = 1.0
    kind = ""

    def __init__(self, told: dict[str, Any], settings: SuiteSettings, python: Path) -> None:
        self.told, self._settings, self._python = told, settings, python
        self.name = task_name(told)
        sentences = {"bddl": told["instruction"], "file-name": told["sentence"]}
        self.instruction = sentences[settings.instruction]
        self.split = "held-out" if _variant(told["suite"]) else "training"
        self.time_limit = settings.limit_s
        self.labels = labels_of(told["things"], f"{told['suite']}/{told['index']}")  # by the suite's names
        self.goal = goal_sentences(told["goal"], self.labels, told["regions"])
        self.unsolved = without_program(told, self.labels)

    def scene(self, rng: np.random.Generator) -> SceneDescription:
        """The initial state whose number is the seed's, modulo their number; fixtures stand as the seed has them."""
        seed = _seed_of(rng)
        place = Place(self.told["suite"], self.told["index"], seed % STATES, seed % 2**32)
        described = describe(place, self._python, self._settings.load_seconds)
        cameras = {camera.name: camera for camera in described.cameras}
        return attrs.evolve(
            described, cameras=tuple(cameras[name] for name in self._settings.cameras if name in cameras)
        )

    def check(self, world: WorldState, monitors: dict[str, Any]) -> Outcome:
        """The suite's own verdict: whether its goal held at some moment, and whether it holds now."""
        now, ever = _judged(world)
        success = ever if self._settings.judge == "ever" else now
        said = {
            (True, True): "LIBERO's goal holds",
            (False, True): "LIBERO's goal held at some moment and no longer holds",
            (False, False): "LIBERO's goal never held",
        }
        told = f"judge {self._settings.judge!r}, instruction from {self._settings.instruction}"
        measures = {EVER: float(ever), AT_END: float(now)}
        return Outcome(success, f"{said[now, ever]} ({told})", measures)

    @functools.cached_property
    def reference_solution(self) -> str:
        """Our program for this kind of task; empty if there is none."""
        return reference_program(self.told, self.labels)


def _judged(world: WorldState) -> tuple[bool, bool]:
    """Whether the goal holds now, and whether it ever held."""
    if hasattr(world, "ever_held"):
        return bool(world.holds_now), bool(world.ever_held)  # type: ignore[attr-defined]
    scene = getattr(world, "scene", None)
    if isinstance(scene, LiberoScene):  # a scene that stands still is as it was at the start
        return scene.done, scene.done
    raise TypeError("only the simulator 'libero' can judge this task: simulator.backend=libero")


def _seed_of(rng: np.random.Generator) -> int:
    """First number that a generator was seeded with."""
    entropy = rng.bit_generator.seed_seq.entropy  # type: ignore[attr-defined]
    return int(entropy if isinstance(entropy, int) else entropy[0])


def _variant(suite: str) -> str:
    """Name of the change that a part of LIBERO-PRO makes; empty for a part of LIBERO."""
    last = suite.rpartition("_")[2]
    return last if suite.count("_") > 1 and last in ("lan", "object", "swap", "task") else ""


def task_name(told: dict[str, Any]) -> str:
    """Name of a task here, such as ``goal-task-turn-on-the-stove``: its part, then its file's name."""
    part = told["suite"].removeprefix("libero_")
    return f"{part}-{told['file']}".lower().replace("_", "-")


@functools.lru_cache(maxsize=_DESCRIBED)
def describe(place: Place, python: Path, seconds: float) -> LiberoScene:
    """Description of a scene. The process that loaded it keeps it ready for the simulator.

    Args:
        place: which scene.
        python: the suite's Python.
        seconds: longest wait for it.

    Returns:
        The description; equal arguments give the same object.

    Raises:
        BackendUnavailable: if the suite cannot be used.
        BackendLost: if its process ended or did not answer.
    """
    with borrowed(python, place) as server:
        told, state = server.load(place, seconds)
    count = sum(len(thing["pieces"]) for thing in told["things"]) + len(LINKS)
    return scene_of(told, state[-7 * count :].reshape(-1, 7), place, str(python))


class Tasks(Sequence[Task]):
    """The tasks of some parts; the suite's files are read when the first is asked for."""

    def __init__(self, settings: SuiteSettings) -> None:
        self._settings = settings

    @functools.cached_property
    def _tasks(self) -> tuple[Task, ...]:
        python = python_of(self._settings.python, "suite")
        known = catalogue(python)
        told = [task for part in self._settings.parts for task in known[part]]
        return tuple(LiberoTask(task, self._settings, python) for task in told)

    def __len__(self) -> int:
        return len(self._tasks)

    @overload
    def __getitem__(self, index: int) -> Task: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[Task, ...]: ...
    def __getitem__(self, index: int | slice) -> Task | tuple[Task, ...]:
        return self._tasks[index]

    def __iter__(self) -> Iterator[Task]:
        return iter(self._tasks)


def catalogue(python: Path) -> dict[str, list[dict[str, Any]]]:
    """Tasks of the suite by part, as its files describe them, kept beside its Python: reading them takes seconds.

    Args:
        python: the suite's Python.

    Returns:
        Part -> its tasks (``far_side.catalogue.tasks_of``).
    """
    from memo_libero.settings import PARTS

    file = python.parent.parent / CATALOGUE
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        with borrowed(python) as server:
            return write_catalogue(server, file, PARTS)


def write_catalogue(server: Server, file: Path, parts: Sequence[str]) -> dict[str, list[dict[str, Any]]]:
    """Ask for the tasks of parts, and keep the answer in a file if it can be written."""
    answer, _ = server.call("tasks", seconds=_CATALOGUE_S, suites=list(parts))
    told: dict[str, list[dict[str, Any]]] = {part: [] for part in parts}
    for task in answer["tasks"]:
        told[task["suite"]].append(task)
    with contextlib.suppress(OSError):
        file.write_text(json.dumps(told), encoding="utf-8")
    return told
