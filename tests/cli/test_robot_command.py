"""``memo robot``: what is checked, moved and recovered, through a driver that stands in for a real arm."""

from __future__ import annotations

import numpy as np
import pytest
from memo_franka.description import fr3

from memo_core.arm.slow_motion import move_joints
from memo_core.cli import robot as command
from memo_core.environment.hardware import HardwareSettings
from memo_core.environment.hardware_check import examine_host, examine_robot
from memo_core.environment.lease import Lease
from memo_core.errors import BackendUnavailable, InvalidArgument, RobotFault, Stopped
from memo_core.interfaces.driver import RobotDriver
from memo_core.robot.safety import SafetyLimits
from memo_core.testing.fake_drivers import FakeDriverLink, FakeGripper

ROBOT, LIMITS = fr3(), SafetyLimits()
FAULT = RobotFault("10.9.9.9", "reflex", "it ended the motion by a reflex", "memo robot recover")


class Arm(FakeDriverLink):
    fault: RobotFault | None = None

    def open(self):
        if self.fault is not None:
            raise self.fault
        super().open()

    def joint_positions(self):
        self._time += 0.001  # a clock that goes while somebody listens
        return super().joint_positions()


class Driver(RobotDriver):
    address = "10.9.9.9"

    def __init__(self, fault: RobotFault | None = None) -> None:
        self.fault = fault
        self.links: list[Arm] = []

    def link(self, robot, gripper, simulator=None):
        link = Arm(robot, gripper)
        link.fault = self.fault
        self.links.append(link)
        return link


def examined(driver: Driver, limits: SafetyLimits = LIMITS):
    return {one.what: one for one in examine_robot(driver, FakeGripper(), ROBOT, HardwareSettings(limits), None, 0.05)}


def test_a_check_moves_nothing_and_says_how_the_robot_is():
    driver = Driver()
    found = examined(driver)
    assert found["connection"].detail == "fr3 at 10.9.9.9" and found["health"].state == "ok"
    assert {"states", "limits", "gripper", "force at rest"} <= set(found)
    [arm] = driver.links
    assert not arm.sent and not arm.health().ready, "closed, and never commanded"
    free = Lease("10.9.9.9")
    free.take()
    free.give_back()


def test_what_keeps_a_robot_from_moving_comes_with_its_remedy():
    found = examined(Driver(FAULT))
    assert (found["connection"].state, found["connection"].remedy) == ("failed", "memo robot recover")
    narrow = SafetyLimits(workspace=[0.5, -0.5, 0.0, 0.8, 0.5, 1.0])
    assert examined(Driver(), narrow)["limits"].state == "failed"
    held = Lease("10.9.9.9")
    held.take()
    try:
        assert "moves the robot" in examined(Driver())["lease"].detail
    finally:
        held.give_back()


def test_the_host_is_looked_at():
    assert {"kernel", "real-time priority"} <= {one.what for one in examine_host()}
    assert all(one.remedy for one in examine_host() if one.state != "ok")


def test_a_joint_moves_slowly_within_the_limits_and_stops_at_rest():
    link = Arm(ROBOT, FakeGripper())
    link.open()
    goal = np.array(ROBOT.home) + 0.3 * np.eye(7)[0]
    move_joints(link, goal)
    sent = np.array(link.sent)
    assert np.abs(sent[-1] - goal).max() < 1e-9
    assert np.abs(np.diff(sent, axis=0)).max() / link.control_period < 0.3 * 2.62
    first = ROBOT.joints[0]
    beyond = rf"joint 1 \({first.name}\): 9\.3.*beyond its limit; expected {first.lower:.4g} to {first.upper:.4g}"
    with pytest.raises(InvalidArgument, match=beyond) as raised:
        move_joints(link, goal + 9.0 * np.eye(7)[0])
    assert ROBOT.joints[1].name not in str(raised.value)
    link.stop_at = len(link.sent) + 30
    with pytest.raises(Stopped):
        move_joints(link, np.array(ROBOT.home))
    sent = np.array(link.sent)
    assert np.abs(sent[-1] - sent[-2]).max() < 1e-4 and np.abs(sent[-1] - ROBOT.home).max() > 0.05


def test_commands_for_real_robots_say_so_where_there_is_none():
    with pytest.raises(BackendUnavailable, match="moves no real robot"):
        command.check(None, None, False)


def test_a_driver_that_cannot_recover_says_so():
    with pytest.raises(BackendUnavailable, match="manual"):
        Arm(ROBOT, FakeGripper()).recover()
