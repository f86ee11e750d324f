"""A simulation keeps to the clock on the wall where a person follows it, and a stop never waits for that clock."""

from __future__ import annotations

import threading
import time

import pytest

from memo_core.config import load_experiment
from memo_core.environment import real_time
from memo_core.environment.real_time import RealTime
from memo_core.errors import Stopped
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, tasks_of
from memo_core.runs.sections import SECTIONS
from tests.support.timing import shortest

PROMISE_S = 0.05
TICK_S = 0.01


class Clocks:
    """The wall's and the simulation's, both by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.wall = 100.0
        self.simulated = 5.0
        self.slept = 0.0
        self.stopped = False
        monkeypatch.setattr(real_time, "time", self)
        self.pace = RealTime(lambda: self.simulated, lambda: self.stopped)

    def monotonic(self) -> float:
        return self.wall

    def sleep(self, seconds: float) -> None:
        self.slept += seconds
        self.wall += seconds

    def ticks(self, count: int, computing_s: float = 0.0) -> float:
        """Seconds waited during so many ticks that take so long to compute."""
        before = self.slept
        for _ in range(count):
            self.simulated += TICK_S
            self.wall += computing_s
            self.pace.wait()
        return self.slept - before


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Clocks:
    clocks = Clocks(monkeypatch)
    clocks.ticks(1)
    return clocks


@pytest.mark.parametrize("computing_s", [0.0, 0.004])
def test_simulated_time_passes_as_time_does(clocks: Clocks, computing_s: float):
    began = clocks.wall
    clocks.ticks(200, computing_s)
    assert clocks.wall - began == pytest.approx(200 * TICK_S, abs=TICK_S)


def test_nothing_is_hurried_after_a_pause_and_nothing_waited_for_after_another_checkpoint(clocks: Clocks):
    clocks.wall += 30.0  # a model was asked
    assert clocks.ticks(101) == pytest.approx(1.0, abs=2 * TICK_S)
    for jump in (-3.0, 40.0):
        clocks.simulated += jump
        assert clocks.ticks(11) == pytest.approx(0.1, abs=2 * TICK_S)


def test_after_a_stop_nothing_is_waited_for(clocks: Clocks):
    clocks.stopped = True
    assert clocks.ticks(50) == 0.0


@pytest.fixture(scope="module", params=["mujoco", "pybullet"])
def world(request: pytest.FixtureRequest):
    experiment = load_experiment(Registry(), None, (f"simulator={request.param}",), SECTIONS)
    with environment_of(experiment, tasks_of(experiment)[0], 3) as opened:
        opened.pace()
        yield opened


@pytest.mark.sim
def test_a_stop_brakes_the_arm_within_the_promise_although_the_motion_is_paced(world):
    start = world.checkpoint()

    def seconds() -> float:
        world.link.release()
        world.restore(start)
        pressed: list[float] = []

        def press() -> None:
            pressed.append(time.monotonic())
            world.link.stop()

        timer = threading.Timer(0.4, press)
        timer.start()
        began = time.monotonic()
        with pytest.raises(Stopped):
            for height in (0.5, 0.3) * 20:
                world.control.move_to([0.45, 0.0, height], None, None, 0.0, 1.0)
        ended = time.monotonic()
        assert world.time() <= ended - began + 0.2, "the motion is not paced"
        return ended - pressed[0]

    assert shortest(seconds, PROMISE_S) < PROMISE_S


@pytest.mark.sim
def test_once_the_run_is_concluded_nobody_waits(world):
    world.link.release()
    before = world.time()
    world.conclude("unobserved")
    world.settle(30.0)
    assert world.time() - before >= 30.0
    began, simulated = time.monotonic(), world.time()
    world.settle(1.0)
    assert time.monotonic() - began < world.time() - simulated
