"""What moves a described robot or gripper: a simulator or hardware.

A robot plugin describes an arm, a *robot driver* creates the link that moves it, and a *gripper driver* moves a gripper
that has its own connection. In a config both belong to the robot: ``robot: {backend: fr3, driver: {backend: …}}``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

from memo_core.errors import InvalidArgument
from memo_core.interfaces.link import Health, Link
from memo_core.interfaces.simulator import Simulator
from memo_core.robot.description import GripperDescription, RobotDescription


class GripperDriver(ABC):
    """One gripper with its own connection. The constructor touches no device. Widths in m, forces in N.

    All calls return at once; ``move`` only starts a motion. The arm's link owns the stop switch and calls ``stop``.
    """

    included: bool = False  # True: the robot's driver moves the gripper itself and never calls this object

    @abstractmethod
    def open(self, gripper: GripperDescription) -> None:
        """Connect, and check that the device is the gripper described; nothing moves.

        Args:
            gripper: description of the gripper.

        Raises:
            BackendUnavailable: if it cannot be reached or is not the gripper described.
        """

    @abstractmethod
    def close(self) -> None:
        """Disconnect; what is held stays held. Idempotent; allowed before ``open``."""

    @abstractmethod
    def health(self) -> Health:
        """Quick, no motion, from any thread; never raises."""

    @abstractmethod
    def move(self, width: float, force: float) -> None:
        """Start to open or close the fingers; returns at once.

        Args:
            width: distance between the pads to go to, m, 0 to ``stroke``.
            force: largest force to press with, N, 0 to ``max_force``.

        Raises:
            InvalidArgument: for a value outside the described range (``check_gripper_command``); nothing moves.
            BackendUnavailable: if the gripper is not open or the connection is lost.
        """

    @abstractmethod
    def stop(self) -> None:
        """End a motion where it is; the grip is kept. Safe from any thread."""

    @abstractmethod
    def width(self) -> float:
        """Distance between the finger pads, as last measured."""

    @abstractmethod
    def holding(self) -> bool:
        """Whether the fingers press on an object."""


def check_gripper_command(gripper: GripperDescription, width: float, force: float) -> None:
    """Check the arguments of ``GripperDriver.move``.

    Args:
        gripper: description that states ``stroke`` and ``max_force``.
        width: distance between the pads, m, 0 to ``stroke``.
        force: largest force, N, 0 to ``max_force``.

    Raises:
        InvalidArgument: if a value is outside its range or not finite.
    """
    if not (math.isfinite(width) and 0.0 <= width <= gripper.stroke):
        raise InvalidArgument("width", f"is {width} m", f"0 to {gripper.stroke} m")
    if not (math.isfinite(force) and 0.0 <= force <= gripper.max_force):
        raise InvalidArgument("force", f"is {force} N", f"at most {gripper.max_force} N")


class RobotDriver(ABC):
    """Makes the link to one arm. ``simulated`` drivers need a simulator, hardware drivers get None."""

    simulated: bool = False
    longest_tick: float = math.inf  # s, that a simulator's control period may have

    @property
    def address(self) -> str:
        """Identifies this robot, for instance its network address; only one process at a time may move it."""
        return type(self).__name__

    @abstractmethod
    def link(self, robot: RobotDescription, gripper: GripperDriver, simulator: Simulator | None = None) -> Link:
        """Create an unopened link to the described robot, a new one for each call. Touches no device.

        The link opens, stops and closes ``gripper`` with itself.

        Args:
            robot: the arm and its gripper.
            gripper: driver of the gripper; if ``included``, the link moves the gripper itself.
            simulator: open simulator with this robot built; None for hardware.

        Returns:
            The link.

        Raises:
            InvalidArgument: if this driver cannot move such a robot, or a simulated driver gets no simulator.
        """
