"""A look that asks a model: within a budget, recorded and replayed, and not asked for while the arm moves."""

from __future__ import annotations

import json

import numpy as np
import pytest
from memo_llm.replay.model import Recorder

from memo_core.cli.app import run_app
from memo_core.config import load_experiment
from memo_core.events import ModelAsked, ModelCalled
from memo_core.interfaces.llm import Message, Request
from memo_core.llm.budget import Budget, BudgetExceeded, Limit
from memo_core.plugins.registry import Registry
from memo_core.policy.settings import RunSettings
from memo_core.process.stop_switch import StopSwitch
from memo_core.runs.asking import asking
from memo_core.runs.factories import task_of, world_of
from memo_core.runs.sections import SECTIONS
from memo_core.scene.pose import Pose
from memo_core.testing.fake_llm import ScriptedModel

TASK = "put-the-food-in-the-microwave"
MARKS = ["perception.backend=cameras", "perception.detector=marks"]
ANSWER = json.dumps({"things": [{"label": "something", "marks": [1]}]})


def test_what_is_asked_in_a_look_counts_against_the_budget():
    model, events = ScriptedModel({"look": [ANSWER] * 3}), []
    budget = Budget(Limit(max_tokens=8))
    ask = asking(model, StopSwitch(), events.append, budget, RunSettings())
    question = Request("look", (Message("user", "what is there to be seen?"),))
    assert ask(question).text == ANSWER
    assert [type(event) for event in events] == [ModelAsked, ModelCalled]
    assert {event.phase for event in events} == {"look"}
    assert budget.spent.calls == 1 and budget.spent.prompt_tokens == 6
    with pytest.raises(BudgetExceeded):
        ask(question)
    assert len(model.asked) == 1


@pytest.fixture(scope="module")
def looked(tmp_path_factory):
    """A look in the simulator with marks, recorded: the graph's labels, the number of calls, and the recording."""
    file = tmp_path_factory.mktemp("recording") / "calls.jsonl"
    model = ScriptedModel({"look": [ANSWER] * 20})
    recorder = Recorder(model, file)
    recorder.open()
    experiment = load_experiment(Registry(), None, MARKS, SECTIONS, TASK, 0)
    world = world_of(experiment, task_of(experiment, TASK), 0)
    world.perception.use_model(lambda question: recorder.answer(question))
    with world:
        labels = [node.label for node in world.control.scene().nodes]
        once = len(model.asked)
        world.look()
        again = len(model.asked)
        world.perception.glance()
        resting = len(model.asked)
        targets = world.link.joint_targets()
        for _ in range(20):
            targets = targets + np.array([0.01, *[0.0] * (len(targets) - 1)])
            world.link.send(targets)
        world.perception.glance()
        moving = len(model.asked)
    recorder.close()
    return labels, (once, again, resting, moving), file


@pytest.mark.sim
def test_marks_are_asked_about_once_for_the_same_pictures(looked):
    labels, (once, again, _, _), _ = looked
    assert labels == ["something"]
    assert (once, again) == (1, 1)


def test_a_glance_at_a_moving_arm_asks_nothing(looked):
    _, (_, again, resting, moving), _ = looked
    assert again == resting == moving


@pytest.mark.sim
def test_a_recorded_look_is_seen_again_without_the_model(looked, capsys):
    labels, _, file = looked
    sets = [word for one in MARKS for word in ("--set", one)]
    assert run_app(["see", "--task", TASK, "--seed", "0", *sets, "--replay", str(file), "--json"]) == 0
    seen = json.loads(capsys.readouterr().out)["scene"]["nodes"]
    assert [node["label"] for node in seen] == labels
    assert Pose(tuple(seen[0]["pose"]["position"])).position[2] > 0
