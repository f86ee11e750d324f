"""What a method acts in: a scene with a robot, without access to the simulator or hardware below the arm.

``memo_core.environment.simulated.SimulatedEnvironment`` implements it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from memo_core.interfaces.link import Link
from memo_core.interfaces.teacher import Sighting
from memo_core.robot.description import RobotDescription
from memo_core.scene.graph import SceneGraph
from memo_core.scene.name_corrections import NameCorrection
from memo_core.scene.pose import Array
from memo_core.skills.control import Control


class Environment(Protocol):
    """A scene with a robot in it. It does not judge success; the evaluation does."""

    @property
    def instruction(self) -> str: ...

    @property
    def goal(self) -> tuple[str, ...]:
        """What a person wants to see when the task is done (``Task.goal``); empty if not stated."""

    @property
    def time_limit(self) -> float:
        """Seconds that the task may take, on the clock of a world that is put back after corrections."""

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

    def pictures(self, scene: SceneGraph) -> Mapping[str, Array]:
        """The cameras' pictures of the last look, RGB, uint8, shape (H, W, 3), by the camera's name."""

    def photograph(self, cameras: Sequence[str], height: int | None = None) -> Mapping[str, Array]:
        """Pictures of this moment, RGB, uint8, shape (H, W, 3), by the camera's name; for policies that see.

        Args:
            cameras: names of cameras.
            height: in pixels, for a simulator that draws in any size; None: the camera's own.

        Raises:
            UnknownName: for a camera that is not there.
        """

    def correct_names(self, corrections: Sequence[NameCorrection]) -> None:
        """Tell the perception what people said of names; it holds from the next look on."""

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
