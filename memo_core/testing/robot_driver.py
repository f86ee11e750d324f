"""Conformance suite for robot drivers: ``RULES[name](make)``, where ``make`` returns a new driver.

The rules drive a robot: a hardware driver is checked against a double at the level of its wire protocol. Drivers that
need a simulator are skipped here; their link is checked by ``memo_core.testing.link`` with the simulator built.
Rules take ``(make, robot)``; ``RULES`` binds a described test arm, ``rules_for(robot)`` another one.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import attrs
import numpy as np

from memo_core.arm.settling import apart, uncounted
from memo_core.arm.simulated_link import IncludedGripper
from memo_core.errors import BackendUnavailable, InvalidArgument, Stopped
from memo_core.interfaces.driver import GripperDriver, RobotDriver
from memo_core.interfaces.link import Health, Link
from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array
from memo_core.testing.fake_drivers import FakeGripper
from memo_core.testing.fake_environment import fake_robot
from memo_core.testing.link import sends_take_real_time
from memo_core.testing.rules import Rules

Make = Callable[[], RobotDriver]
Rule = Callable[[Make, RobotDescription], None]

_ELSEWHERE = 0.2  # rad by which the home posture is changed, so that an arm stands away from it
_LISTENING_S = 0.2
_STILL_TICKS = 30  # control periods in which fingers that have nearly arrived come to rest
_GRIPPER_KEY = "robot.gripper_driver"

_RULES: Rules[Rule] = Rules()
rule = _RULES.rule


def rules_for(robot: RobotDescription) -> dict[str, Callable[[Make], None]]:
    """The suite for drivers of ``robot``."""
    return {name: lambda make, check=check: check(make, robot) for name, check in _RULES.items()}  # type: ignore[misc]


def _made_with(make: Make, robot: RobotDescription, gripper: GripperDriver) -> Link | None:
    """A new link, or None if the driver says that it cannot work with such a gripper driver."""
    driver = make()
    if driver.simulated:
        raise BackendUnavailable("robot_driver", type(driver).__name__, "it needs a built simulator", "testing.link")
    try:
        return driver.link(robot, gripper)
    except InvalidArgument as error:
        if error.argument != _GRIPPER_KEY:
            told = f"{error}; that is for memo plugins check --robot NAME"
            raise BackendUnavailable("robot_driver", type(driver).__name__, told) from None
        return None


def _link(make: Make, robot: RobotDescription) -> Link:
    link = _made_with(make, robot, FakeGripper()) or _made_with(make, robot, IncludedGripper())
    assert link is not None, f"link() refuses every {_GRIPPER_KEY}"
    return link


@contextmanager
def _opened(make: Make, robot: RobotDescription) -> Iterator[Link]:
    """An open link, closed at the end."""
    link = _link(make, robot)
    link.open()
    try:
        yield link
    finally:
        link.close()


@rule
def making_a_link_connects_nothing(make: Make, robot: RobotDescription) -> None:
    """``link`` returns a new, unopened link each time: not healthy, with a reason, and its gripper untouched."""
    gripper = FakeGripper()
    link = _made_with(make, robot, gripper) or _link(make, robot)
    assert isinstance(link, Link), f"it made a {type(link).__name__}, expected a Link"
    assert link is not _link(make, robot), "it made the same link twice"
    health = link.health()
    assert isinstance(health, Health) and not health.ready, "an unopened link says that it is ready"
    assert health.problem, "an unopened link does not say why it is not ready"
    assert not gripper.calls, f"making a link called the gripper: {gripper.calls}"


@rule
def each_joint_has_one_finite_value(make: Make, robot: RobotDescription) -> None:
    """An open link answers for as many joints as the described robot has, or ``link`` refuses the robot."""
    with _opened(make, robot) as link:
        problem = uncounted(link)
        assert not problem, f"{problem}; for a robot of another number link() raises InvalidArgument"


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
    with _opened(make, robot) as link:
        assert link.health().ready, f"not ready after open: {link.health().problem}"
    assert not link.health().ready, "it says that it is ready after close"


@rule
def a_latched_stop_is_no_health(make: Make, robot: RobotDescription) -> None:
    """While the stop is latched the link is not ready and refuses motion; ``release`` makes it ready again."""
    with _opened(make, robot) as link:
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


@rule
def opening_moves_nothing(make: Make, robot: RobotDescription) -> None:
    """``open`` and ``close`` command neither arm nor gripper; the gripper is opened and closed with the link."""
    gripper = FakeGripper()
    separate = _made_with(make, robot, gripper)
    link = separate or _link(make, robot)
    link.open()
    try:
        first = link.joint_positions()
        assert abs(first - link.joint_positions()).max() < 1e-3, "the arm moves after open"
    finally:
        link.close()
    assert separate is None or gripper.calls == ["open", "close"], (
        f"the gripper heard {gripper.calls}, expected open and close: unless gripper.included, the link opens, moves "
        f"and stops it, or link() raises InvalidArgument({_GRIPPER_KEY!r}, …)"
    )


@rule
def a_stop_reaches_the_gripper(make: Make, robot: RobotDescription) -> None:
    """``stop`` ends the motion of a gripper that has a connection of its own."""
    gripper = FakeGripper()
    link = _made_with(make, robot, gripper)
    if link is None:
        return
    link.open()
    try:
        link.stop()
        assert "stop" in gripper.calls, "the gripper was not stopped"
    finally:
        link.close()


@rule
def targets_start_where_the_arm_is(make: Make, robot: RobotDescription) -> None:
    """After ``open``, ``joint_targets`` is where the arm is measured, whatever the description's home posture is."""
    for home in (robot.home, tuple(float(angle) for angle in np.array(robot.home) + _ELSEWHERE)):
        with _opened(make, attrs.evolve(robot, home=home)) as link:
            problem = apart(link)
            assert not problem, f"{problem}, before anything was sent: the first command would make the arm leap"


