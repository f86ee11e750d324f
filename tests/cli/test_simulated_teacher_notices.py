"""``memo run`` and ``memo tasks verify`` say what of a task the simulated teacher cannot see."""

from __future__ import annotations

import pytest

from memo_core.cli.options import load
from memo_core.cli.run import _say_of_the_teacher
from memo_core.environment.task_verification import Verified
from memo_core.interfaces.task import Outcome
from memo_core.interfaces.teacher import TaskEpisode
from memo_core.scene.graph import Node, Observation, Relation, SceneGraph
from memo_core.scene.pose import Pose


@pytest.fixture
def blind_goal(monkeypatch):
    """open-the-fridge with a goal of an unknown form."""
    from memo_core.runs.factories import task_of

    experiment = load(None, ["teacher.backend=simulated"], "open-the-fridge")[1]
    monkeypatch.setattr(type(task_of(experiment, "open-the-fridge")), "goal", ("the fridge feels cold",))
    return experiment


def test_a_run_says_what_the_simulated_teacher_cannot_see_and_that_it_errs(blind_goal, capsys):
    _say_of_the_teacher(blind_goal)
    unseen, errs = capsys.readouterr().err.splitlines()
    assert "does not judge the whole of 'open-the-fridge': 'the fridge feels cold' has none of the" in unseen
    assert "turns 5 % of its verdicts round on purpose (--set teacher.misjudges=0: none)" in errs


@pytest.mark.parametrize("settings", [["teacher.backend=silent"], ["teacher.backend=simulated", "teacher.misjudges=0"]])
def test_nothing_is_said_of_another_teacher_or_a_goal_that_can_be_seen(settings, capsys):
    _say_of_the_teacher(load(None, settings, "open-the-fridge")[1])
    assert not capsys.readouterr().err


def test_verifying_says_whether_the_goal_can_be_seen_and_what_fell(monkeypatch, capsys, blind_goal):
    from memo_core.cli.main import main

    fell = {"milk": 0.014}
    verified = Verified("open-the-fridge", 0, Outcome(True, "open"), Outcome(False, "shut"), unsettled=fell)
    monkeypatch.setattr("memo_core.environment.task_verification.verify_task", lambda *given: [verified])
    with pytest.raises(SystemExit, match="1"):
        main(["tasks", "verify", "open-the-fridge", "--seeds", "0"])
    said = capsys.readouterr().err
    assert "open-the-fridge, seed 0: 'milk' moves by 14.0 mm at the start, before the robot does" in said
    assert "open-the-fridge: the simulated teacher does not judge its goal: 'the fridge feels cold'" in said


@pytest.mark.parametrize(
    ("state", "success", "said"),
    [
        ("open", True, "goals: the simulated teacher understands each sentence and sees it fulfilled at the end"),
        (
            "closed",
            True,
            "open-the-fridge: to the simulated teacher 'the fridge door is open' is not fulfilled where the success "
            "check says done (1 of 1 seeds, first 0)",
        ),
        ("closed", False, "goals: the simulated teacher understands each sentence"),
    ],
)
def test_verifying_says_which_sentence_the_teacher_does_not_see_fulfilled(monkeypatch, capsys, state, success, said):
    from memo_core.cli.main import main

    door = Node("door", "fridge door", Pose((0.6, 0.0, 0.2)), (0.02, 0.3, 0.3))
    scene = SceneGraph((door,), (Relation("door", state),), Observation(Pose(), 0.08, False))
    seen = TaskEpisode("open the fridge", scene, scene, ("the fridge door is open",))
    verified = Verified("open-the-fridge", 0, Outcome(success, "done"), Outcome(False, "shut"), watched=seen)
    monkeypatch.setattr("memo_core.environment.task_verification.verify_task", lambda *given: [verified])
    with pytest.raises(SystemExit, match="0" if success else "1"):
        main(["tasks", "verify", "open-the-fridge", "--seeds", "0"])
    assert capsys.readouterr().err.splitlines()[-1] == said
