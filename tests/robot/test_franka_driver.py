"""The Franka driver through TCP and UDP: unmodified franky against a double of the control box and of the Hand."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from memo_franka.description import fr3
from memo_franka.driver import FrankaDriver, FrankaLink
from memo_franka.hand import FrankaHand
from memo_franka.scheduling import Scheduling
from memo_franka.settings import FrankaSettings, HandSettings
from memo_franka.testing.control_box import ControlBox
from memo_franka.testing.hand import HandDouble
from memo_franka.testing.wire import Error
from memo_wsg.driver import WsgGripper
from memo_wsg.protocol import Status
from memo_wsg.settings import WsgSettings
from memo_wsg.testing.double import WsgDouble

from memo_core.arm.simulated_link import IncludedGripper
from memo_core.errors import InvalidArgument, RobotFault, Stopped
from memo_core.testing import gripper_driver, robot_driver
from memo_core.testing.link import RULES

pytest.importorskip("franky", reason="pip install 'plugins/franka[hardware]'")
pytestmark = [
    pytest.mark.filterwarnings("ignore:this computer's kernel is not real-time"),
    pytest.mark.usefixtures("real_time"),
]

ROBOT = fr3()
ADDRESSES = (f"127.{1 + os.getpid() % 200}.{n // 200}.{1 + n % 200}" for n in itertools.count())
MODES = {"velocity": 0.001, "impedance": 0.005}  # rad, worst tracking error on a smooth motion
BUSY_S = 2.0  # a busy computer may slow the double's clock down; it must not count as frozen
BUSY = {"clock_timeout_s": BUSY_S, "hand_deadline_s": 60.0}


class Cell:
    """A double and a link to it."""

    def __init__(self, version: int = 10) -> None:
        self.address = next(ADDRESSES)
        self.hand = HandDouble(self.address)
        self.box = ControlBox(ROBOT, self.address, version=version, hand=self.hand)
        self.links: list[FrankaLink] = []

    def link(self, **settings) -> FrankaLink:
        """A new open link; the one before is closed."""
        self.close_links()
        driver = FrankaDriver(FrankaSettings(self.address, **{**BUSY, **settings}))
        link = driver.link(ROBOT, IncludedGripper())
        assert isinstance(link, FrankaLink)
        self.links.append(link)
        link.open()
        self.box.reader = lambda: link._now
        return link

    def close_links(self) -> None:
        self.box.reader = None
        while self.links:
            self.links.pop().close()


@pytest.fixture
def cell():
    cell = Cell()
    with cell.hand, cell.box:
        yield cell
        cell.close_links()


def swing(link: FrankaLink, seconds: float = 2.0, size: float = 0.3):
    """Targets of a smooth motion there and back, which begins and ends at rest."""
    home = link.joint_targets()
    times = np.arange(1, round(seconds / link.control_period) + 1) * link.control_period
    for t in times:
        yield home + size / 2 * (1 - np.cos(2 * np.pi * t / seconds))


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
    home = link.joint_targets()
    for number, row in enumerate(swing(link), start=1):
        link.send(row)
        state = link._state  # one moment for both the clock and the joints
        t = number * link.control_period + state.time.to_sec() - link._due
        there = home + 0.15 * (1 - np.cos(2 * np.pi * min(t, 2.0) / 2.0))
        worst = max(worst, float(np.abs(np.array(state.q) - there).max()))
    assert worst < allowed and not cell.box.arm.violations


# -- stopping ----------------------------------------------------------------------------------------------------------
def test_where_nothing_more_is_sent_the_arm_brakes_by_itself(cell):
    link = cell.link()
    for row in itertools.islice(swing(link), 60):
        link.send(row)
    ticks, moving = cell.box.ticks, np.abs(cell.box.arm.dq_d).max()
    time.sleep(0.1)
    while not cell.box.arm.resting:
        time.sleep(0.01)
    needed = moving / 10.0 + np.sqrt(10.0 / 5000.0)  # s: acceleration, and jerk up to it and back
    assert moving > 0.2 and cell.box.rested_at - ticks <= 1000 * needed + 75
    assert not cell.box.arm.violations and cell.box.mode.name == "IDLE"
    link.send(link.joint_targets())


def test_a_stop_decelerates_within_the_limits_and_keeps_the_grip(cell):
    cell.hand.fingers.thing = 0.04
    link = cell.link()
    link.set_gripper(0.0, 30.0)
    hold = link.joint_targets()
    for _ in range(150):
        link.send(hold)
    assert link.holding()
    rows = list(swing(link))
    for row in rows[:60]:
        link.send(row)
    link.stop()
    with pytest.raises(Stopped):
        link.send(rows[60])
    speeds = (rows[59] - rows[58])[None, :] * np.linspace(1.0, 0.0, 40)[:, None]
    link.halt(rows[59] + np.cumsum(speeds, axis=0))
    assert cell.box.arm.resting and not cell.box.arm.violations
    assert link.stopped and link.holding() and abs(link.gripper_width() - 0.04) < 0.001


# -- faults ------------------------------------------------------------------------------------------------------------
def _faulted(cell: Cell, link: FrankaLink, after: int, cause) -> RobotFault:
    """The fault that ends a motion after ``cause()`` happened in it."""
    with pytest.raises(RobotFault) as caught:
        for number, row in enumerate(swing(link)):
            if number == after:
                cause()
            link.send(row)
    assert not link.health().ready and str(caught.value) in link.health().problem
    with pytest.raises(RobotFault):
        link.send(link._targets)
    assert cell.box.recoveries == 0, "nothing recovers by itself"
    return caught.value


def _jammed(cell: Cell, link: FrankaLink) -> None:
    """Start to close fingers that do not move."""
    cell.hand.fingers.command = lambda width, speed, force: None
    link.set_gripper(0.0, 30.0)


def _with_wsg(cell: Cell, wsg: WsgDouble) -> FrankaLink:
    settings = FrankaSettings(cell.address, clock_timeout_s=BUSY_S)
    link = FrankaDriver(settings).link(ROBOT, WsgGripper(WsgSettings(wsg.address)))
    assert isinstance(link, FrankaLink)
    cell.links.append(link)
    link.open()
    cell.box.reader = lambda: link._now
    return link


def _wsg_fails(link: FrankaLink, wsg: WsgDouble) -> None:
    wsg.fail(Status.NOT_INITIALIZED)
    link.set_gripper(0.02, 30.0)


GRIPPER_FAULTS = {
    "WSG fault": (_wsg_fails, "home it on its web page"),
    "WSG cable pulled": (lambda link, wsg: wsg.stop(), "check its power and cable"),
}


@pytest.mark.parametrize("name", GRIPPER_FAULTS)
def test_a_fault_of_another_gripper_ends_the_motion_with_its_remedy(cell, name):
    cause, told = GRIPPER_FAULTS[name]
    with WsgDouble(next(ADDRESSES), width=80.0) as wsg:
        link, seen = _with_wsg(cell, wsg), {}

        def happen() -> None:
            cause(link, wsg)
            seen.update(ticks=cell.box.ticks)

        with pytest.raises(RobotFault, match=told) as caught:
            for number, row in enumerate(swing(link, 10.0)):
                if number == 60:
                    happen()
                link.send(row)
        assert caught.value.fault == "gripper" and wsg.acknowledged == 0 and cell.box.recoveries == 0
        _at_rest_alone(cell)


def test_a_blocked_hand_ends_the_motion_with_its_remedy(cell):
    link = cell.link(hand_deadline_s=0.5)
    with pytest.raises(RobotFault, match="free its fingers") as caught:
        for number, row in enumerate(swing(link, 60.0)):
            if number == 60:
                _jammed(cell, link)
            link.send(row)
    assert caught.value.fault == "gripper" and cell.box.recoveries == 0
    _at_rest_alone(cell)
    cell.close_links()
    assert not [thread.name for thread in threading.enumerate() if thread.name == "_work"], "it waits for ever"


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
    assert (99 in moving) == (own.policy == os.SCHED_FIFO), "franky gives the highest where it is allowed to"


def _at_rest_alone(cell: Cell) -> None:
    """Where the box itself has no fault: at rest after the last velocity's 60 ms and what the limits need."""
    since, speed = cell.box.ticks, float(np.abs(cell.box.arm.dq_d).max())
    cell.box.reader = None
    while not cell.box.arm.resting:
        time.sleep(0.01)
    assert cell.box.rested_at - since <= 1000 * (speed / 10.0 + np.sqrt(10.0 / 5000.0)) + 60
    assert not cell.box.arm.violations


