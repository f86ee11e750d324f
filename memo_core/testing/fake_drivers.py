"""Drivers without hardware: a robot and a gripper that follow their commands. For tests of what uses drivers."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.driver import GripperDriver, RobotDriver, check_gripper_command
from memo_core.interfaces.link import Health, Link
from memo_core.interfaces.simulator import Simulator
from memo_core.robot.description import GripperDescription, RobotDescription
from memo_core.scene.pose import Array
from memo_core.testing.ideal_link import IdealLink


class FakeGripper(GripperDriver):
    """Fingers that move at the described speed in real time. ``calls`` are the names of what was called."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self._gripper = GripperDescription()
        self._open = False
        self._from = self._goal = self._gripper.stroke
        self._since = 0.0

    def open(self, gripper: GripperDescription) -> None:
        self.calls.append("open")
        self._gripper, self._open = gripper, True

    def close(self) -> None:
        if self._open:
            self.calls.append("close")
        self._open = False

    def health(self) -> Health:
        return Health(self._open, "" if self._open else "it is not open")

    def move(self, width: float, force: float) -> None:
        check_gripper_command(self._gripper, width, force)
        self.calls.append("move")
        self._from, self._goal, self._since = self.width(), width, time.monotonic()

    def stop(self) -> None:
        self.calls.append("stop")
        self._from = self._goal = self.width()

    def width(self) -> float:
        way = self._gripper.speed * (time.monotonic() - self._since)
        return float(np.clip(self._goal, self._from - way, self._from + way))

    def holding(self) -> bool:
        return False


class FakeDriverLink(IdealLink):
    """An ideal arm that refuses every command while it is not open, and takes as long for each as a real one.
    ``real_time`` may be set to False: it then runs as fast as it can."""

    real_time = True
    can_restore = False

    def __init__(self, description: RobotDescription, gripper: GripperDriver, start: Array | None = None) -> None:
        super().__init__(description, start)
        self._gripper = gripper
        self._connected = False
        self._due = 0.0  # s on the clock on the wall, at which the next command is due

    def open(self) -> None:
        self._gripper.open(self.description.gripper)
        self._connected = True
        self._targets = self.joint_positions()

    def close(self) -> None:
        if self._connected:
            self._gripper.close()
        self._connected = False

    def health(self) -> Health:
        return super().health() if self._connected else Health(False, "the link is not open")

    def stop(self) -> None:
        super().stop()
        self._gripper.stop()

    def send(self, targets: Array) -> None:
        if not self._connected:
            raise BackendUnavailable("robot", self.description.name, "the link is not open", "open()")
        super().send(targets)

    def _advance(self, targets: Array) -> None:
        super()._advance(targets)
        if self.real_time:
            now = time.monotonic()
            self._due = (self._due if now < self._due + self.control_period else now) + self.control_period
            time.sleep(max(0.0, self._due - now))

    def set_gripper(self, width: float, force: float) -> None:
        super().set_gripper(width, force)
        if not self._gripper.included:
            gripper = self.description.gripper
            self._gripper.move(
                float(np.clip(width, 0.0, gripper.stroke)), float(np.clip(force, 0.0, gripper.max_force))
            )

    def gripper_width(self) -> float:
        return super().gripper_width() if self._gripper.included else self._gripper.width()

    def holding(self) -> bool:
        return super().holding() if self._gripper.included else self._gripper.holding()

    def time(self) -> float:
        return time.monotonic() if self.real_time else super().time()


class FakeDriver(RobotDriver):
    """Makes links to ideal arms.

    Args:
        start: joint positions (n,), rad, at which an arm stands when its link is made; None for its home posture.
        feels_force: whether its links measure forces, all zero.
    """

    address = "double"

    def __init__(self, start: Sequence[float] | None = None, feels_force: bool = True) -> None:
        self._start, self._feels_force = start, feels_force

    def link(self, robot: RobotDescription, gripper: GripperDriver, simulator: Simulator | None = None) -> Link:
        """Raises ``InvalidArgument`` if ``start`` has another number of joints than the robot."""
        if self._start is not None and len(self._start) != len(robot.joints):
            problem = f"has {len(self._start)} values, and {robot.name!r} {len(robot.joints)} joints"
            raise InvalidArgument("robot.driver.start", problem, "one value per joint, rad")
        link = FakeDriverLink(robot, gripper, None if self._start is None else np.array(self._start))
        link.feels_force = self._feels_force
        return link
