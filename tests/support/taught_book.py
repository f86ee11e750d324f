"""A book that a run in a simulator taught one template, with that run's folder."""

from __future__ import annotations

from pathlib import Path

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

TASK = "put-the-cube-away"
GRASP = """
    look()
    hand = top_orientation()
    place = get_position(thing)
    open_gripper()
    move_to([place[0], place[1], place[2] + 0.1], hand)
    move_straight(place, hand)
    close_gripper()
    move_straight([place[0], place[1], place[2] + 0.15], hand)
"""
PICK = f'def pick(thing):\n    """Grasp it from above."""{GRASP}'
FAILING = 'def pick(thing):\n    """Only look."""\n    look()\n'
CODE = f"```python\n{PICK}\npick('cube')\n```"
RUN = {"plan": ["LIFT(cube)", "DONE"], "code": [CODE], "template": [f"```python\n{PICK}```"]}


def teach(registry: Registry, folder: Path) -> None:
    """Do a run in which ``PICK`` is approved for LIFT(cube), with its folder and ``book.db`` in ``folder``. The
    sandbox of its experiment ends code that computes for 0.5 s."""
    settings = (f"task={TASK}", "sandbox.seconds_between_calls=0.5")
    experiment = load_experiment(registry, None, settings, SECTIONS)
    task = task_of(experiment, TASK)
    components = RunComponents(
        method=LanguageMethod("memo", METHODS["memo"]),
        llm=ScriptedModel(RUN),
        make_environment=lambda: environment_of(experiment, task, 0),
        sandbox=sandbox_of(experiment),
        skills=library_of(experiment),
        settings=RunSettings(video="off"),
        book=Skillbook(f"sqlite:///{folder / 'book.db'}", FakeEmbedder(), FakeStore()),
        teacher=ScriptedTeacher(ScriptSettings(lines=(Line("LIFT(*)"),))),
        teaching=TeachingSettings(replan=False),
    )
    report = perform(
        components, task, 0, lambda: RunFolder(new_run_folder(folder, task.name, 0)), registry, experiment.public()
    )
    assert [one.status for one in report.result.subtasks] == ["approved"]
