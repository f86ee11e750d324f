"""The Franka driver through TCP and UDP: unmodified franky against a double of the control box and of the Hand."""

from __future__ import annotations

import itertools
import os
import time

import numpy as np
import pytest
from memo_franka.driver import FrankaDriver
from memo_franka.hand import FrankaHand
from memo_franka.scheduling import Scheduling
from memo_franka.settings import FrankaSettings, HandSettings
from memo_franka.testing.hand import Fingers, HandDouble
from memo_franka.testing.wire import Error, HandCommand, HandStatus

from memo_core.errors import RobotFault
from memo_core.testing import gripper_driver, robot_driver
from memo_core.testing.link import RULES
from tests.support.franka_cell import ADDRESSES, BUSY_S, ROBOT, running_cell, swing, until

pytest.importorskip("franky", reason="pip install 'plugins/franka[hardware]'")
pytestmark = [
    pytest.mark.filterwarnings("ignore:this computer's kernel is not real-time"),
    pytest.mark.usefixtures("real_time"),
    pytest.mark.wire,
]

MODES = {"velocity": 0.001, "impedance": 0.005}  # rad, worst tracking error on a smooth motion


@pytest.fixture
def cell():
    with running_cell() as cell:
        yield cell


# -- the suites --------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("rule", RULES)
def test_the_link_conforms(cell, rule, mode):
    RULES[rule](lambda: cell.link(mode=mode))
    assert not cell.box.arm.violations


@pytest.mark.parametrize("rule", robot_driver.RULES)
def test_the_driver_conforms(cell, rule):
    settings = FrankaSettings(cell.address, clock_timeout_s=BUSY_S)
    robot_driver.rules_for(ROBOT)[rule](lambda: FrankaDriver(settings))
    assert not cell.box.arm.violations


@pytest.mark.parametrize("rule", gripper_driver.RULES)
def test_the_hand_conforms(rule):
    with HandDouble(next(ADDRESSES)) as hand:
        gripper_driver.RULES[rule](lambda: FrankaHand(HandSettings(hand.address)))


@pytest.mark.parametrize(("mode", "allowed"), MODES.items())
def test_a_smooth_motion_is_tracked_within_milliradians(cell, mode, allowed):
    link, worst = cell.link(mode=mode), 0.0
    home, times = link.joint_targets(), []
    for number, row in enumerate(swing(link), start=1):
        link.send(row)
        state = link._state  # one moment for both the clock and the joints
        times.append(state.time.to_msec())
        t = number * link.control_period + state.time.to_sec() - link._due
        there = home + 0.15 * (1 - np.cos(2 * np.pi * min(t, 2.0) / 2.0))
        worst = max(worst, float(np.abs(np.array(state.q) - there).max()))
    assert worst < allowed and not cell.box.arm.violations, f"{worst} rad; the clock's steps: {np.diff(times)} ms"


def test_only_the_threads_that_control_the_arm_have_its_priority(cell):
    def priorities() -> set[int]:
        return {os.sched_getparam(int(thread)).sched_priority for thread in os.listdir("/proc/self/task")}

    own = Scheduling.current()
    link = cell.link()
    assert Scheduling.current() == own and 99 not in priorities()
    moving = set()
    for row in swing(link, 1.0, size=0.05):
        link.send(row)
        moving |= priorities()
        assert Scheduling.current() == own, "the sandbox would inherit it"
    assert (99 in moving) == (own.policy == os.SCHED_RR), "franky gives the highest where it is allowed to"


# -- the Hand ----------------------------------------------------------------------------------------------------------
def test_a_hand_that_is_stuck_is_told_after_its_deadline():
    with HandDouble(next(ADDRESSES)) as hand:
        driver = FrankaHand(HandSettings(hand.address, deadline_s=0.3))
        driver.open(ROBOT.gripper)
        driver.move(0.0, 30.0)
        assert until(lambda: driver.width() <= 0.001)
        hand.fingers.thing = 0.03
        hand.fingers.command = lambda width, speed, force: None  # jammed
        driver.move(0.08, 30.0)
        assert until(lambda: not driver.health().ready)
        assert "did not end its motion" in driver.health().problem
        started = time.monotonic()
        driver.close()
        assert time.monotonic() - started < 4


def test_a_hand_that_answers_no_stop_delays_no_command_and_is_told():
    with HandDouble(next(ADDRESSES)) as hand:
        driver = FrankaHand(HandSettings(hand.address, deadline_s=0.5))
        driver.open(ROBOT.gripper)
        answer = hand._answer
        hand._answer = lambda command, number, payload: (
            None if command == HandCommand.STOP else answer(command, number, payload)
        )
        hand.fingers.command = lambda width, speed, force: None  # jammed
        for width in (0.0, 0.05, 0.0):
            started = time.monotonic()
            driver.move(width, 30.0)
            assert time.monotonic() - started < 0.3
            time.sleep(0.1)
        assert until(lambda: "did not end its motion" in driver.health().problem)
        driver.close()


