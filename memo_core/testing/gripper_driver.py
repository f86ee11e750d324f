"""Conformance suite for gripper drivers: ``RULES[name](make)``, where ``make`` returns a new driver.

Hardware drivers are checked against a double of their wire protocol, with nothing between the fingers. Drivers whose
gripper is moved by the robot's driver (``included``) are skipped.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.driver import GripperDriver
from memo_core.interfaces.link import Health
from memo_core.robot.description import GripperDescription
from memo_core.testing.rules import Rules

Make = Callable[[], GripperDriver]
Rule = Callable[[Make], None]

RULES: Rules[Rule] = Rules()
rule = RULES.rule
_GRIPPER = GripperDescription()
_PATIENCE_S = 10.0  # for one motion over the stroke


def _made(make: Make) -> GripperDriver:
    driver = make()
    if driver.included:
        raise BackendUnavailable("gripper_driver", type(driver).__name__, "the robot's driver moves the gripper")
    return driver


@contextmanager
def _opened(make: Make) -> Iterator[GripperDriver]:
    driver = _made(make)
    driver.open(_GRIPPER)
    try:
        yield driver
    finally:
        driver.close()


def _arrives(driver: GripperDriver, width: float) -> bool:
    end = time.monotonic() + _PATIENCE_S
    while abs(driver.width() - width) > 0.002 and time.monotonic() < end:
        time.sleep(0.005)
    return abs(driver.width() - width) <= 0.002


@rule
def closing_is_allowed_at_any_time(make: Make) -> None:
    """``close`` works before ``open`` and twice after it."""
    driver = _made(make)
    driver.close()
    driver.open(_GRIPPER)
    driver.close()
    driver.close()


@rule
def health_follows_open_and_close(make: Make) -> None:
    """Ready exactly while it is open; otherwise with a reason."""
    driver = _made(make)
    health = driver.health()
    assert isinstance(health, Health) and not health.ready and health.problem, "ready, or silent, before open"
    driver.open(_GRIPPER)
    try:
        assert driver.health().ready, f"not ready after open: {driver.health().problem}"
    finally:
        driver.close()
    assert not driver.health().ready, "ready after close"


@rule
def opening_moves_nothing(make: Make) -> None:
    """The fingers stay where they are when the driver connects."""
    with _opened(make) as driver:
        width = driver.width()
        time.sleep(0.05)
        assert abs(driver.width() - width) < 1e-3, "the fingers move after open"


@rule
def the_fingers_go_where_they_are_sent(make: Make) -> None:
    """``move`` returns at once and the width is reached; with nothing between the fingers nothing is held."""
    with _opened(make) as driver:
        for width in (_GRIPPER.stroke, _GRIPPER.stroke / 2, 0.0):
            started = time.monotonic()
            driver.move(width, _GRIPPER.max_force)
            took = time.monotonic() - started
            assert took < 0.5, f"move took {took:.2f} s: it must return at once"
            assert _arrives(driver, width), f"sent to {width} m, is at {driver.width():.3f} m"
            assert not driver.holding(), f"claims to hold something at {width} m"


@rule
def impossible_commands_are_refused(make: Make) -> None:
    """A width beyond the stroke, a force beyond the greatest, or what is no number: ``InvalidArgument``, no motion."""
    with _opened(make) as driver:
        before = driver.width()
        for width, force in ((_GRIPPER.stroke * 2, 20.0), (-0.01, 20.0), (0.02, 1e4), (math.nan, 20.0)):
            try:
                driver.move(width, force)
            except InvalidArgument:
                continue
            raise AssertionError(f"it accepted a width of {width} m with {force} N")
        assert abs(driver.width() - before) < 1e-3, "a refused command moved the fingers"


@rule
def a_stop_ends_the_motion(make: Make) -> None:
    """After ``stop`` the fingers stay where they are."""
    with _opened(make) as driver:
        driver.move(_GRIPPER.stroke, _GRIPPER.max_force)
        assert _arrives(driver, _GRIPPER.stroke), "it does not open"
        driver.move(0.0, _GRIPPER.max_force)
        driver.stop()
        time.sleep(0.02)
        width = driver.width()
        time.sleep(0.1)
        assert abs(driver.width() - width) < 1e-3, "the fingers move on after stop"
        assert width > 0.002, "the motion had ended before the stop was tried: the double is too quick to tell"
