"""Drivers without hardware: a robot and a gripper that follow their commands. For tests of what uses drivers."""

from __future__ import annotations

import time

import numpy as np

from memo_core.errors import BackendUnavailable
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
    """An ideal arm that refuses every command while it is not open."""

    def __init__(self, description: RobotDescription, gripper: GripperDriver) -> None:
        super().__init__(description)
        self._gripper = gripper
        self._connected = False

    def open(self) -> None:
        self._gripper.open(self.description.gripper)
        self._connected = True

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


class FakeDriver(RobotDriver):
    """Makes links to ideal arms."""

    def link(self, robot: RobotDescription, gripper: GripperDriver, simulator: Simulator | None = None) -> Link:
        return FakeDriverLink(robot, gripper)
