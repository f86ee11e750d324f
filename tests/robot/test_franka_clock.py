"""When a double of Franka's devices goes on: its clock, on a wall clock of the test, and its thread."""

from __future__ import annotations

import os

import pytest
from memo_franka.testing import control_box
from memo_franka.testing.arm import DT
from memo_franka.testing.control_box import ControlBox
from memo_franka.testing.hand import HandDouble

from tests.support.franka_cell import ADDRESSES, ROBOT, until

pytestmark = pytest.mark.wire


class WallClock:
    """In place of the module ``time``. A look takes ``look_s``, as the code between two looks does."""

    def __init__(self, look_s: float = 1e-5) -> None:
        self.now, self.look_s = 100.0, look_s
        self.slept: list[float] = []

    def monotonic(self) -> float:
        self.now += self.look_s
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds


@pytest.fixture
def clock(monkeypatch):
    clock = WallClock()
    monkeypatch.setattr(control_box, "time", clock)
    return clock


@pytest.fixture
def box(clock):
    box = ControlBox(ROBOT, next(ADDRESSES), paced=False)
    box.listen()
    box._last = clock.now
    yield box
    box.stop()


def test_what_ran_faster_than_the_wall_clock_is_not_slept_off_later(box, clock):
    """A rehearsal's ticks took a tenth of a millisecond; the first wait then slept for minutes."""
    box.reader = lambda: box.ticks * DT
    for _ in range(5000):
        box.round()
    assert box.ticks == 5000 and not clock.slept, "it follows its reader as fast as the computer can"
    box.reader = lambda: 0.0
    for _ in range(10):
        box.round()
    assert len(clock.slept) == 10 and max(clock.slept) <= 1.001 * DT


def test_a_box_without_a_reader_ticks_once_in_a_millisecond(box, clock):
    """So that the world behind it does not grow old while a client is starting."""
    began = clock.now
    for _ in range(500):
        box.round()
    assert box.ticks == 500 and clock.now - began >= 0.99 * 500 * DT


def test_a_resting_arms_box_hardly_waits_for_its_reader(box, clock):
    """The client library throws away what has arrived and waits for one more state: each would wait for the other."""
    box.reader = lambda: 0.0
    began = clock.now
    for _ in range(500):
        box.round()
    assert box.ticks > 490 and clock.now - began >= 0.99 * 500 * DT, "on at its own pace, no faster"


def test_in_a_motion_the_box_waits_for_its_reader(box, clock):
    box.round()
    box.reader = lambda: 0.0
    box._move_id, box._answered = 1, True
    for _ in range(control_box._READER_ROUNDS):
        box.round()
    assert box.ticks <= 2


@pytest.mark.parametrize("given", [None, "real_time"])
def test_a_device_does_not_wait_for_the_priority_of_its_client(given, request):
    """Two workers' plans took both processors in turns, and no state came for a second: a lost connection."""
    if given:
        request.getfixturevalue(given)
    own = os.sched_getparam(0).sched_priority
    with HandDouble(next(ADDRESSES)) as hand:
        served = lambda: os.sched_getparam(hand._thread.native_id).sched_priority
        assert until(lambda: served() == (own + 1 if own else 0))
