"""The guard between planner and driver: where the first command starts from, and how fast commands may follow."""

from __future__ import annotations

import attrs
import numpy as np
import pytest

from memo_core.arm import guarded_link
from memo_core.arm.guarded_link import GuardedLink
from memo_core.errors import BackendUnavailable, MotionError, RobotFault, Stopped
from memo_core.robot.safety import SafetyLimits
from memo_core.testing.ideal_link import IdealLink
from tests.support.arms import six_joint_arm, six_with_a_sliding_first_joint

ROBOT, LIMITS = six_joint_arm(), SafetyLimits(tool_speed=0.25)
OFF = np.array([0.3, 0.0, 0.0, 0.0, 0.0, 0.0])


class Clock:
    """The clock on the wall."""

    def __init__(self) -> None:
        self.now, self.slept = 0.0, []

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        self.slept.append(seconds)


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(guarded_link, "time", clock)
    return clock


class RealArm(IdealLink):
    """Hardware: each send takes ``pace`` (s) of the clock on the wall. ``stands`` is where the arm is, if not where
    the driver believes it to be."""

    real_time = True

    def __init__(self, clock: Clock, pace: float = 0.01, stands=None, robot=ROBOT) -> None:
        super().__init__(robot)
        self._clock, self._pace = clock, pace
        self.stands = stands
        self.moments: list[float] = []

    def joint_positions(self):
        return super().joint_positions() if self.stands is None else self.stands.copy()

    def _advance(self, targets):
        super()._advance(targets)
        self.moments.append(self._clock.now)
        self._clock.now += self._pace


def guarded(inner: IdealLink) -> GuardedLink:
    link = GuardedLink(inner, ROBOT, LIMITS)
    link.open()
    return link


def ramp(link, step: float = 0.001, count: int = 200):
    start = link.joint_targets()
    for number in range(1, count + 1):
        yield start + number * step * np.eye(len(start))[0]


# -- where the first command starts from -------------------------------------------------------------------------------
def test_an_arm_that_is_not_where_its_driver_believes_gets_no_command(clock):
    inner = RealArm(clock, stands=np.array(ROBOT.home) + OFF)
    link = guarded(inner)
    for _ in range(2):
        with pytest.raises(RobotFault, match=r"joint1 is at 0\.300 and its target at 0\.000 rad.*open\(\)"):
            link.send(link.joint_targets())
    with pytest.raises(RobotFault, match="joint1"):
        link.check("moving", link.joint_targets()[None])
    with pytest.raises(BackendUnavailable, match=r"joint1 is at 0\.300"):
        link.check_ready("10.0.0.2")
    link.halt(np.array([link.joint_targets()]))
    assert not inner.sent


def test_an_arm_whose_driver_starts_where_it_is_moves(clock):
    inner = RealArm(clock, stands=np.array(ROBOT.home) + 0.01)
    link = guarded(inner)
    link.check_ready("10.0.0.2")
    link.send(link.joint_targets())
    inner.stands = np.array(ROBOT.home) + 0.6 * OFF  # once it has moved, contact and lag are the planner's
    for _ in range(10):
        link.send(link.joint_targets())
    assert len(inner.sent) == 11


def test_an_arm_that_does_not_follow_is_stopped_and_goes_on_from_where_it_is(clock):
    inner = RealArm(clock)
    link = guarded(inner)
    inner.stands = np.array(ROBOT.home)  # its brakes hold it, or a driver keeps the commands to itself
    with pytest.raises(RobotFault, match=r"does not follow its commands: joint1 is at 0\.000 and its target at 0\.2"):
        for row in ramp(link, step=0.002, count=500):
            link.send(row)
    assert 0.2 < np.abs(link.joint_targets() - inner.stands).max() < 0.25
    with pytest.raises(Stopped):
        link.send(link.joint_targets())
    with pytest.raises(RobotFault, match="leap"):
        link.release()
        link.send(link.joint_targets())


def test_a_single_reading_that_is_off_and_a_servo_that_lags_end_no_motion(clock):
    inner = RealArm(clock)
    inner.servo_lag = (0.5,) * len(ROBOT.joints)
    link = guarded(inner)
    start = link.joint_targets()
    for number, row in enumerate(ramp(link, step=0.005, count=200)):
        inner.stands = np.maximum(row - 0.25, start) if (number + 1) % 5 else start - 1.0
        link.send(row)
    assert len(inner.sent) == 200


def test_a_joint_that_would_turn_too_fast_is_refused_also_where_the_tool_stays_where_it_is(clock):
    link = GuardedLink(RealArm(clock), ROBOT, LIMITS)
    link.open()
    allowed = link.description.joints[5].velocity * link.control_period
    wrist = np.eye(6)[5]
    start = link.joint_targets()
    path = np.array([start + 0.9 * allowed * wrist, start + 1.8 * allowed * wrist])
    link.check("test", path)
    for row in path:
        link.send(row)
    leap = path[-1] + 1.5 * allowed * wrist
    with pytest.raises(MotionError, match=rf"{ROBOT.joints[5].name} at .* rad/s, where"):
        link.check("test", leap[None])
    with pytest.raises(MotionError, match="rad/s"):
        link.send(leap)


