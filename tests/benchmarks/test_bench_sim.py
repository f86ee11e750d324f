"""The simulator benchmark measures what it says: the same motion, a grasp, and a stack that costs little."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable

import pytest
from memo_benchmarks.sim import SimBench, bench_sim
from memo_franka.description import panda
from memo_sim_mujoco.simulator import MujocoSimulator

from memo_core.cli.main import main
from memo_core.errors import BackendUnavailable
from tests.support.timing import shortest


@pytest.fixture(scope="module")
def measured() -> SimBench:
    return once()


def once() -> SimBench:
    return SimBench(**bench_sim(MujocoSimulator(), panda(), rounds=1))


def best(measured: SimBench, value: Callable[[SimBench], float], promise: float) -> float:
    """The smallest ``value`` of some measurements, the first of them made already: other programs only add to it."""
    made = [measured]
    return shortest(lambda: value(made.pop() if made else once()), promise, tries=4)


@pytest.mark.sim
def test_the_bare_loop_replays_the_very_same_motion(measured):
    assert measured.same_motion
    assert measured.grasped
    assert measured.ticks > 500


def test_the_motion_stack_costs_little(measured):
    # The promise is 0.85, measured by `memo bench sim` on a quiet machine; here others may be running.
    assert best(measured, lambda one: 1 / one.ratio, 1 / 0.7) < 1 / 0.7
    assert best(measured, lambda one: 1 / one.real_time_factor, 1 / 20) < 1 / 20


def test_checkpoints_are_quick_and_small(measured):
    assert best(measured, lambda one: one.checkpoint_us, 2000) < 2000
    assert best(measured, lambda one: one.restore_us, 2000) < 2000
    assert measured.checkpoint_bytes < 10_000


@pytest.mark.sim
def test_both_simulators_are_measured_side_by_side_with_their_memory(capsys):
    names = ("mujoco", "pybullet")
    with pytest.raises(SystemExit) as ended:
        main(["bench", "sim", "--rounds", "1", "--json", *(part for name in names for part in ("--simulator", name))])
    assert not ended.value.code
    found = json.loads(capsys.readouterr().out)["simulators"]
    assert [one["simulator"] for one in found] == list(names)
    for one in found:
        assert one["same_motion"] and one["grasped"], one
        if sys.platform.startswith("linux"):
            assert 1 < one["engine_mb"] < 1000 and 0.1 < one["scene_mb"] < 1000, one


@pytest.mark.sim
def test_a_replay_of_other_controls_is_noticed():
    class Forgetful(MujocoSimulator):
        def engine_controls(self):
            ctrl, parameters = super().engine_controls()
            return ctrl * 0.999, parameters

    assert not bench_sim(Forgetful(), panda(), rounds=1)["same_motion"]


@pytest.mark.sim
def test_a_simulator_that_does_not_have_the_two_methods_is_refused():
    without = type("Without", (MujocoSimulator,), {"bare_loop": None})
    with pytest.raises(BackendUnavailable, match="no bare loop"):
        bench_sim(without(), panda())


@pytest.mark.sim
def test_a_simulator_without_a_bare_loop_is_refused():
    class Closed(MujocoSimulator):
        def engine_controls(self):
            raise NotImplementedError("no bare loop")

    with pytest.raises(BackendUnavailable, match="no bare loop"):
        bench_sim(Closed(), panda())
