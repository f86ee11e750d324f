"""The WSG driver against a double of the gripper's binary protocol."""

from __future__ import annotations

import itertools
import os
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