@rule
def sends_take_a_control_period_of_real_time(make: Make, robot: RobotDescription) -> None:
    """``send`` waits until the control period has passed on the clock on the wall, and ``real_time`` says so."""
    with _opened(make, robot) as link:
        assert link.real_time, "real_time is False: that is for links to simulators"
        sends_take_real_time(link)


@rule
def the_clock_goes_by_itself(make: Make, robot: RobotDescription) -> None:
    """``time`` goes on while nothing is sent, no faster than the clock on the wall."""
    with _opened(make, robot) as link:
        began, first = time.monotonic(), link.time()
        time.sleep(_LISTENING_S)
        passed = link.time() - first
        wall = time.monotonic() - began
    assert passed > 0.0, f"time() stood still for {wall:.2f} s: a robot's clock goes whether or not anything is sent"
    assert passed < 1.05 * wall + 0.02, f"time() went {passed:.2f} s in {wall:.2f} s"


@rule
def the_gripper_that_is_configured_moves(make: Make, robot: RobotDescription) -> None:
    """``set_gripper``, ``gripper_width`` and ``holding`` are those of the gripper driver, and with ``included`` those
    of the link's own fingers; or ``link`` refuses one of the two."""
    separate = FakeGripper()
    for gripper in (separate, IncludedGripper()):
        link = _made_with(make, robot, gripper)
        if link is None:
            continue
        link.open()
        try:
            _moves_fingers(link)
        except (AssertionError, BackendUnavailable) as error:
            kind = "included" if gripper.included else "one with its own connection"
            raise AssertionError(f"where the gripper driver is {kind}: {error}") from None
        finally:
            link.close()
        if gripper is separate:
            assert "move" in separate.calls, f"a separate gripper heard {separate.calls}, and no move"


def _moves_fingers(link: Link) -> None:
    """Raises ``AssertionError`` if the fingers do not go where they are sent."""
    gripper, target = link.description.gripper, link.joint_targets()
    for width in (gripper.stroke / 2, gripper.stroke):
        link.set_gripper(width, gripper.max_force)
        ticks = int((2 * gripper.stroke / gripper.speed + 1.0) / link.control_period)
        arrived = any(_at(link, width, target) for _ in range(ticks))
        assert arrived, f"commanded {width:.3f} m, reached {link.gripper_width():.3f} m"
        for _ in range(_STILL_TICKS):
            link.send(target)
        assert not link.holding(), f"it claims to hold something at {width:.3f} m, with nothing there"


def _at(link: Link, width: float, target: Array) -> bool:
    link.send(target)
    return abs(link.gripper_width() - width) < 0.003


RULES = rules_for(fake_robot())
