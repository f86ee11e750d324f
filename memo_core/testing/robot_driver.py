"""Conformance suite for robot drivers: ``RULES[name](make)``, where ``make`` returns a new driver.

The rules drive a robot: a hardware driver is checked against a double at the level of its wire protocol. Drivers that
need a simulator are skipped here; their link is checked by ``memo_core.testing.link`` with the simulator built.
Rules take ``(make, robot)``; ``RULES`` binds a described test arm, ``rules_for(robot)`` another one.
"""

from __future__ import annotations

from collections.abc import Callable

from memo_core.errors import BackendUnavailable, Stopped
from memo_core.interfaces.driver import RobotDriver
from memo_core.interfaces.link import Health, Link
from memo_core.robot.description import RobotDescription
from memo_core.testing.fake_drivers import FakeGripper
from memo_core.testing.fake_environment import fake_robot
from memo_core.testing.rules import Rules

Make = Callable[[], RobotDriver]
Rule = Callable[[Make, RobotDescription], None]

_RULES: Rules[Rule] = Rules()
rule = _RULES.rule


def rules_for(robot: RobotDescription) -> dict[str, Callable[[Make], None]]:
    """The suite for drivers of ``robot``."""
    return {name: lambda make, check=check: check(make, robot) for name, check in _RULES.items()}  # type: ignore[misc]


def _link(make: Make, robot: RobotDescription, gripper: FakeGripper | None = None) -> Link:
    driver = make()
    if driver.simulated:
        raise BackendUnavailable("robot_driver", type(driver).__name__, "it needs a built simulator", "testing.link")
    return driver.link(robot, gripper or FakeGripper())


@rule
def making_a_link_connects_nothing(make: Make, robot: RobotDescription) -> None:
    """``link`` returns a new, unopened link each time: not healthy, with a reason, and its gripper untouched."""
    gripper = FakeGripper()
    link = _link(make, robot, gripper)
    assert isinstance(link, Link), f"it made a {type(link).__name__}, expected a Link"
    assert link is not _link(make, robot), "it made the same link twice"
    health = link.health()
    assert isinstance(health, Health) and not health.ready, "an unopened link says that it is ready"
    assert health.problem, "an unopened link does not say why it is not ready"
    assert not gripper.calls, f"making a link called the gripper: {gripper.calls}"


@rule
def closing_is_allowed_at_any_time(make: Make, robot: RobotDescription) -> None:
    """``close`` works before ``open`` and twice after it."""
    link = _link(make, robot)
    link.close()
    link.open()
    link.close()
    link.close()


@rule
def an_open_link_is_ready_and_a_closed_one_is_not(make: Make, robot: RobotDescription) -> None:
    """``health`` follows ``open`` and ``close``."""
    link = _link(make, robot)
    link.open()
    try:
        assert link.health().ready, f"not ready after open: {link.health().problem}"
    finally:
        link.close()
    assert not link.health().ready, "it says that it is ready after close"


@rule
def a_latched_stop_is_no_health(make: Make, robot: RobotDescription) -> None:
    """While the stop is latched the link is not ready and refuses motion; ``release`` makes it ready again."""
    link = _link(make, robot)
    link.open()
    try:
        link.stop()
        assert not link.health().ready and link.health().problem, "ready, or silent, while the stop is latched"
        try:
            link.send(link.joint_positions())
        except Stopped:
            pass
        else:
            raise AssertionError("it moved although the stop was latched")
        link.release()
        assert link.health().ready, f"not ready after the release: {link.health().problem}"
    finally:
        link.close()


@rule
def opening_moves_nothing(make: Make, robot: RobotDescription) -> None:
    """``open`` and ``close`` command neither arm nor gripper; the gripper is opened and closed with the link."""
    gripper = FakeGripper()
    link = _link(make, robot, gripper)
    link.open()
    try:
        first = link.joint_positions()
        assert abs(first - link.joint_positions()).max() < 1e-3, "the arm moves after open"
    finally:
        link.close()
    assert gripper.calls == ["open", "close"], f"the gripper heard {gripper.calls}, expected open and close"


@rule
def a_stop_reaches_the_gripper(make: Make, robot: RobotDescription) -> None:
    """``stop`` ends the motion of a gripper that has a connection of its own."""
    gripper = FakeGripper()
    link = _link(make, robot, gripper)
    link.open()
    try:
        link.stop()
        assert "stop" in gripper.calls, "the gripper was not stopped"
    finally:
        link.close()


RULES = rules_for(fake_robot())
