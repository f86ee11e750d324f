"""A call is run against the template whose work it is to do, from the same starts; it is accepted when it does not do
worse."""

from __future__ import annotations

import shutil
from contextlib import contextmanager

import attrs
import pytest
from memo_sim_mujoco.simulator import MujocoSimulator, SimulationDiverged

from memo_core.config import load_experiment
from memo_core.environment.simulated import SimulatedEnvironment
from memo_core.errors import InvalidArgument
from memo_core.maintenance import paired_trials, subtask_scene
from memo_core.maintenance.paired_trials import PairedTrial, PairedTrials, shortfall
from memo_core.maintenance.subtask_scene import ProgramOutcome
from memo_core.maintenance.template_sources import TemplateSources
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, task_of
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.functions import as_program
from tests.support.taught_book import FAILING, GRASP, TASK, teach


def general(before: str = "") -> str:
    """A function for several things, with lines that it begins with, and its call for the cube."""
    code = (
        f'def lift(thing, pause=0.0):\n    """Grasp a thing from above and lift it."""\n    {before or "pass"}{GRASP}'
    )
    return as_program(code, "lift('cube')")


@pytest.fixture(scope="module")
def registry():
    return Registry()


@pytest.fixture(scope="module")
def taught(registry, tmp_path_factory):
    folder = tmp_path_factory.mktemp("taught")
    teach(registry, folder)
    return folder


@pytest.fixture
def book(taught, tmp_path):
    shutil.copy(taught / "book.db", tmp_path / "book.db")
    with Skillbook(str(tmp_path / "book.db")) as opened:
        yield opened


@pytest.fixture
def template(book):
    [found] = book.entries("template")
    return found


@pytest.fixture
def ran(monkeypatch):
    """The programs that were run, in order."""
    programs, run_code = [], subtask_scene.run_code

    def noted(world, code, *args, **kwargs):
        programs.append(code)
        return run_code(world, code, *args, **kwargs)

    monkeypatch.setattr(subtask_scene, "run_code", noted)
    return programs


# -- in a simulator ------------------------------------------------------------------------------------------------


@pytest.mark.sim
def test_a_call_that_does_the_same_from_the_stored_start_and_in_new_scenes_is_accepted(book, registry, template):
    starts = []
    verdict = PairedTrials(book, registry).compare(template, general(), starts.append)
    assert (verdict.accepted, verdict.reason, verdict.untestable) == (True, "", "")
    assert [trial.start for trial in verdict.trials] == starts
    assert starts[0].startswith(f"run {TASK}") and starts[1:] == [f"{TASK} seed 1001", f"{TASK} seed 1002"]
    assert all(trial.before.success and trial.after.success for trial in verdict.trials)
    assert all(trial.after.robot_s > 1.0 for trial in verdict.trials)


@pytest.mark.sim
def test_a_template_that_needs_names_nobody_knows_is_compared_by_the_program_that_was_approved(
    book, registry, template
):
    needy = attrs.evolve(template, text='def lift(thing, handle, side):\n    """Lift."""\n    open_gripper()\n')
    verdict = PairedTrials(book, registry, scenes=0).compare(needy, general())
    assert verdict.accepted and verdict.trials[0].before.success


@pytest.mark.sim
def test_the_same_program_has_the_same_outcome_because_both_begin_in_the_same_state(book, registry, template):
    program = f"{template.text}\n\npick('cube')\n"
    for trial in PairedTrials(book, registry, scenes=1).compare(template, program).trials:
        assert trial.before == trial.after


@pytest.mark.sim
def test_the_templates_own_runs_are_remembered(book, registry, template, ran):
    trials = PairedTrials(book, registry, scenes=1)
    first, second = (trials.compare(template, general(f"print({n})")) for n in (1, 2))
    own = [code for code in ran if "pick('cube')" in code]
    assert len(own) == 2 and len(ran) == 6
    assert [one.before for one in first.trials] == [one.before for one in second.trials]
    assert [one.after.printed for one in second.trials] == ["2\n", "2\n"]
    assert [one.after.robot_s for one in first.trials] == [one.after.robot_s for one in second.trials]


