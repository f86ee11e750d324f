"""``memo tasks verify`` keeps results and goes on from them; ``memo tasks pictures`` draws what is there."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest
from memo_sim_mujoco.simulator import MujocoSimulator, SimulationDiverged

from memo_core.cli.options import load
from memo_core.cli.verification import TrialLog, VerifiedTrial, digest_of, holds, report_of, run_trial, run_trials
from memo_core.errors import BackendUnavailable, InvalidArgument, RobotFault, TaskCodeError
from memo_core.runs.factories import environment_of, task_of
from memo_core.runs.run_errors import Halted
from memo_core.scene.scene_table import scene_table

RESULT = {
    "task": "lift",
    "seed": 3,
    "reference": True,
    "reference_why": "it is up",
    "null": False,
    "null_why": "it is not up",
    "wall_s": 2.0,
    "sim_s": 30.0,
    "cpu_s": 1.5,
}
OWN_TASKS = """
from memo_core.plugins.hooks import hookimpl
from memo_core.interfaces.backend import Backend
from memo_core.interfaces.task import Outcome, Task
from memo_core.scene.description import SceneDescription


class Lift(Task):
    name, instruction, reference_solution = "lift", "lift it", "wait(1)"

    def scene(self, rng):
        return SceneDescription(())

    def check(self, world, monitors):
        return Outcome(world.tool_pose().position[2] > 0.1, "up")


@hookimpl
def memo_task_suites():
    return [Backend("suite", "own", "own tasks", lambda settings: (Lift(),))]
