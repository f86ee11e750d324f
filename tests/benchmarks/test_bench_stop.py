"""The benchmarks of stops count what they were asked to measure: a promise is kept on all of it or not at all."""

from __future__ import annotations

import multiprocessing
import sys

import attrs
import pytest
from memo_benchmarks.signals import bench_signals
from memo_benchmarks.stop import PhaseStop, StopBench, bench_stop

from memo_core.config import load_experiment
from memo_core.plugins.registry import Registry
from memo_core.runs.sections import SECTIONS


@pytest.mark.sim
def test_as_many_signals_are_sent_as_were_asked_for():
    experiment = load_experiment(Registry(), None, ["run.video=off"], SECTIONS)
    (phase,) = bench_stop(experiment, 3, ["waiting"]).phases
    assert (phase.signals, phase.asked) == (3, 3)


def test_a_promise_is_not_kept_on_fewer_signals_than_were_asked_for():
    phase = PhaseStop("moving", 20, 20, 1.0, 2.0, 3.0, 4.0)
    assert phase.kept and StopBench((phase,)).kept
    fewer = attrs.evolve(phase, signals=1)
    assert not fewer.kept and not StopBench((phase, fewer)).kept and not StopBench(()).kept


@pytest.mark.process
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="counts processes in /proc")
def test_each_kind_of_signal_to_a_real_run_ends_it_in_order():
    process = multiprocessing.get_context("forkserver").Process(target=print)
    process.start()  # leaves a fork server behind, which is this process's own
    process.join()
    found = bench_signals(5, seed=1)
    assert found["faults"] == [] and found["kept"]
    assert [kind["signals"] for kind in found["kinds"]] == [1] * 5
