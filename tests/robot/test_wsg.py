"""The WSG driver against a double of the gripper's binary protocol."""

from __future__ import annotations

import itertools
import os
import socket
import time

import pytest

pytest.importorskip("memo_wsg", reason="make setup installs it")

from memo_wsg.driver import WsgGripper
from memo_wsg.protocol import Broken, Command, Status, checksum, packed, unpacked
from memo_wsg.settings import WsgSettings
from memo_wsg.testing.double import WsgDouble

from memo_core.errors import BackendUnavailable
from memo_core.robot.description import GripperDescription
from memo_core.testing import gripper_driver

pytestmark = pytest.mark.wire

ADDRESSES = (f"127.{1 + os.getpid() % 200}.240.{1 + n % 200}" for n in itertools.count())
GRIPPER = GripperDescription(stroke=0.08, max_force=80.0)


@pytest.fixture
def double():
    with WsgDouble(next(ADDRESSES), width=80.0) as double:
        yield double


def opened(double: WsgDouble, **settings) -> WsgGripper:
    driver = WsgGripper(WsgSettings(double.address, **settings))
    driver.open(GRIPPER)
    return driver


def until(condition, seconds: float = 10.0) -> bool:
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.01)
    return bool(condition())


@pytest.mark.parametrize("rule", gripper_driver.RULES)
def test_the_driver_conforms(double, rule):
    gripper_driver.RULES[rule](lambda: WsgGripper(WsgSettings(double.address)))


def test_messages_are_those_of_the_protocol():
    # CRC-16 of the kind that is called MCRF4XX: its published check value is 0x6F91.
    assert checksum(b"123456789") == 0x6F91
    message = packed(Command.WIDTH, b"\0\0\0")
    assert message[:6] == bytes.fromhex("aaaaaa430300")
    assert unpacked(message + b"\xaa") == (Command.WIDTH, b"\0\0\0", b"\xaa")
    assert unpacked(message[:-1]) is None and unpacked(b"") is None
    with pytest.raises(Broken, match="checksum"):
        unpacked(message[:-1] + b"\0")
    with pytest.raises(Broken, match="AA AA AA"):
        unpacked(b"hello gripper")


def test_what_is_between_the_fingers_is_held_with_the_force_that_was_asked_for(double):
    double.thing = 30.0
    driver = opened(double)
    driver.move(0.0, 25.0)
    assert until(driver.holding) and abs(driver.width() - 0.03) < 0.001
    assert double.force_limit == 25.0
    driver.stop()
    time.sleep(0.1)
    assert driver.holding(), "a stop keeps the grip"
    driver.move(0.08, 25.0)
    assert until(lambda: driver.width() > 0.079) and not driver.holding()
    driver.close()


def test_a_fault_of_the_gripper_is_told_with_its_remedy_and_never_acknowledged(double):
    driver = opened(double)
    double.fail(Status.NOT_INITIALIZED)
    driver.move(0.02, 20.0)
    assert until(lambda: not driver.health().ready)
    assert "not initialized" in driver.health().problem and "home it" in driver.health().problem
    with pytest.raises(BackendUnavailable, match="home it"):
        driver.move(0.02, 20.0)
    assert double.acknowledged == 0
    driver.close()


def test_status_codes_are_the_manufacturers():
    """E_ codes of the command set, as other clients of this gripper list them too."""
    published = {10: "INSUFFICIENT_RESOURCES", 11: "CHECKSUM_ERROR", 14: "CMD_UNKNOWN", 16: "ACCESS_DENIED"}
    published |= {18: "CMD_FAILED", 19: "CMD_ABORTED", 24: "INVALID_PARAMETER", 26: "CMD_PENDING", 28: "RANGE_ERROR"}
    assert {code: Status(code).name for code in published} == published
    assert Status.AXIS_BLOCKED == 29 and len(Status) == 31


@pytest.mark.parametrize("status", [Status.CMD_FAILED, Status.AXIS_BLOCKED])
def test_a_grasp_that_finds_nothing_is_no_fault_but_blocked_opening_is(double, status):
    driver = opened(double)
    double.fail(status)
    driver.move(0.02, 20.0)
    assert until(lambda: driver._running is None and driver._wanted is None)
    assert driver.health().ready
    driver.move(0.08, 20.0)
    assert until(lambda: not driver.health().ready) and status.name.lower().replace("_", " ") in driver.health().problem
    driver.close()


def _late_ends(double: WsgDouble) -> None:
    """The end of a motion that a stop has ended is told after the stop's own answer."""
    end, respond = double._end, double._respond

    def ended(state, status=Status.SUCCESS):
        motion, double._motion, double._state = double._motion, None, state
        if motion is not None and status == Status.CMD_ABORTED:
            late.append(motion)
        elif motion is not None:
            respond(motion, status)

    def responded(command, status, payload=b""):
        respond(command, status, payload)
        while command == Command.STOP and late:
            respond(late.pop(), Status.CMD_ABORTED)

    late: list[Command] = []
    assert end.__self__ is double
    double._end, double._respond = ended, responded


