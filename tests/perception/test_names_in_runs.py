"""A person says that a thing is called by a wrong name: that run's next prompts, and the first of a later run with the
same book, call it as they did."""

from __future__ import annotations

import pytest

from memo_core.config import load_experiment
from memo_core.plugins.registry import Registry
from memo_core.policy.method_interface import LanguageMethod
from memo_core.policy.methods import METHODS
from memo_core.policy.settings import RunSettings, TeachingSettings
from memo_core.runs.factories import environment_of, library_of, sandbox_of, task_of
from memo_core.runs.folder import RunFolder, new_run_folder
from memo_core.runs.run import RunComponents, perform
from memo_core.runs.sections import SECTIONS
from memo_core.skillbook.book import Skillbook
from memo_core.teachers.scripted import Line, ScriptedTeacher, ScriptSettings
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_llm import ScriptedModel
from memo_core.testing.fake_store import FakeStore

pytestmark = pytest.mark.sim

EYES = ["perception.backend=cameras", "perception.detector=oracle", "perception.simulated.width=320"]
NOTHING = "```python\nprint('there')\n```"
SAID = "That is not a cube, it is a sugar box."


def run(registry, folder, script, lines=()):
    """The prompts of a run, by phase."""
    experiment = load_experiment(registry, None, EYES, SECTIONS, "put-the-cube-away", 0)
    task, model = task_of(experiment, "put-the-cube-away"), ScriptedModel(script)
    components = RunComponents(
        method=LanguageMethod("memo", METHODS["memo"]),
        llm=model,
        make_environment=lambda: environment_of(experiment, task, 0),
        sandbox=sandbox_of(experiment),
        skills=library_of(experiment),
        settings=RunSettings(video="off"),
        book=Skillbook(f"sqlite:///{folder / 'book.db'}", FakeEmbedder(), FakeStore()),
        teacher=ScriptedTeacher(ScriptSettings(lines=lines)) if lines else None,
        teaching=TeachingSettings(replan=False),
    )
    report = perform(components, task, 0, lambda: RunFolder(new_run_folder(folder / "runs", "names", 0)), registry, {})
    assert not report.problem
    return model


def test_a_name_that_a_person_corrected_is_used_in_that_run_and_in_later_ones(tmp_path):
    registry = Registry()
    lines = (Line("LIFT(*)", SAID, 1), Line("LIFT(*)"))
    template = "```python\ndef up(name):\n    '''Above it.'''\n    wait(1.0)\n```"
    first = {"plan": ["LIFT(cube)", "DONE"], "code": [NOTHING, NOTHING], "template": [template]}
    prompts = run(registry, tmp_path, first, lines).prompts("code")
    assert "| cube | object |" in prompts[0] and "| sugar box | object |" not in prompts[0]
    assert "| sugar box | object |" in prompts[1] and "| cube | object |" not in prompts[1]
    (plan,) = run(registry, tmp_path, {"plan": ["DONE"]}).prompts("plan")
    assert "| sugar box | object |" in plan and "| cube | object |" not in plan
