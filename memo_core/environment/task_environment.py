"""What a simulated and a real environment share: opening and closing, looking, what a person in the room sees."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import Self

import numpy as np

from memo_core.interfaces.link import Link
from memo_core.interfaces.perception import Perception
from memo_core.interfaces.task import Task
from memo_core.interfaces.teacher import Sighting
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import SceneGraph
from memo_core.scene.name_corrections import NameCorrection
from memo_core.scene.pose import Array
from memo_core.skills.control import Control

ControlFactory = Callable[[RobotDescription, Link, Perception], Control]


class TaskEnvironment(ABC):
    """A task with a robot, its perception and its link. Use as a context manager: the parts are opened once and always
    closed, also when opening fails half-way."""

    control: Control
    judge = "the task's own check"  # whose verdict ``conclude`` returns

    def __init__(
        self, task: Task, seed: int, robot: RobotDescription, perception: Perception, control: ControlFactory | None
    ) -> None:
        """Touches nothing. ``perception`` comes unopened; ``control`` defaults to that of ``memo_core.arm``."""
        self.task = task
        self.seed = seed
        self.robot = robot
        self.perception = perception
        self._make_control = control or arm_control
        self._link: Link | None = None
        self._sightings: list[Sighting] | None = None
        self._opened = False

    # -- opening and closing -------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Open the parts and look once; nothing moves. Idempotent. Raises ``BackendUnavailable`` with the remedy."""
        if self._opened:
            return
        self._opened, self._link = True, None
        try:
            self._open()
            self.control.look()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Idempotent. The robot is left at rest; what it holds stays held."""
        if not self._opened:
            return
        self._opened = False
        try:
            self.perception.close()
        finally:
            try:
                if self._link is not None:
                    self._link.close()
            finally:
                self._close()

    def pace(self) -> None:
        """Move no faster than the clock on the wall from now on. A real robot does so anyway."""

    @abstractmethod
    def _open(self) -> None:
        """Set ``_link`` and ``control``, and start perception."""

    @abstractmethod
    def _close(self) -> None:
        """Close what is below the link. Also called when ``_open`` failed half-way."""

    def __enter__(self) -> Self:
        self.open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- acting and looking --------------------------------------------------------------------------------------------
    @property
    def instruction(self) -> str:
        return self.task.instruction

    @property
    def goal(self) -> tuple[str, ...]:
        return self.task.goal

    @property
    def link(self) -> Link:
        assert self._link is not None, "not open"
        return self._link

    def time(self) -> float:
        """Seconds on the robot's clock; in simulation, since the scene was built."""
        return self.link.time()

    def look(self) -> SceneGraph:
        """Take a new look with the robot's perception. Skills use its result from now on."""
        return self.control.look()

    def pictures(self, scene: SceneGraph) -> Mapping[str, Array]:
        """The cameras' pictures of the last look, nothing drawn; RGB, uint8, shape (H, W, 3), by the camera's name."""
        return self.perception.pictures() or scene.observation.rgb

    def correct_names(self, corrections: Sequence[NameCorrection]) -> None:
        """Tell the perception what people said of names; it holds from the next look on."""
        self.perception.correct_names(tuple(corrections))

    # -- what a person in the room sees --------------------------------------------------------------------------------
    @abstractmethod
    def start_watching(self, seen: tuple[Sighting, ...] = ()) -> None:
        """Begin a new list of sightings with ``seen`` and one of this moment."""

    def stop_watching(self) -> tuple[Sighting, ...]:
        """The sightings since ``start_watching``, the last one of this moment. Empty when nobody watched."""
        if self._sightings is None:
            return ()
        self._stop_recording()
        self._sightings.append(Sighting(self.time(), self.glance()))
        seen, self._sightings = tuple(self._sightings), None
        return seen

    def _stop_recording(self) -> None:
        """Stop adding sightings on a clock. By default none are."""

    def sightings(self) -> tuple[Sighting, ...]:
        """The sightings since ``start_watching``. Reads only stored values, so another thread may move the robot."""
        return tuple(self._sightings or ())

    def glance(self) -> SceneGraph:
        """What a person in the room sees now; on a real robot, as far as the cameras show it. Changes nothing."""
        return self.perception.glance()


def generator(seed: int, purpose: str) -> np.random.Generator:
    """Random generator for one purpose, so that the draws for one purpose do not affect another's.

    Args:
        seed: seed of the run, at least 0.
        purpose: name of the purpose, such as ``scene`` or ``perception``.

    Returns:
        A new generator; equal arguments give equal draws.
    """
    return np.random.default_rng([seed, *purpose.encode()])


def arm_control(robot: RobotDescription, link: Link, perception: Perception) -> Control:
    """The control of ``memo_core.arm``, imported when it is needed."""
    from memo_core.arm.control import ArmControl

    return ArmControl(robot, link, perception)
