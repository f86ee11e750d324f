"""A double of Franka's control box and Hand with links of the driver to it, for tests on the double's clock."""

from __future__ import annotations

import contextlib
import itertools
import os
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from memo_franka.description import fr3
from memo_franka.driver import FrankaDriver, FrankaLink
from memo_franka.settings import FrankaSettings
from memo_franka.testing.control_box import ControlBox
from memo_franka.testing.hand import HandDouble

from memo_core.arm.guarded_link import GuardedLink
from memo_core.arm.simulated_link import IncludedGripper
from memo_core.interfaces.driver import GripperDriver
from memo_core.robot.safety import SafetyLimits

ROBOT = fr3()
ADDRESSES = (f"127.{1 + os.getpid() % 200}.{n // 200}.{1 + n % 200}" for n in itertools.count())
BUSY_S = 2.0  # a busy computer may slow the double's clock down; it must not count as frozen
BUSY = {"clock_timeout_s": BUSY_S, "hand_deadline_s": 60.0}
ACCELERATION, JERK = 10.0, 5000.0  # rad/s2 and rad/s3, of every joint of an FR3
ACCEPTED = 7.5  # rad/s2, the most that PyPI's client library accepts for joint 2: a Panda's limit
GRACE_MS = 60  # beyond what the limits need


def until(condition: Callable[[], object], seconds: float = 60.0) -> bool:
    """Whether it holds within wall-clock seconds."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.005)
    return bool(condition())


class Cell:
    """A double and a link to it."""

    def __init__(self, version: int = 10) -> None:
        self.address = next(ADDRESSES)
        self.hand = HandDouble(self.address)
        self.box = ControlBox(ROBOT, self.address, version=version, hand=self.hand)
        self.links: list[FrankaLink] = []

    def link(self, gripper: GripperDriver | None = None, **settings) -> FrankaLink:
        """A new open link; the one before is closed."""
        link = self._made(gripper, settings)
        link.open()
        self.box.reader = lambda: link._now
        return link

    def guarded(self, limits: SafetyLimits, **settings) -> GuardedLink:
        """The same, as an environment uses it: with limits."""
        link = self._made(None, settings)
        guarded = GuardedLink(link, ROBOT, limits)
        guarded.open()
        self.box.reader = lambda: link.awaited
        return guarded

    def _made(self, gripper: GripperDriver | None, settings: dict[str, Any]) -> FrankaLink:
        self.close_links()
        driver = FrankaDriver(FrankaSettings(self.address, **{**BUSY, **settings}))
        link = driver.link(ROBOT, gripper or IncludedGripper())
        assert isinstance(link, FrankaLink)
        self.links.append(link)
        return link

    def close_links(self) -> None:
        self.box.reader = None
        while self.links:
            self.links.pop().close()

    def rest_ms(self, since: int) -> int:
        """Milliseconds of the box's clock from tick ``since`` until the arm is at rest, which is waited for."""
        self.box.reader = None
        assert until(lambda: self.box.arm.resting), "it does not come to rest"
        return self.box.rested_at - since


@contextlib.contextmanager
def running_cell():
    cell = Cell()
    with cell.hand, cell.box:
        try:
            yield cell
        finally:
            cell.close_links()


def braking_ms(speed: float, acceleration: float = ACCELERATION) -> float:
    """What a joint at ``speed`` (rad/s) needs to come to rest within its limits."""
    return 1000 * (speed / acceleration + acceleration / JERK)


def swing(link: FrankaLink, seconds: float = 2.0, size: float = 0.3):
    """Targets of a smooth motion there and back, which begins and ends at rest."""
    home = link.joint_targets()
    times = np.arange(1, round(seconds / link.control_period) + 1) * link.control_period
    for t in times:
        yield home + size / 2 * (1 - np.cos(2 * np.pi * t / seconds))