def _refuses_once(double: WsgDouble) -> None:
    """It still moves when the next motion arrives."""
    begin = double._begin

    def begun(command, payload):
        double._begin = begin
        double._respond(command, Status.ALREADY_RUNNING)

    double._begin = begun


@pytest.mark.parametrize("quirk", [lambda double: None, _late_ends, _refuses_once], ids=["plain", "late", "refuses"])
def test_a_motion_that_replaces_another_arrives(double, quirk):
    driver = opened(double)
    quirk(double)
    driver.move(0.0, 20.0)
    driver.move(0.05, 20.0)
    driver.move(0.03, 20.0)
    assert until(lambda: abs(driver.width() - 0.03) < 0.001 and driver._running is None), driver.health()
    assert driver.health().ready
    driver.close()


def test_a_slow_gripper_is_not_flooded_with_questions(double):
    answer, received = double._answer, []

    def slow(command, payload):
        if command == Command.WIDTH:
            time.sleep(0.03)
        answer(command, payload)

    double._answer = slow
    driver = opened(double)
    serve = double._answer_received
    double._answer_received = lambda: (received.append(len(double._received)), serve())
    time.sleep(0.3)
    driver.close()
    assert max(received) <= 2 * len(packed(Command.WIDTH, b"\0\0\0")) + len(packed(Command.DISCONNECT))


@pytest.mark.parametrize(
    "sent",
    [
        packed(Command.WIDTH, b"\0\0\1"),
        packed(Command.WIDTH, b"\0"),
        packed(Command.GRASPING_STATE, b"\0\0"),
        b"HTTP/1.1 400",
    ],
    ids=["short width", "no status", "no state", "no WSG"],
)
def test_what_is_no_answer_is_a_fault_that_says_so(double, sent):
    driver = opened(double)
    double._send(sent)
    assert until(lambda: not driver.health().ready) and "no message of its protocol" in driver.health().problem
    driver.close()


def test_what_was_not_asked_for_is_passed_over_and_an_error_in_it_told(double):
    driver = opened(double)
    double._send(packed(0x40, b"\0\0\2\0\0\0"))  # its system state
    double._send(packed(Command.GRASPING_STATE, b"\0\0\x63"))
    driver.move(0.02, 20.0)
    assert until(lambda: abs(driver.width() - 0.02) < 0.001) and driver.health().ready
    double._send(packed(0x40, b"\x63\0"))
    assert until(lambda: not driver.health().ready) and "error 99 to 0x40" in driver.health().problem
    driver.close()


def test_closing_is_announced_and_a_lost_client_is_a_fast_stop_that_is_told(double):
    opened(double).close()
    driver = opened(double)
    driver.move(0.02, 20.0)
    assert until(lambda: abs(driver.width() - 0.02) < 0.001) and driver.health().ready
    driver._socket.shutdown(2)
    assert until(lambda: not driver.health().ready)
    driver.close()
    driver = opened(double)
    driver.move(0.05, 20.0)
    assert until(lambda: "acknowledge its fast stop" in driver.health().problem) and double.acknowledged == 0
    driver.close()


def test_closing_waits_until_the_gripper_has_heard_of_it(double):
    answer = double._answer
    double._answer = lambda command, payload: (time.sleep(0.03), answer(command, payload))
    driver = opened(double)
    driver.close()
    assert double._announced


def test_the_last_words_of_a_client_count_where_the_next_one_comes_at_once():
    double = WsgDouble(next(ADDRESSES))
    double.listen()
    first = socket.create_connection((double.address, double.port))
    double.round()
    first.sendall(packed(Command.DISCONNECT))
    first.close()
    with socket.create_connection((double.address, double.port)):
        double._accept()  # before anything of the first one was read
        assert double._fault is None
    double.stop()


def test_a_cable_that_is_pulled_closes_no_connection(double):
    driver = opened(double, timeout_s=0.3)
    double._send = lambda message: None
    assert until(lambda: "check its power and cable" in driver.health().problem)
    driver.close()


def test_a_pulled_cable_is_told_within_a_second(double):
    driver = opened(double)
    double.stop()
    began = time.monotonic()
    assert until(lambda: not driver.health().ready) and time.monotonic() - began < 2.0
    assert "cable" in driver.health().problem
    driver.close()


def test_a_motion_that_does_not_end_is_told_after_its_deadline(double):
    driver = opened(double, deadline_s=0.3)
    double._advance = lambda seconds: None
    driver.move(0.02, 20.0)
    assert until(lambda: "did not end its motion" in driver.health().problem)
    driver.close()


def test_a_gripper_that_is_not_there_is_said_with_what_to_check():
    with pytest.raises(BackendUnavailable, match="check the cable"):
        WsgGripper(WsgSettings(next(ADDRESSES))).open(GRIPPER)