@pytest.mark.sim
def test_one_that_fails_in_one_scene_only_is_refused_with_the_reason(book, registry, template):
    experiment = load_experiment(registry, None, (f"task={TASK}",), SECTIONS)
    with environment_of(experiment, task_of(experiment, TASK), 1002) as world:
        x = float(world.look().node("cube").pose.position[0])
    guard = f"""print("bound for it")
    if abs(get_position(thing)[0] - {x!r}) < 1e-6:
        raise RuntimeError("not there")"""
    verdict = PairedTrials(book, registry).compare(template, general(guard))
    assert [trial.after.success for trial in verdict.trials] == [True, True, False]
    assert not verdict.accepted and "2 of 3" in verdict.reason and f"{TASK} seed 1002" in verdict.reason
    assert "not there" in verdict.reason and verdict.trials[-1].after.printed == "bound for it\n"


@pytest.mark.sim
@pytest.mark.parametrize(
    ("program", "says"),
    [
        (as_program(FAILING, "pick('cube')"), "the cube"),
        (general().replace("lift('cube')", "lift('cube', height=2)"), "TypeError"),
        (general("while True:\n        wait(5)"), "the robot was busy"),
        (general("while True:\n        pass"), "the code computed longer"),
        (general("raise RuntimeError('the hand is full')"), "the hand is full"),
        ("def lift(:", "syntax error"),
    ],
    ids=["does nothing", "wrong keywords", "always moves", "always computes", "raises", "is no program"],
)
def test_a_program_that_does_not_do_it_has_failed_and_its_reason_is_told(book, registry, template, program, says):
    verdict = PairedTrials(book, registry, scenes=0).compare(template, program)
    [trial] = verdict.trials
    assert trial.before.success and not trial.after.success and not verdict.accepted
    assert says in trial.after.reason and trial.after.reason in verdict.reason


@pytest.mark.sim
def test_wrong_keywords_are_found_before_anything_moves(book, registry, template):
    wrong = general().replace("lift('cube')", "lift('cube', height=2)")
    [trial] = PairedTrials(book, registry, scenes=0).compare(template, wrong).trials
    assert trial.after.robot_s == 0.0 and not trial.after.finished


@pytest.mark.sim
def test_a_slow_one_is_refused(book, registry, template):
    verdict = PairedTrials(book, registry, scenes=0).compare(template, general("wait(20)"))
    [trial] = verdict.trials
    assert trial.after.success and not verdict.accepted
    assert trial.after.robot_s == pytest.approx(trial.before.robot_s + 20, abs=1.0)
    assert f"{trial.after.robot_s:.0f} s" in verdict.reason and f"{trial.before.robot_s:.0f} s" in verdict.reason


@pytest.mark.sim
def test_one_that_never_moves_and_never_returns_ends_on_the_wall_clock(book, registry, template, monkeypatch):
    monkeypatch.setattr(paired_trials, "LIMIT_MARGIN_S", -100.0)  # the sandbox leaves 1 s
    endless = "while True:\n        look()"
    [trial] = PairedTrials(book, registry, scenes=0).compare(template, general(endless)).trials
    assert "took longer than 1 s" in trial.after.reason


@pytest.mark.sim
def test_a_replaced_template_is_compared_as_well(book, registry, template):
    book.edit(template.id, FAILING, "ana")
    replaced = book.entry(template.id)
    assert replaced.superseded_by is not None
    assert PairedTrials(book, registry, scenes=0).compare(replaced, general()).accepted


@pytest.mark.sim
def test_a_new_scene_whose_start_is_not_reached_is_left_out_and_not_tried_twice(
    book, registry, template, monkeypatch, ran
):
    found, lead = TemplateSources.of, "raise RuntimeError('it slipped')"
    monkeypatch.setattr(
        TemplateSources, "of", lambda self, one: attrs.evolve(found(self, one), earlier=(("OPEN(drawer)", lead),))
    )
    trials = PairedTrials(book, registry)
    for _ in range(2):
        verdict = trials.compare(template, general())
        assert verdict.accepted and [trial.start[:3] for trial in verdict.trials] == ["run"]
    assert ran.count(lead) == 2  # once a scene


@pytest.mark.sim
def test_a_subtask_that_the_task_does_not_check_cannot_be_tested(book, registry, template, monkeypatch):
    monkeypatch.setattr(SimulatedEnvironment, "check_subtask", lambda self, subtask: None)
    verdict = PairedTrials(book, registry).compare(template, general())
    assert not verdict.accepted and not verdict.trials
    assert verdict.untestable == verdict.reason == f"the task {TASK} has no check of LIFT(cube)"


