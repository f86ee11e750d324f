"""The simulator benchmark measures what it says: the same motion, a grasp, and a stack that costs little."""

from __future__ import annotations

import pytest
from memo_franka.description import panda
from memo_sim_mujoco.simulator import MujocoSimulator

from memo_core.errors import BackendUnavailable
from memo_core.experiment.bench_sim import SimBench, bench_sim


@pytest.fixture(scope="module")
def measured() -> SimBench:
    return SimBench(**bench_sim(MujocoSimulator(), panda(), rounds=1))


def test_the_bare_loop_replays_the_very_same_motion(measured):
    assert measured.same_motion
    assert measured.grasped
    assert measured.ticks > 500


def test_the_motion_stack_costs_little(measured):
    # The promise is 0.85, measured by `memo bench sim` on a quiet machine; here others may be running.
    assert 0.5 < measured.ratio
    assert measured.real_time_factor > 1.0


def test_checkpoints_are_quick_and_small(measured):
    assert measured.checkpoint_us < 2000
    assert measured.restore_us < 2000
    assert measured.checkpoint_bytes < 10_000


def test_a_replay_of_other_controls_is_noticed():
    class Forgetful(MujocoSimulator):
        def engine_controls(self):
            ctrl, parameters = super().engine_controls()
            return ctrl * 0.999, parameters

    assert not bench_sim(Forgetful(), panda(), rounds=1)["same_motion"]


def test_a_simulator_without_a_bare_loop_is_refused():
    class Closed(MujocoSimulator):
        def engine_controls(self):
            raise NotImplementedError("no bare loop")

    with pytest.raises(BackendUnavailable, match="no bare loop"):
        bench_sim(Closed(), panda())
