"""``memo robot``: what is checked, moved and recovered, through a driver that stands in for a real arm."""

from __future__ import annotations

import re
from contextlib import nullcontext

import numpy as np
import pytest
from memo_franka.description import fr3

from memo_core.arm.slow_motion import move_joints
from memo_core.cli import robot as command
from memo_core.environment.commissioning import Commissioning, tool_of
from memo_core.environment.hardware import HardwareSettings
from memo_core.environment.hardware_check import _commissioned, _started, examine_host, examine_robot
from memo_core.environment.lease import Lease
from memo_core.errors import BackendUnavailable, InvalidArgument, MotionError, RobotFault, Stopped
from memo_core.interfaces.driver import RobotDriver
from memo_core.robot.safety import SafetyLimits
from memo_core.testing.fake_drivers import FakeDriverLink, FakeGripper
from memo_core.testing.ideal_link import IdealLink
from tests.support.arms import six_with_a_sliding_first_joint

ROBOT, LIMITS = fr3(), SafetyLimits()
FAULT = RobotFault("10.9.9.9", "reflex", "it ended the motion by a reflex", "memo robot recover")


class Arm(FakeDriverLink):
    fault: RobotFault | None = None
    stands: np.ndarray | None = None  # where the arm is measured
    believed = ROBOT.home  # where its driver starts from
    pace = 1.0  # seconds of the robot's clock in one of the clock on the wall

    def open(self):
        if self.fault is not None:
            raise self.fault
        super().open()
        self._targets = np.array(self.believed)

    def joint_positions(self):
        return super().joint_positions() if self.stands is None else self.stands.copy()

    def time(self):
        return self.pace * super().time()


class Driver(RobotDriver):
    address = "10.9.9.9"

    def __init__(self, fault: RobotFault | None = None, **changes) -> None:
        self.fault, self.changes = fault, changes
        self.links: list[Arm] = []

    def link(self, robot, gripper, simulator=None):
        link = Arm(robot, gripper)
        link.fault = self.fault
        for name, value in self.changes.items():
            setattr(link, name, value)
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


@pytest.mark.parametrize(
    ("pace", "state", "told"), [(1.0, "ok", ""), (0.0, "failed", "stands still"), (3.0, "failed", "too fast")]
)
def test_a_clock_that_stands_or_runs_too_fast_keeps_a_robot_from_moving(pace, state, told):
    found = examined(Driver(pace=pace))["states"]
    assert found.state in (("ok", "warning") if state == "ok" else (state,)), "a busy computer may read slowly"
    assert told in found.detail and (state == "ok" or "Link.time" in found.remedy)


def test_targets_away_from_where_the_arm_is_measured_keep_it_from_moving():
    assert examined(Driver())["targets"].state == "ok"
    found = examined(Driver(stands=np.array(ROBOT.home) + 0.57))["targets"]
    assert found.state == "failed" and "its target at" in found.detail and "open()" in found.remedy


@pytest.mark.parametrize(
    ("stands", "told"),
    [(np.zeros(8), r"fr3 has 7 joints: one finite number for each, shape \(7,\)"), (np.full(7, np.nan), "nan")],
)
def test_positions_that_are_not_one_finite_number_a_joint_end_check_and_jog_in_one_sentence(monkeypatch, stands, told):
    found = examined(Driver(stands=stands))
    [*_, last] = found.values()
    assert (last.what, last.state) == ("positions", "failed") and re.search(told, last.detail)
    driver = Driver(stands=stands, believed=stands)
    commanded(monkeypatch, driver)
    with pytest.raises(BackendUnavailable, match=told):
        command.jog(1, 5.0, None, None, True)
    assert not driver.links[0].sent


def test_cameras_that_cannot_be_made_fail_in_their_own_row():
    def missing():
        raise BackendUnavailable("perception", "cameras", "missing Python module lens", "pip install lens")

    settings = HardwareSettings(LIMITS)
    found = {one.what: one for one in examine_robot(Driver(), FakeGripper(), ROBOT, settings, missing, 0.05)}
    assert found["targets"].state == "ok" and found["camera images"].state == "failed"
    assert "missing Python module lens (pip install lens)" in found["camera images"].detail