def _at_rest_soon(cell: Cell, since: int, speed: float) -> None:
    """At rest within what the limits need and 60 ms, on the box's clock."""
    while not cell.box.arm.resting:
        time.sleep(0.01)
    assert cell.box.rested_at - since <= 1000 * (speed / 10.0 + np.sqrt(10.0 / 5000.0)) + 60


IN_MOTION = {
    "pushed with 40 N": (lambda box: box.push([0.0, 0.0, 40.0]), "reflex", "cartesian reflex"),
    "user stop": (lambda box: box.user_stop(True), "user-stop", "release the external activation device"),
    "brakes shut": (lambda box: box.brakes(True), "brakes", "Unlock joints"),
    "guided": (lambda box: box.guide(True), "guiding", "let go"),
    "20 packets lost": (lambda box: box.lose(40), "reflex", "communication constraints violation"),
}


@pytest.mark.parametrize("name", IN_MOTION)
def test_a_fault_in_motion_ends_it_with_its_remedy(cell, name):
    cause, fault, told = IN_MOTION[name]
    link, seen = cell.link(), {}

    def happen() -> None:
        seen["ticks"], seen["speed"] = cell.box.ticks, float(np.abs(cell.box.arm.dq_d).max())
        cause(cell.box)

    error = _faulted(cell, link, 60, happen)
    assert (error.fault, error.robot) == (fault, cell.address) and told in str(error), str(error)
    _at_rest_soon(cell, seen["ticks"], seen["speed"])