def test_after_a_stop_an_arm_that_was_carried_elsewhere_gets_no_command_and_one_in_contact_does(clock):
    inner = RealArm(clock)
    link = guarded(inner)
    link.send(link.joint_targets())
    for push, refused in ((0.1, False), (0.3, True)):
        link.stop()
        inner.stands = np.array(ROBOT.home) + push * np.eye(6)[0]
        link.release()
        if refused:
            with pytest.raises(RobotFault, match="joint1"):
                link.send(link.joint_targets())
        else:
            link.send(link.joint_targets())


def test_after_a_recovery_the_arm_starts_from_where_it_is(clock):
    class Recovering(RealArm):
        def recover(self):
            self._targets = self.joint_positions()

    forgetful = RealArm(clock)
    forgetful.recover = lambda: None
    link = guarded(forgetful)
    link.send(link.joint_targets())
    link.stop()
    forgetful.stands = np.array(ROBOT.home) + 0.1
    link.recover()
    link.release()
    with pytest.raises(RobotFault, match="leap"):
        link.send(link.joint_targets())
    inner = Recovering(clock)
    link = guarded(inner)
    link.send(link.joint_targets())
    inner.stands = np.array(ROBOT.home) + OFF
    link.recover()
    link.send(link.joint_targets())
    assert np.allclose(inner.sent[-1], inner.stands)


def test_limits_are_judged_where_the_arm_is_measured_and_its_stop_is_told(clock):
    inner = RealArm(clock)
    inner._targets = inner._joints = np.array([3.0, -0.6, 1.6, 0.5, 1.57, 0.0])
    with pytest.raises(BackendUnavailable, match=r"outside its limits: joint1 at 3\.000 rad.*by hand"):
        guarded(inner).check_ready("10.0.0.2")
    link = guarded(RealArm(clock))
    link.stop()
    with pytest.raises(BackendUnavailable, match="stop is latched"):
        link.check_ready("10.0.0.2")


def test_what_is_said_of_a_sliding_joint_is_in_metres(clock):
    rail = six_with_a_sliding_first_joint()
    inner = RealArm(clock, robot=rail)
    link = GuardedLink(inner, rail, SafetyLimits(tool_speed=1.0))
    link.open()
    start, slide, wrist = link.joint_targets(), np.eye(6)[0], np.eye(6)[5]
    with pytest.raises(MotionError, match=r"joint1 at 0\.600 m, where -0\.450 to 0\.450 m is allowed"):
        link.check("moving", (start + 0.6 * slide)[None])
    with pytest.raises(MotionError, match=r"joint6 at 4\.000 rad, where -.* to .* rad is allowed"):
        link.check("moving", (start + 4.0 * wrist)[None])
    slow = attrs.evolve(rail, joints=(attrs.evolve(rail.joints[0], velocity=0.1), *rail.joints[1:]))
    with pytest.raises(MotionError, match=r"joint1 at 0\.50 m/s, where 0\.1 m/s is allowed"):
        GuardedLink(inner, slow, SafetyLimits(tool_speed=1.0)).check("moving", (start + 0.005 * slide)[None])
    inner.stands = start + 0.3 * slide
    with pytest.raises(RobotFault, match=r"joint1 is at 0\.300 and its target at 0\.000 m"):
        link.send(start)


# -- the clock on the wall ---------------------------------------------------------------------------------------------
@pytest.mark.parametrize("pace", [0.0, 0.0013, 0.005])
def test_a_driver_that_does_not_wait_is_stopped_and_brakes_at_the_arms_pace(clock, pace):
    inner = RealArm(clock, pace)
    link = guarded(inner)
    with pytest.raises(RobotFault, match=r"commands in .* ms.*deadline"):
        for row in ramp(link):
            link.send(row)
    assert link.stopped and len(inner.sent) < 40
    sent = np.array(inner.sent)
    assert np.abs(sent[-1] - sent[-2]).max() < 1e-4, "it came to rest"
    too_early = sum(gap < 0.009 for gap in np.diff(inner.moments))
    assert too_early <= (6 if pace < 0.002 else 12)
    with pytest.raises(Stopped):
        link.send(link.joint_targets())


def test_a_driver_that_keeps_time_goes_on_for_ever_with_some_jitter(clock):
    inner = RealArm(clock, 0.0)
    link = guarded(inner)
    rng, due = np.random.default_rng(1), 0.0
    for _ in range(20_000):
        link.send(link.joint_targets())
        due += 0.0098  # a clock that goes 2 % fast
        clock.now = max(clock.now, due + rng.uniform(-0.008, 0.008))
    assert len(inner.sent) == 20_000


def test_after_a_pause_a_driver_may_not_make_up_for_it(clock):
    inner = RealArm(clock)
    link = guarded(inner)
    link.send(link.joint_targets())
    clock.now += 10.0
    inner._pace = 0.0
    with pytest.raises(RobotFault, match="deadline"):
        for row in ramp(link):
            link.send(row)


def test_a_simulator_runs_as_fast_as_it_can(clock):
    inner = RealArm(clock, 0.0)
    inner.real_time = False
    link = guarded(inner)
    for row in ramp(link):
        link.send(row)
    assert len(inner.sent) == 200 and clock.now == 0.0