@pytest.mark.parametrize(
    ("reached", "lifted", "state", "told"),
    [(8, True, "ok", "as in"), (6, False, "warning", "but 6 of 8 corners reached, the gripper did not hold a cube")],
)
def test_what_the_commissioning_left_out_is_named(tmp_path, reached, lifted, state, told):
    file, link = tmp_path / "arm.json", IdealLink(ROBOT)
    tool, corners = tool_of(ROBOT), [[0.4, 0.0, 0.3]] * reached
    stroke = ROBOT.gripper.stroke
    Commissioning("fr3", "here", "1", "ada", "", tool, stroke, {}, 0.0, [0.0] * 3, corners, lifted).write(file)
    found = _commissioned(link, ROBOT, "here", str(file))
    assert found.state == state and told in found.detail


def commanded(monkeypatch, driver: Driver, **sections):
    """Have the commands find this driver; the robot's gripper is moved by it."""

    class Experiment:
        def create(self, kind):
            return {"robot": ROBOT, "robot_driver": driver, "gripper_driver": FakeGripper()}[kind]

        def section(self, name):
            return HardwareSettings(LIMITS)

    monkeypatch.setattr(command, "hardware", lambda config, overrides: Experiment())


def test_a_jog_tells_where_the_arm_came_to_rest(monkeypatch, capsys):
    driver = Driver(real_time=False)
    commanded(monkeypatch, driver)
    command.jog(1, 5.0, None, None, True)
    assert "at rest; joints 0.087" in capsys.readouterr().out


def test_where_a_slide_came_to_rest_is_told_in_metres(capsys):
    link = IdealLink(six_with_a_sliding_first_joint())
    command._move(link, lambda: link.joint_targets() + 0.1)
    assert "at rest; joints 0.100 m, " in capsys.readouterr().out


def test_a_slide_is_jogged_by_centimetres(monkeypatch, capsys):
    rail = six_with_a_sliding_first_joint()
    commanded(monkeypatch, Driver(real_time=False))
    monkeypatch.setattr(command.hardware(None, None).__class__, "create", lambda self, kind: rail)
    monkeypatch.setattr(command, "connected", lambda experiment: nullcontext(IdealLink(rail)))
    command.jog(1, -3.0, None, None, True)
    assert "at rest; joints -0.030 m, " in capsys.readouterr().out
    with pytest.raises(InvalidArgument, match="-20 to 20 cm"):
        command.jog(1, 90.0, None, None, True)


def test_targets_of_a_slide_are_near_in_metres():
    assert "0.02 rad of where" in _started(IdealLink(ROBOT)).detail
    assert "0.02 m or rad of where" in _started(IdealLink(six_with_a_sliding_first_joint())).detail


def test_a_jog_of_an_arm_that_does_not_arrive_fails(monkeypatch, capsys):
    blocked = np.array(ROBOT.home) + 0.01
    commanded(monkeypatch, Driver(real_time=False, blocked=blocked))
    with pytest.raises(MotionError, match=r"joint1 is at 0\.010 and its target at 0\.087 rad"):
        command.jog(1, 5.0, None, None, True)
    assert "at rest" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("off", "follows", "told"),
    [(0.57, False, "its target at"), (2.9, False, "leap"), (2.9, True, "outside its limits")],
)
def test_no_command_moves_an_arm_that_a_check_would_not_release(monkeypatch, off, follows, told):
    stands = np.array(ROBOT.home) + off * np.eye(7)[0]
    driver = Driver(stands=stands, believed=stands if follows else ROBOT.home)
    commanded(monkeypatch, driver)
    for move in (lambda: command.jog(1, 20.0, None, None, True), lambda: command.home(None, None, True)):
        with pytest.raises(BackendUnavailable, match=told):
            move()
    assert not any(link.sent or link.health().ready for link in driver.links), "never commanded, and closed"


def test_the_host_is_looked_at():
    assert {"kernel", "real-time priority"} <= {one.what for one in examine_host()}
    assert all(one.remedy for one in examine_host() if one.state != "ok")


def test_a_joint_moves_slowly_within_the_limits_and_stops_at_rest():
    link = Arm(ROBOT, FakeGripper())
    link.real_time = False
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