"""
TRIAL = VerifiedTrial(None, (), "lift", 3)


def same(name: str, seed: int) -> str:
    return f"{name} {seed}"


def memo(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


@pytest.mark.process
@pytest.mark.parametrize("command", ["verify", "show", "pictures"])
def test_a_task_of_another_suite_is_told_with_what_to_set(command):
    done = memo("tasks", command, "open-the-safe", "--suite", "tabletop")
    assert done.returncode == 2
    said = "unknown task 'open-the-safe' of suite 'tabletop'; the suite 'quirks' has it: suite.backend=quirks"
    assert said in done.stderr and len(done.stderr.splitlines()) == 1


def test_what_is_in_the_file_is_not_run_again(tmp_path, monkeypatch):
    log = TrialLog(tmp_path / "deep" / "out.jsonl", same)
    log.add(RESULT)
    monkeypatch.setattr("memo_core.cli.verification.run_trial", lambda trial: pytest.fail("it ran again"))
    assert run_trials([TRIAL], 1, TrialLog(tmp_path / "deep" / "out.jsonl", same))[0]["sim_s"] == 30.0


def test_a_line_that_a_kill_cut_off_is_run_again_and_the_file_stays_readable(tmp_path):
    file = tmp_path / "out.jsonl"
    log = TrialLog(file, same)
    log.add(RESULT)
    log.add(RESULT | {"seed": 4})
    file.write_bytes(file.read_bytes()[:-30])
    again = TrialLog(file, same)
    assert again.known(TRIAL) is not None and again.known(VerifiedTrial(None, (), "lift", 4)) is None
    again.add(RESULT | {"seed": 4})
    assert TrialLog(file, same).known(VerifiedTrial(None, (), "lift", 4)) is not None


def test_a_result_of_another_scene_or_setting_does_not_count(tmp_path):
    TrialLog(tmp_path / "out.jsonl", same).add(RESULT)
    assert TrialLog(tmp_path / "out.jsonl", lambda name, seed: "changed").known(TRIAL) is None


def test_a_file_that_cannot_be_written_is_said_before_anything_is_run(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidArgument, match="cannot be used"):
        TrialLog(tmp_path / "file" / "out.jsonl", same)


@pytest.mark.parametrize("text", ["hello\nworld\n", '{"task": "lift"}\n', "[1, 2]\n{}\n"])
def test_another_kind_of_file_is_refused_and_left_as_it_is(tmp_path, text):
    file = tmp_path / "notes.txt"
    file.write_text(text)
    with pytest.raises(InvalidArgument, match=r"line 1"):
        TrialLog(file, same)
    assert file.read_text() == text


def test_the_digest_depends_on_scene_solution_and_settings():
    one = digest_of(load(None, [])[1])
    assert one("open-the-fridge", 0) == digest_of(load(None, [])[1])("open-the-fridge", 0)
    assert one("open-the-fridge", 0) != one("open-the-fridge", 1)
    other = digest_of(load(None, ["simulator.timestep=0.001"])[1])
    assert one("open-the-fridge", 0) != other("open-the-fridge", 0)


@pytest.mark.process
def test_the_digest_depends_on_the_files_of_the_plugins_that_decide(tmp_path):
    """An edited success check, or a data file beside it, makes kept results stale; a process sees its own code."""
    (tmp_path / "own_tasks").mkdir()
    (tmp_path / "own_tasks" / "__init__.py").write_text(OWN_TASKS)
    asks = "from memo_core.cli.options import load; from memo_core.cli.verification import digest_of; "
    asks += "from memo_core.plugins.registry import Registry; import own_tasks, memo_core.cli.options as options; "
    asks += "from memo_core.testing.fake_entry_point import FakeEntryPoint; "
    asks += "from memo_core.plugins.entry_points import installed; "
    asks += "own = FakeEntryPoint('own', 'own', memo_task_suites=own_tasks.memo_task_suites); "
    asks += "options.load_registry = lambda: Registry([*installed('memo')[0], own]); "
    asks += "print(digest_of(load(None, ['suite.backend=own'])[1])('lift', 0))"

    def digest() -> str:
        environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
        done = subprocess.run(
            [sys.executable, "-c", asks], capture_output=True, text=True, timeout=120, env=environment, check=True
        )
        return done.stdout.strip()

    first = digest()
    assert digest() == first
    (tmp_path / "own_tasks" / "__init__.py").write_text(OWN_TASKS.replace("0.1", "0.2"))
    second = digest()
    assert second != first
    (tmp_path / "own_tasks" / "limits.yaml").write_text("width: 0.06")
    assert digest() not in (first, second)


def test_results_of_other_code_are_run_again_and_that_is_said(tmp_path, monkeypatch, capsys):
    file = tmp_path / "out.jsonl"
    TrialLog(file, same).add(RESULT)
    monkeypatch.setattr("memo_core.cli.verification.run_trial", lambda trial: RESULT | {"sim_s": 31.0})
    [result] = run_trials([TRIAL], 1, TrialLog(file, lambda name, seed: "edited"))
    assert result["sim_s"] == 31.0
    assert "1 of 1 trials are in the file with other code, settings or scenes" in capsys.readouterr().err


def test_nineteen_of_twenty_hold_and_eighteen_do_not():
    results = [RESULT | {"seed": seed, "reference": seed > 0} for seed in range(20)]
    assert holds(report_of("lift", results)) and report_of("lift", results)["real_time_factor"] == 20.0
    assert not holds(report_of("lift", [RESULT | {"seed": s, "reference": s > 1} for s in range(20)]))
    assert not holds(report_of("lift", [RESULT | {"seed": s, "null": s == 7} for s in range(20)]))


def test_what_moves_before_the_robot_does_is_told_with_the_most_and_its_seed():
    fell = [{}, {"unsettled": {"ring": 0.014}}, {"unsettled": {"ring": 0.003, "cup": 0.004}}]
    report = report_of("lift", [RESULT | {"seed": seed} | one for seed, one in enumerate(fell)])
    assert report["unsettled"] == {
        "ring": {"m": 0.014, "seed": 1, "touches": []},
        "cup": {"m": 0.004, "seed": 2, "touches": []},
    }
    assert holds(report)


def test_what_an_unsettled_thing_touches_is_told_with_it():
    report = report_of("lift", [RESULT | {"unsettled": {"ring": 0.014}, "touching": {"ring": ["cup"]}}])
    assert report["unsettled"]["ring"]["touches"] == ["cup"]


def test_a_goal_that_the_simulated_teacher_cannot_judge_does_not_hold():
    unseen = RESULT | {"goal_unseen": ["'the ring is onn it' has none of the forms"]}
    assert holds(report_of("lift", [RESULT])) and not holds(report_of("lift", [unseen]))


def test_a_goal_that_is_fulfilled_at_the_start_is_counted_and_may_be_of_what_no_camera_sees():
    report = report_of("lift", [RESULT, RESULT | {"seed": 4, "goal_at_start": True}])
    assert report["goal_at_start"] == 1 and holds(report)


def test_a_finished_task_is_a_line_where_no_progress_is_shown(monkeypatch, capsys):
    monkeypatch.setattr("memo_core.cli.verification.run_trial", lambda trial: RESULT | {"seed": trial.seed})
    run_trials([TRIAL, VerifiedTrial(None, (), "lift", 4)], 1, TrialLog(None, same))
    assert capsys.readouterr().err == "memo: lift is tried, 2 of 2 trials\n"


@pytest.mark.sim
@pytest.mark.parametrize(
    "fault",
    [
        SimulationDiverged(1.0, "BADQACC"),
        BackendUnavailable("simulator", "mujoco", "it died"),
        RobotFault("arm", "reflex", "it collided", "release it"),
        TaskCodeError("t", "check()", "raised"),
    ],
)
def test_what_robot_simulator_or_task_could_not_carry_out_has_no_outcome(fault, monkeypatch):
    def broken(self, targets):
        raise fault

    monkeypatch.setattr(MujocoSimulator, "command_joints", broken)
    found = run_trial(VerifiedTrial(None, (), "put-the-cube-away", 0))
    assert found["error"]["problem"] == str(fault) and "reference" not in found


def test_what_could_not_be_carried_out_is_in_no_count_is_not_kept_and_does_not_hold(tmp_path, monkeypatch):
    failed = {"task": "lift", "seed": 4, "error": {"cause": "error", "problem": "it diverged", "persistent": False}}
    monkeypatch.setattr("memo_core.cli.verification.run_trial", lambda trial: RESULT if trial.seed == 3 else failed)
    log = TrialLog(tmp_path / "out.jsonl", same)
    report = report_of("lift", run_trials([TRIAL, VerifiedTrial(None, (), "lift", 4)], 1, log))
    assert (report["reference"], report["seeds"], report["not_carried_out"]) == (1, 1, 1) and not holds(report)
    assert report["failures"] == [{"seed": 4, "what": "could not be carried out", "why": "it diverged"}]
    assert len((tmp_path / "out.jsonl").read_text().splitlines()) == 1


def test_an_error_that_persists_ends_the_command(monkeypatch):
    failed = {"task": "lift", "seed": 3, "error": {"cause": "simulator", "problem": "it died", "persistent": True}}
    monkeypatch.setattr("memo_core.cli.verification.run_trial", lambda trial: failed)
    with pytest.raises(Halted, match="it died; no more trials were begun"):
        run_trials([TRIAL, VerifiedTrial(None, (), "lift", 4)], 1, TrialLog(None, same))


def test_a_result_without_the_plain_attempt_does_not_answer_for_it(tmp_path):
    file = tmp_path / "out.jsonl"
    TrialLog(file, same).add(RESULT)
    asked = VerifiedTrial(None, (), "lift", 3, plain=True)
    assert TrialLog(file, same).known(asked) is None
    TrialLog(file, same).add(RESULT | {"plain": False, "plain_why": "it slipped"})
    assert TrialLog(file, same).known(asked) is not None and TrialLog(file, same).known(TRIAL) is not None


def test_a_plain_attempt_that_succeeds_is_a_failure_and_one_that_is_missing_is_none():
    results = [RESULT | {"seed": seed, "plain": seed == 1, "plain_why": "it is up"} for seed in range(3)]
    report = report_of("lift", results)
    assert (report["plain"], report["plain_seeds"]) == (1, 3) and not holds(report)
    [failure] = report["failures"]
    assert failure == {"seed": 1, "what": "the plain attempt succeeded", "why": "it is up"}
    report = report_of("lift", [RESULT | {"plain": None, "plain_why": ""}])
    assert (report["plain"], report["plain_seeds"]) == (None, 0) and holds(report)


@pytest.mark.process
def test_the_command_tries_what_one_would_do_untaught_too_and_goes_on_from_its_file(tmp_path):
    file = tmp_path / "out.jsonl"
    command = ("tasks", "verify", "open-the-rice-cooker", "--suite", "quirks", "--plain", "--seeds", "0", "--json")
    first = memo(*command, "--out", str(file))
    assert first.returncode == 0, first.stderr
    [report] = json.loads(first.stdout)["tasks"]
    assert json.loads(first.stdout)["suite"] == "quirks" and report["sim_s"] > 0 and report["real_time_factor"] > 0
    assert (report["reference"], report["null"], report["plain"], report["plain_seeds"]) == (1, 0, 0, 1)
    [line] = file.read_text().splitlines()
    second = memo(*command, "--out", str(file))
    assert "1 of 1 trials are in the file already" in second.stderr
    assert json.loads(second.stdout) == json.loads(first.stdout)
    assert file.read_text().splitlines() == [line]


@pytest.mark.process
def test_a_task_is_drawn_at_its_start_and_at_its_end(tmp_path):
    image = pytest.importorskip("PIL.Image")
    done = memo("tasks", "pictures", "pick-the-left-can", "--folder", str(tmp_path / "new"), "--width", "160", "--json")
    if "cannot be used" in done.stderr:
        pytest.skip(done.stderr)
    assert done.returncode == 0, done.stderr
    [drawn] = json.loads(done.stdout)["pictures"]
    start, end = (image.open(drawn[when]) for when in ("start", "end"))
    assert start.size == end.size == (160, 120)
    assert len(set(start.tobytes())) > 20 and start.tobytes() != end.tobytes()


@pytest.mark.sim
def test_a_task_is_shown_with_what_the_prompts_say_of_its_scene(capsys):
    """It is the scene as a run with this seed first sees it."""
    from memo_core.cli.main import main

    experiment = load(None, [])[1]
    with environment_of(experiment, task_of(experiment, "pick-the-left-can"), 3) as world:
        table = scene_table(world.look())
    for arguments in ([], ["--json"]):
        with pytest.raises(SystemExit, match="0"):
            main(["tasks", "show", "pick-the-left-can", "--seed", "3", "--prompt", *arguments])
        shown = capsys.readouterr().out
        assert json.loads(shown)["scene"] == table if arguments else table in shown
    assert table.startswith("## Scene") and "green can" in table


@pytest.mark.process
def test_the_list_says_the_suite_and_a_misspelt_one_is_an_error():
    listed = json.loads(memo("tasks", "list", "--json").stdout)
    assert listed["suite"] == "tabletop"
    named = {"name", "instruction", "goal", "type", "split", "suite", "reach"}
    assert all(set(task) == named for task in listed["tasks"])
    assert [task["split"] for task in listed["tasks"]] == ["training"] * 20 + ["held-out"] * 5
    assert {task["type"] for task in listed["tasks"]} == {"LH", "CR", "SR", "TR"}
    wrong = memo("tasks", "list", "--suite", "tabeltop")
    assert wrong.returncode == 2 and "did you mean 'tabletop'" in wrong.stderr
