"""The link between the arm and the simulator or hardware that moves. Everything above it is the same code.

The link owns the latched stop: ``stop`` may be called from any thread or signal handler; from then on
``send`` refuses (raises ``Stopped``) until ``release``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod

import attrs

from memo_core.errors import BackendUnavailable, Stopped
from memo_core.process.signal_safe import Flag
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array


@attrs.frozen
class Health:
    """Whether a device accepts commands now; if not, the reason and the remedy. ``measures`` are in SI units, for
    logs."""

    ready: bool
    problem: str = ""
    measures: dict[str, float] = attrs.field(factory=dict)


class Link(ABC):
    """Joint-level access to one robot. All arrays have one value per arm joint, rad, in the description's order.

    The constructor touches no device. ``open`` connects, ``close`` leaves the robot at rest with its brakes or its
    position controller engaged; between them every other method may be called.
    """

    control_period: float = 0.01  # s between two sends
    real_time: bool = True  # whether a send takes its control period on the clock on the wall; False: a simulator
    can_restore: bool = False  # exact restore of the world (a simulator); hardware needs a guided reset
    feels_force: bool = False  # whether it has a ``contact_wrench``
    gives_way: str = (
        ""  # setting that would make its arm give way to contact, such as "robot.driver.mode=impedance"; empty: none
    )
    commanded_width: float | None = None  # m, opening that the gripper was last sent to; None: not known
    servo_lag: tuple[float, ...] = ()  # s by which each joint's servo lags behind moving targets; empty: not at all

    def __init__(self, description: RobotDescription) -> None:
        """Prepare a link; touches no device.

        Args:
            description: the arm and its gripper.
        """
        self.description = description
        self._stop = Flag()

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Connect, and start ``joint_targets`` at the measured positions: the arm moves from there to the first targets
        that are sent. Raises ``BackendUnavailable`` with the remedy. A simulator's link has nothing to open."""

    def close(self) -> None:
        """Disconnect, the robot at rest. Idempotent; allowed before ``open``."""

    def health(self) -> Health:
        """Whether the robot can be commanded. Quick, no motion, from any thread; never raises."""
        return Health(not self.stopped, "the stop is latched" if self.stopped else "")

    def particulars(self) -> dict[str, str]:
        """What a person should know and verify before the first motion, in words: name -> value, such as the version of
        the client library or the load. The values are the same whenever the robot is the same; for an open link."""
        return {}

    # -- stopping ------------------------------------------------------------------------------------------------------
    def stop(self) -> None:
        """Latch the stop. Safe from any thread and from signal handlers."""
        self._stop.set()

    def release(self) -> None:
        self._stop.clear()

    @property
    def stopped(self) -> bool:
        return self._stop.is_set()

    def check_stop(self, where: str = "") -> None:
        """Raise ``Stopped`` if the stop is latched.

        Args:
            where: activity that the stop interrupts, for the message, such as ``settling``.

        Raises:
            Stopped: if the stop is latched.
        """
        if self._stop.is_set():
            raise Stopped(where)

    def recover(self) -> None:
        """Clear an error of the robot, after a person has inspected it; nothing moves. Allowed while closed, and leaves
        the link closed. Raises ``RobotFault`` if the error persists, ``BackendUnavailable`` if nothing can be done."""
        problem = "its driver cannot take it out of an error"
        raise BackendUnavailable("robot", self.description.name, problem, "see the robot's own manual")

    # -- state and commands --------------------------------------------------------------------------------------------
    @abstractmethod
    def joint_positions(self) -> Array: ...

    @abstractmethod
    def joint_velocities(self) -> Array: ...

    @abstractmethod
    def joint_targets(self) -> Array:
        """The last commanded joint positions."""

    @abstractmethod
    def gripper_width(self) -> float: ...

    @abstractmethod
    def holding(self) -> bool:
        """Whether the fingers press on an object."""

    def contact_wrench(self) -> Array:
        """Force (N), then torque (Nm), that the environment exerts on the tool at its centre, in base axes, shape (6,).
        It includes the weight of a held object and excludes the arm's own weight and motion. A slowly drifting bias is
        allowed. Raises ``BackendUnavailable`` for a robot that does not measure forces."""
        raise BackendUnavailable("robot", self.description.name, "its link feels no forces", "one that does")

    def check(self, skill: str, targets: Array) -> None:
        """Check a motion before anything moves; by default every motion passes.

        Args:
            skill: name of the skill that the error is for.
            targets: joint positions (T, n), rad (m for a slide), one row for each control period. The motion starts
                from ``joint_targets()``; the first row is due one control period later.

        Raises:
            MotionError: if the link would refuse one of the targets during the motion, for example for its speed.
        """

    @abstractmethod
    def send(self, targets: Array) -> None:
        """Command joint positions for one control period and let it pass: on hardware by waiting for a deadline, since
        callers send the next targets as soon as it returns.

        Args:
            targets: joint positions (n,), rad; the link keeps no reference to the array.

        Raises:
            Stopped: if the stop is latched; nothing is commanded.
            InvalidArgument: for targets that the link cannot follow, such as values that are not finite.
            MotionError: if a safety limit ends the motion; the arm is at rest.
            RobotFault: if a real robot no longer accepts commands.
        """

    def halt(self, targets: Array) -> None:
        """Decelerate to rest along ``targets``, the grip unchanged.

        Accepted while the stop is latched, unlike every other command, and the last one before ``release``. Hardware
        that stops on its own may ignore the targets.

        Args:
            targets: decelerating joint positions (T, n), rad, one row for each control period.
        """

    @abstractmethod
    def set_gripper(self, width: float, force: float) -> None:
        """Command the gripper; returns at once.

        Args:
            width: distance between the pads to go to, m, 0 to close; limited to the gripper's stroke.
            force: largest force to press with, N, above 0; limited to the gripper's ``max_force``.

        Raises:
            Stopped: if the stop is latched; nothing is commanded.
        """

    @abstractmethod
    def time(self) -> float:
        """Seconds on the robot's clock, which goes whether or not anything is sent (simulated time in a simulator)."""

    # -- restoring -----------------------------------------------------------------------------------------------------
    @abstractmethod
    def checkpoint(self) -> bytes: ...

    @abstractmethod
    def restore(self, checkpoint: bytes) -> None:
        """Restore the world and the link to a checkpoint; called only where ``can_restore``.

        Args:
            checkpoint: bytes that ``checkpoint`` returned for the same scene and robot.

        Raises:
            InvalidArgument: if the bytes are not such a checkpoint.
        """
