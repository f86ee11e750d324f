"""What moves a described robot or gripper: a simulator or hardware.

A robot plugin describes an arm; a *robot driver* makes the link that moves it; a *gripper driver* moves a gripper that
has a connection of its own. In a config both belong to the robot: ``robot: {backend: fr3, driver: {backend: …}}``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

from memo_core.interfaces.link import Health, Link
from memo_core.interfaces.simulator import Simulator
from memo_core.robot.description import GripperDescription, RobotDescription


class GripperDriver(ABC):
    """One gripper with a connection of its own. The constructor touches nothing. Widths in m, forces in N.

    All calls return at once; ``move`` only starts a motion. The driver owns no stop: the arm's link does, and calls
    ``stop``.
    """

    included: bool = False  # the robot's driver moves the gripper itself; nothing here is ever called

    @abstractmethod
    def open(self, gripper: GripperDescription) -> None:
        """Connect, and check that it is the gripper described. Moves nothing. Raises ``BackendUnavailable``."""

    @abstractmethod
    def close(self) -> None:
        """Disconnect; what is held stays held. Idempotent; allowed before ``open``."""

    @abstractmethod
    def health(self) -> Health:
        """Quick, no motion, from any thread; never raises."""

    @abstractmethod
    def move(self, width: float, force: float) -> None:
        """Start to open or close to ``width``, pressing with at most ``force``. Raises ``InvalidArgument`` outside of
        the gripper's abilities."""

    @abstractmethod
    def stop(self) -> None:
        """End a motion where it is; the grip is kept. Safe from any thread."""

    @abstractmethod
    def width(self) -> float:
        """Distance between the finger pads, as last measured."""

    @abstractmethod
    def holding(self) -> bool:
        """Whether something is between the fingers and pressed."""


class RobotDriver(ABC):
    """Makes the link to one arm. ``simulated`` drivers need a simulator, hardware drivers get None."""

    simulated: bool = False

    @property
    def address(self) -> str:
        """What tells this robot from others, such as its network address: one process at a time may move it."""
        return type(self).__name__

    @abstractmethod
    def link(self, robot: RobotDescription, gripper: GripperDriver, simulator: Simulator | None = None) -> Link:
        """A new, unopened link to the described robot; it opens, stops and closes ``gripper`` with itself. Touches no
        device. Raises ``InvalidArgument`` for a description this driver cannot move."""