BEFORE = {
    "user stop": (lambda box: box.user_stop(True), "user-stop"),
    "brakes shut": (lambda box: box.brakes(True), "brakes"),
    "guided": (lambda box: box.guide(True), "guiding"),
}


@pytest.mark.parametrize("name", BEFORE)
def test_a_robot_that_cannot_move_is_not_opened(cell, name):
    cause, fault = BEFORE[name]
    cause(cell.box)
    with pytest.raises(RobotFault) as caught:
        cell.link()
    assert caught.value.fault == fault and cell.box.recoveries == 0


def test_another_version_is_named_with_where_to_get_the_library():
    cell = Cell(version=5)
    with cell.hand, cell.box, pytest.raises(RobotFault, match=r"a Panda speaks version 5.*index") as caught:
        cell.link()
    assert caught.value.fault == "version"


def test_fci_that_is_off_is_said_with_what_to_do():
    with pytest.raises(RobotFault, match="activate FCI in Desk") as caught:
        Cell().link()
    assert caught.value.fault == "fci-off"


def test_a_box_that_is_gone_is_a_fault_within_a_second(cell):
    link, at = cell.link(), []

    def gone() -> None:
        cell.box.stop()
        at.append(time.monotonic())

    error = _faulted(cell, link, 60, gone)
    assert time.monotonic() - at[0] < BUSY_S + 1.2 and error.fault in ("network", "clock", "ended")


def test_a_clock_that_stands_still_is_a_fault(cell):
    link, at = cell.link(clock_timeout_s=0.3), []

    def frozen() -> None:
        cell.box.freeze(True)
        at.append(time.monotonic())

    error = _faulted(cell, link, 60, frozen)
    assert error.fault in ("clock", "network") and time.monotonic() - at[0] < 1.5
    cell.box.freeze(False)


