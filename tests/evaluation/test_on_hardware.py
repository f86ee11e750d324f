"""An evaluation on a real robot, with a test double of one and a scripted person: they set up each scene, release each
program and judge; what they are shown does not tell the method."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from memo_core.errors import InvalidArgument, Stopped
from memo_core.evaluation.evaluating import evaluate
from memo_core.evaluation.grid import Trial
from memo_core.evaluation.on_hardware import in_random_order
from memo_core.evaluation.sections import ALL_SECTIONS
from memo_core.interfaces.teacher import Arrangement, Verdict
from memo_core.process.stop_switch import StopSwitch
from memo_core.study.study import loader
from memo_core.testing.fake_llm import ScriptedModel
from tests.environment.test_hardware import UP, Person, registry_with
from tests.support.franka_cell import running_cell

pytest.importorskip("franky", reason="pip install 'plugins/franka[hardware]'")
pytestmark = [
    pytest.mark.filterwarnings("ignore:this computer's kernel is not real-time"),
    pytest.mark.usefixtures("real_time"),
]

FILE = """
llm: scripted
suite: tabletop
teacher: ann
perception: one-cube
embedder: fake
vectorstore: fake
robot: {{backend: fr3, driver: franka, address: {address}, clock_timeout_s: 10.0, hand_deadline_s: 60.0}}
evaluation:
  methods: [memo, memo-s]
  tasks: [put-the-cube-away]
  hours: []
  books: [empty]
  scenes: 1
  corrected: {{corrections: 0}}
"""


class Scripted(Person):
    """``verdicts_on_tasks`` are given in turn; ``pauses``: before which trial they do not go on."""

    def __init__(self, *verdicts: Verdict, pauses: int = 0) -> None:
        super().__init__()
        self.verdicts_on_tasks, self.pauses = list(verdicts), pauses

    def set_up(self, arrangement: Arrangement) -> bool:
        self.asked.append(arrangement)
        return arrangement.number != self.pauses

    def judge_task(self, episode):
        self.asked.append(episode)
        return self.verdicts_on_tasks.pop(0)


@pytest.fixture
def cell():
    with running_cell() as cell:
        yield cell


def evaluation(person: Scripted, model: ScriptedModel, address: str, folder: Path, *overrides: str):
    file = folder / "experiment.yaml"
    file.write_text(FILE.format(address=address))
    load = loader(registry_with(person, model), file, ALL_SECTIONS, overrides)
    return evaluate(load, folder / "out", StopSwitch())


@pytest.mark.process
def test_a_person_sets_up_releases_and_judges_trials_whose_method_they_do_not_know(cell, tmp_path):
    person = Scripted(Verdict("approve"), pauses=2)
    script = {"plan": ["LIFT(cube)", "DONE"], "code": [UP]}
    with pytest.raises(Stopped, match="same command goes on"):
        evaluation(person, ScriptedModel(script), cell.address, tmp_path)
    assert len(person.asked) == 4  # the scene, the program, the task; the next scene

    person.pauses, person.verdicts_on_tasks = 0, [Verdict("correct", "it lies on the table")]
    done = evaluation(person, ScriptedModel(script), cell.address, tmp_path)
    assert {row["method"] for row in done.rows} == {"memo", "memo-s"}
    assert sorted((row["success"], row["reason"]) for row in done.rows) == [
        (False, "it lies on the table"),
        (True, "the person says that it is done"),
    ]
    arrangements = [one for one in person.asked if isinstance(one, Arrangement)]
    assert [(one.scene, one.number, one.of) for one in arrangements] == [(1, 1, 2), (1, 2, 2), (1, 2, 2)]
    assert "memo" not in repr(person.asked) and "droc" not in repr(person.asked)
    folders = list((tmp_path / "out" / "evaluation" / "trials").iterdir())
    assert len(folders) == 2 and not any("memo" in folder.name for folder in folders)
    sheets = [json.loads((folder / "run" / "trial.json").read_text()) for folder in folders]
    assert {(sheet["method"], sheet["success"]) for sheet in sheets} == {
        (row["method"], row["success"]) for row in done.rows
    }
    assert not cell.box.arm.violations and cell.box.recoveries == 0


@pytest.mark.process
def test_what_a_person_says_in_a_trial_teaches_nothing(cell, tmp_path):
    person = Scripted(Verdict("correct", "no, not like that"), Verdict("approve"))
    person.releases += [Verdict("correct", "stay away from the lamp")]
    script = {"plan": ["LIFT(cube)", "DONE", "LIFT(cube)", "DONE"], "code": [UP, UP]}
    model = ScriptedModel(script)
    done = evaluation(person, model, cell.address, tmp_path)
    assert sorted(row["success"] for row in done.rows) == [False, True]
    assert not model.prompts("feedback"), "nothing was made of the words"
    assert sum(row["corrections"] + row["planning_remarks"] for row in done.rows) == 0


def test_more_than_one_trial_at_once_is_refused(tmp_path):
    with pytest.raises(InvalidArgument, match=r"evaluation\.jobs.*one robot"):
        evaluation(Scripted(), ScriptedModel({}), "127.0.0.9", tmp_path, "evaluation.jobs=2")


def test_the_order_is_that_of_the_seed_and_stays_where_trials_are_added():
    trials = [Trial("memo" if n % 2 else "droc-v", "task", n) for n in range(12)]
    order = in_random_order(trials, 3)
    assert order != trials and in_random_order(trials, 4) != order and set(order) == set(trials)
    fewer = in_random_order(trials[:8], 3)
    assert fewer == [trial for trial in order if trial in fewer]
