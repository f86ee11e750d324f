"""What a method acts in: a scene with a robot, without access to the simulator or hardware below the arm.

``memo_core.environment.simulated.SimulatedEnvironment`` implements it.
"""

from __future__ import annotations

from typing import Protocol

from memo_core.interfaces.link import Link
from memo_core.interfaces.teacher import Sighting
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import SceneGraph
from memo_core.skills.control import Control


class Environment(Protocol):
    """A scene with a robot in it. It does not judge success; the evaluation does."""

    @property
    def instruction(self) -> str: ...

    @property
    def goal(self) -> tuple[str, ...]:
        """What a person wants to see when the task is done (``Task.goal``); empty if not stated."""

    @property
    def robot(self) -> RobotDescription: ...

    @property
    def control(self) -> Control: ...

    @property
    def link(self) -> Link: ...

    def time(self) -> float:
        """Seconds on the robot's clock."""

    def look(self) -> SceneGraph:
        """Take a new look with the robot's perception. Skills use its result from now on."""

    def settle(self, seconds: float) -> None:
        """Let objects come to rest. Raises ``Stopped``."""

    def checkpoint(self) -> bytes: ...

    def restore(self, checkpoint: bytes) -> None: ...

    def start_watching(self, seen: tuple[Sighting, ...] = ()) -> None:
        """Begin to record what a person in the room would see; ``seen``: continue after these sightings."""

    def stop_watching(self) -> tuple[Sighting, ...]:
        """The sightings since ``start_watching``, the last one of this moment."""

    def sightings(self) -> tuple[Sighting, ...]:
        """The sightings so far. Reads only stored values, so another thread may still move the robot."""

    def glance(self) -> SceneGraph:
        """What a person in the room sees now."""