@pytest.mark.sim
def test_a_start_of_a_scene_that_is_built_otherwise_today_cannot_be_tested(book, registry, template, monkeypatch):
    def other(self, checkpoint):
        raise InvalidArgument("checkpoint", "it is of other monitors")

    monkeypatch.setattr(SimulatedEnvironment, "restore", other)
    verdict = PairedTrials(book, registry).compare(template, general())
    assert not verdict.trials and "its start cannot be restored: checkpoint: it is of other" in verdict.untestable


@pytest.mark.sim
def test_what_the_simulator_could_not_carry_out_is_no_verdict(book, registry, template, monkeypatch):
    def broken(self, targets):
        raise SimulationDiverged(1.0, "BADQACC")

    monkeypatch.setattr(MujocoSimulator, "command_joints", broken)
    with pytest.raises(SimulationDiverged):
        PairedTrials(book, registry).compare(template, general())


@pytest.mark.sim
def test_a_stop_interrupts_and_nothing_of_the_trial_is_remembered(book, registry, template, ran):
    pressed = [True]

    @contextmanager
    def stopping(link):
        if pressed:
            link.stop()
        yield

    trials = PairedTrials(book, registry, stopping, scenes=0)
    with pytest.raises(KeyboardInterrupt):
        trials.compare(template, general())
    pressed.clear()
    assert trials.compare(template, general()).accepted


# -- without one ---------------------------------------------------------------------------------------------------


def test_a_template_whose_run_folder_is_gone_cannot_be_tested(book, registry, template, monkeypatch):
    monkeypatch.setattr(Skillbook, "places", lambda self: [])
    verdict = PairedTrials(book, registry).compare(template, general())
    assert not verdict.accepted and not verdict.trials and f"folder of the run {TASK}" in verdict.untestable


def test_a_run_on_hardware_cannot_be_tested(book, registry, template, monkeypatch):
    class Moves:
        simulated = False

    monkeypatch.setattr("memo_core.config.Experiment.create", lambda self, kind, *_, **__: Moves())
    assert "moved hardware" in PairedTrials(book, registry).compare(template, general()).untestable


YES = ProgramOutcome(True, "", 10.0, "")
NO = ProgramOutcome(False, "it slipped", 10.0, "")
RAISED = attrs.evolve(NO, reason="RuntimeError: too far", finished=False)


def trials_of(*pairs: tuple[ProgramOutcome, ProgramOutcome]) -> list[PairedTrial]:
    return [PairedTrial(f"start {number}", before, after) for number, (before, after) in enumerate(pairs, start=1)]


@pytest.mark.parametrize(
    "pairs",
    [
        [(YES, YES), (YES, YES)],
        [(YES, YES), (NO, RAISED)],  # where the template fails as well
        [(YES, NO), (NO, YES), (YES, YES)],
        [(NO, YES)],
        [(NO, NO)],  # judged alike: the check may be wrong
        [(RAISED, NO)],
        [(YES, attrs.evolve(YES, robot_s=25.0))],
        [(NO, attrs.evolve(YES, robot_s=99.0))],  # there is no time to compare with
    ],
)
def test_a_call_that_does_no_worse_falls_short_of_nothing(pairs):
    assert shortfall(trials_of(*pairs)) == ""


@pytest.mark.parametrize(
    ("pairs", "says"),
    [
        ([(YES, NO)], "it succeeded from 0 of 1 starts and the template from 1: from start 1 it failed (it slipped)"),
        ([(YES, YES), (YES, RAISED)], "from start 2 it failed (RuntimeError: too far)"),
        ([(YES, NO), (NO, YES)], "from no start did both succeed: from start 1 it failed (it slipped)"),
        ([(NO, NO), (NO, RAISED)], "from start 2 it did not run to its end (RuntimeError: too far)"),
        ([(RAISED, RAISED)], "from start 1 it did not run to its end (RuntimeError: too far)"),
        (
            [(YES, attrs.evolve(YES, robot_s=26.0))],
            "from start 1 it took 26 s on the robot's clock, where the template took 10 s",
        ),
    ],
)
def test_what_it_falls_short_of_is_one_sentence(pairs, says):
    assert shortfall(trials_of(*pairs)).endswith(says)
