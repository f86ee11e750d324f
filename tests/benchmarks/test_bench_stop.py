"""The benchmarks of stops count what they were asked to measure: a promise is kept on all of it or not at all."""

from __future__ import annotations

import multiprocessing
import sys

import attrs
import pytest
from memo_benchmarks import stop
from memo_benchmarks.signals import bench_signals
from memo_benchmarks.stop import PhaseStop, StopBench, StopTask, bench_stop

from memo_core.config import load_experiment
from memo_core.environment.task_verification import run_code
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, sandbox_of
from memo_core.runs.sections import SECTIONS


@pytest.mark.sim
def test_as_many_signals_are_sent_as_were_asked_for():
    experiment = load_experiment(Registry(), None, ["run.video=off"], SECTIONS)
    (phase,) = bench_stop(experiment, 3, ["waiting"]).phases
    assert (phase.signals, phase.asked) == (3, 3)


@pytest.mark.sim
@pytest.mark.parametrize(
    "program",
    [stop.PROGRAMS["moving"], stop.PROGRAMS["grasping"], stop.TO_AND_FRO],
    ids=["moving", "grasping", "to-and-fro"],
)
def test_the_programs_that_move_the_arm_do_not_end_by_themselves(program):
    experiment = load_experiment(Registry(), None, ["run.video=off"], SECTIONS)
    with sandbox_of(experiment) as sandbox, environment_of(experiment, StopTask(), 0) as world:
        execution = run_code(world, program, sandbox, robot_seconds=30.0)
    assert "the robot was busy for more than 30 s" in execution.error


@pytest.mark.sim
def test_a_program_that_ends_by_itself_is_an_error_and_no_measurement(monkeypatch):
    monkeypatch.setitem(stop.PROGRAMS, "moving", "move_to([9.0, 0.0, 0.3], top_orientation())")
    experiment = load_experiment(Registry(), None, ["run.video=off"], SECTIONS)
    with pytest.raises(stop.ProgramEnded, match=r"moving.*9\.000"):
        bench_stop(experiment, 1, ["moving"])


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