def test_a_jump_of_the_target_is_refused_and_breaks_no_limit(cell):
    link = cell.link()
    rows = list(itertools.islice(swing(link), 60))
    for row in rows:
        link.send(row)
    with pytest.raises(InvalidArgument, match=r"joint\d would have to move at .* rad/s; expected steps of at most"):
        link.send(rows[-1] + 0.2)
    for _ in range(100):
        link.send(rows[-1])
    assert not cell.box.arm.violations and np.abs(link.joint_positions() - rows[-1]).max() < 0.001


def test_after_a_reflex_a_person_recovers_and_motion_goes_on_from_where_the_arm_is(cell):
    link = cell.link()
    _faulted(cell, link, 60, lambda: cell.box.push([0.0, 0.0, 40.0]))
    link.stop()
    with pytest.raises(RobotFault):
        link.release()
    assert link.stopped
    cell.box.push([0.0, 0.0, 0.0])
    link.recover()
    link.release()
    assert cell.box.recoveries == 1 and np.abs(link.joint_targets() - cell.box.arm.q_d).max() < 1e-6
    for row in swing(link, 1.0, 0.05):
        link.send(row)
    assert not cell.box.arm.violations


CLIENT = """
import itertools, os, sys, warnings
warnings.simplefilter("ignore")
import numpy as np
from memo_core.testing.fake_drivers import FakeGripper
from memo_franka.description import fr3
from memo_franka.driver import FrankaDriver, FrankaSettings
link = FrankaDriver(FrankaSettings(sys.argv[1], clock_timeout_s=2.0)).link(fr3(), FakeGripper())
link.open()
home = link.joint_targets()
for n in itertools.count(1):
    link.send(home + 0.15 * (1 - np.cos(np.pi * n / 100)))
    if n == 60:
        print("moving", flush=True)
        {then}
"""


@pytest.mark.parametrize(
    ("then", "kill"), [("", True), ("import time; time.sleep(0.5)", False)], ids=["killed with -9", "stalled 0.5 s"]
)
def test_a_client_that_dies_or_stalls_in_motion_leaves_the_arm_at_rest(cell, then, kill):
    command = [sys.executable, "-c", CLIENT.replace("{then}", then), cell.address]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as client:
        assert client.stdout.readline() == "moving\n"
        ticks, speed = cell.box.ticks, float(np.abs(cell.box.arm.dq_d).max())
        if kill:
            client.kill()
        while not cell.box.arm.resting:
            time.sleep(0.005)
        client.kill()
    assert speed > 0.2 and cell.box.rested_at - ticks <= 1000 * (speed / 10.0 + 0.045) + 90
    assert not cell.box.arm.violations or kill


# -- the Hand ----------------------------------------------------------------------------------------------------------
def test_a_hand_that_is_stuck_is_told_after_its_deadline():
    with HandDouble(next(ADDRESSES)) as hand:
        driver = FrankaHand(HandSettings(hand.address, deadline_s=0.3))
        driver.open(ROBOT.gripper)
        driver.move(0.0, 30.0)
        while driver.width() > 0.001:
            time.sleep(0.01)
        hand.fingers.thing = 0.03
        hand.fingers.command = lambda width, speed, force: None  # jammed
        driver.move(0.08, 30.0)
        end = time.monotonic() + 10
        while driver.health().ready and time.monotonic() < end:
            time.sleep(0.02)
        assert "did not end its motion" in driver.health().problem
        started = time.monotonic()
        driver.close()
        assert time.monotonic() - started < 4


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
    while cell.box.mode.name != "REFLEX":
        time.sleep(0.01)
    with pytest.raises(RobotFault, match="cartesian reflex"):
        command.home(None, given, True)
    cell.box.push([0.0, 0.0, 0.0])
    assert cell.box.recoveries == 0
    command.recover(None, given, True)
    assert cell.box.recoveries == 1 and "can be commanded" in capsys.readouterr().out