@pytest.mark.parametrize(
    ("status", "told"),
    [(HandStatus.UNSUCCESSFUL, "did not reach 0.080 m"), (HandStatus.FAIL, "could not carry out a command")],
)
def test_a_hand_that_cannot_open_is_told_with_what_to_do(status, told):
    with HandDouble(next(ADDRESSES), Fingers(0.03)) as hand:
        driver = FrankaHand(HandSettings(hand.address))
        driver.open(ROBOT.gripper)
        end = hand._end
        hand._end = lambda ended: end(status)
        driver.move(0.08, 30.0)
        assert until(lambda: told in driver.health().problem) and "home it" in driver.health().problem
        driver.close()


def test_of_motions_that_follow_quickly_the_last_counts():
    with HandDouble(next(ADDRESSES)) as hand:
        driver = FrankaHand(HandSettings(hand.address))
        driver.open(ROBOT.gripper)
        for width in (0.0, 0.08, 0.01, 0.05, 0.02):
            driver.move(width, 30.0)
            time.sleep(0.02)
        assert until(lambda: abs(driver.width() - 0.02) < 0.001) and driver.health().ready
        time.sleep(0.1)
        assert abs(driver.width() - 0.02) < 0.001 and driver.health().ready
        driver.close()


# -- what lags ---------------------------------------------------------------------------------------------------------
class Lagging:
    """A robot whose ``lagging`` next states are those before; the client's thread loses ``slow`` (s) at each."""

    def __init__(self, robot, state, lagging, slow=0.0):
        self.real, self.last, self.lagging, self.slow = robot, state, lagging, slow

    def __getattr__(self, name):
        return getattr(self.real, name)

    @property
    def state(self):
        if not self.lagging:
            return self.real.state
        self.lagging -= 1
        time.sleep(self.slow)
        return self.last


def test_a_client_that_the_computer_starves_is_no_clock_that_stands_still(cell):
    link = cell.link(clock_timeout_s=0.1)
    link._robot = Lagging(link._robot, link._state, 1, slow=0.3)
    link.joint_positions()
    link._robot = Lagging(link._robot.real, link._state, 10**6)
    with pytest.raises(RobotFault, match="clock has stood still"):
        link.joint_positions()
    link._robot = link._robot.real


def test_a_state_that_lags_behind_the_end_of_a_motion_is_waited_for(cell):
    link = cell.link()
    for row in itertools.islice(swing(link), 40):
        link.send(row)
    before = link._state
    cell.box.brakes(True)
    assert until(lambda: not link._robot.is_in_control)
    link._robot = Lagging(link._robot, before, 20, slow=0.001)
    with pytest.raises(RobotFault, match="Unlock joints") as caught:
        link.send(link.joint_targets())
    assert caught.value.fault == "brakes"
    link._robot = link._robot.real


def test_limits_are_those_of_both_the_description_and_the_library(cell):
    link = cell.link()
    robot = link._robot
    assert np.all(np.asarray(robot.joint_acceleration_limit.get()) <= 9.5 + 1e-9)
    assert np.all(np.asarray(robot.joint_jerk_limit.get()) <= 4750 + 1e-6)


def test_the_double_ends_what_breaks_its_limits(cell):
    """A client that sets no limits of its own is ended by the box."""
    import franky

    own = Scheduling.current()
    robot = franky.Robot(cell.address, realtime_config=franky.RealtimeConfig.Ignore)
    own.take()
    motion = franky.JointVelocityWaypointMotion([franky.JointVelocityWaypoint(0.5 * np.eye(7)[0])])
    with pytest.raises(franky.ControlException, match="discontinuity"):
        robot.move(motion)
    assert cell.box.arm.violations and isinstance(cell.box.arm.violations[0], Error)


def test_memo_robot_moves_checks_and_recovers_it(cell, capsys):
    from memo_core.cli import robot as command

    config = {"backend": "fr3", "driver": "franka", "address": cell.address, "clock_timeout_s": BUSY_S}
    given = [f"robot.{key}={value}" for key, value in config.items()]
    command.jog(1, 5.0, None, given, True)
    assert abs(cell.box.arm.q_d[0] - np.radians(5.0)) < 1e-3
    command.home(None, given, True)
    assert np.abs(cell.box.arm.q_d - ROBOT.home).max() < 1e-3 and not cell.box.arm.violations
    cell.box.push([0.0, 0.0, 40.0])
    assert until(lambda: cell.box.mode.name == "REFLEX")
    with pytest.raises(RobotFault, match="cartesian reflex"):
        command.home(None, given, True)
    cell.box.push([0.0, 0.0, 0.0])
    assert cell.box.recoveries == 0
    command.recover(None, given, True)
    assert cell.box.recoveries == 1 and "can be commanded" in capsys.readouterr().out
