"""A mistake in a task's own code is told in one line: task, method, error, the author's file and line, and the names
that exist."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from memo_core.config import load_experiment
from memo_core.environment.task_code import scene_of
from memo_core.environment.task_verification import run_code
from memo_core.errors import TaskCodeError
from memo_core.evaluation.lesions import VariedTask
from memo_core.interfaces.backend import Backend
from memo_core.interfaces.task import Monitor, Outcome, Task
from memo_core.plugins.hooks import hookimpl
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, sandbox_of
from memo_core.runs.sections import SECTIONS
from memo_core.scene.description import Body, Free, Geom, SceneDescription
from memo_core.scene.pose import Pose
from memo_core.testing.fake_entry_point import FakeEntryPoint
from memo_core.testing.plugins import GENERAL, check_backend

CUBE = Geom("box", (0.04, 0.04, 0.04), mass=0.1)


class Lift(Task):
    name = "lift"
    instruction = "lift the cube"
    goal = ("the hand holds the cube up",)
    reference_solution = "wait(0.1)"
    settle = 0.0

    def scene(self, rng) -> SceneDescription:
        x = float(rng.uniform(0.4, 0.5))
        return SceneDescription((Body("red_cube", (CUBE,), Pose((x, 0.0, 0.02)), Free(), label="cube"),))

    def check(self, world, monitors) -> Outcome:
        return Outcome(False, "not yet")


class Misnamed(Lift):
    def check(self, world, monitors):
        return Outcome(world.body_pose("red cube").position[2] > 0.1, "up")


class Bare(Lift):
    def check(self, world, monitors):
        return world.time > 1e6


class Sceneless(Lift):
    def scene(self, rng):
        return self.table / 2


class Doubled(Lift):
    def scene(self, rng):
        [body] = super().scene(rng).bodies
        return SceneDescription((body, body))


class Commaless(Lift):
    def scene(self, rng):
        return SceneDescription((Body("red_cube", (CUBE), label="cube"),))


class Sizeless(Lift):
    def scene(self, rng):
        return SceneDescription((Body("ball", (Geom("sphere", (0.02)),)),))


class Spelt(Lift):
    goal = "the hand holds the cube up"


class Watching(Monitor):
    name = "height"

    def reset(self, world): ...

    def update(self, world):
        if world.time > 0.3:
            world.body_pose("block")

    def memory(self):
        return {}

    def recall(self, memory): ...


class Watched(Lift):
    def monitors(self):
        return (Watching(),)


def line(function, text: str) -> str:
    lines, first = inspect.getsourcelines(function)
    [at] = [first + number for number, one in enumerate(lines) if text in one]
    return f"test_task_code.py:{at}"


@pytest.fixture(scope="module")
def experiment():
    return load_experiment(Registry(), None, (), SECTIONS)


@pytest.mark.sim
def test_a_check_that_raises_is_told_with_its_line_and_the_bodies(experiment):
    with environment_of(experiment, Misnamed(), 0) as world, pytest.raises(TaskCodeError) as raised:
        world.check()
    said = str(raised.value)
    assert said.startswith("task 'lift': check() raised KeyError: 'red cube' at ")
    assert line(Misnamed.check, "red cube") in said and said.endswith("; bodies: red_cube")


@pytest.mark.sim
def test_a_check_is_blamed_and_not_what_wraps_the_task(experiment):
    varied = VariedTask(Misnamed(), lambda scene: scene, "same")
    with environment_of(experiment, varied, 0) as world, pytest.raises(TaskCodeError) as raised:
        world.check()
    assert line(Misnamed.check, "red cube") in str(raised.value)


@pytest.mark.sim
def test_a_check_that_returns_no_outcome_is_told(experiment):
    with environment_of(experiment, Bare(), 0) as world, pytest.raises(TaskCodeError) as raised:
        world.check()
    assert "task 'lift': check() returned bool, not Outcome" in str(raised.value)


def test_a_scene_that_raises_is_told_with_its_line(experiment):
    with pytest.raises(TaskCodeError) as raised:
        environment_of(experiment, Sceneless(), 0).open()
    assert "task 'lift': scene() raised AttributeError" in str(raised.value)
    assert line(Sceneless.scene, "self.table") in str(raised.value)


@pytest.mark.parametrize(
    ("task", "said"),
    [
        (Commaless, "Body.geoms: is a Geom; expected a tuple; of one thing it has a comma: (x,) at "),
        (Sizeless, "Geom.size: is a float; expected a tuple; of one thing it has a comma: (x,) at "),
        (Spelt, "task 'lift': goal is a str; expected a tuple of sentences"),
    ],
)
def test_a_tuple_without_its_comma_is_told(task, said):
    with pytest.raises(TaskCodeError) as raised:
        scene_of(task(), np.random.default_rng(0))
    assert said in str(raised.value)
    if task is Commaless:
        assert line(Commaless.scene, "(CUBE)") in str(raised.value)


@pytest.mark.sim
def test_a_monitor_that_raises_ends_the_run_and_is_no_error_of_the_robots_code(experiment):
    with environment_of(experiment, Watched(), 0) as world, sandbox_of(experiment) as sandbox:
        with pytest.raises(TaskCodeError) as raised:
            run_code(world, "try:\n    wait(2)\nexcept Exception:\n    print('caught')\n", sandbox)
        assert "update() of monitor 'height' raised KeyError: 'block'" in str(raised.value)
        assert line(Watching.update, "body_pose") in str(raised.value)


class Forgetful(Watching):
    def memory(self):
        return {"touched": {"red_cube"}}


class Amnesiac(Watching):
    def recall(self, memory):
        self.touched = memory["touched"]


@pytest.mark.sim
@pytest.mark.parametrize(
    ("monitor", "said"),
    [
        (Forgetful, "memory() of monitor 'height' did not return JSON values (Object of type set is not JSON"),
        (Amnesiac, "recall() of monitor 'height' raised KeyError: 'touched' at "),
    ],
)
def test_a_monitor_that_cannot_keep_its_state_is_told(experiment, monitor, said):
    class Kept(Lift):
        def monitors(self):
            return (monitor(),)

    with environment_of(experiment, Kept(), 0) as world, pytest.raises(TaskCodeError) as raised:
        world.restore(world.checkpoint())
    assert said in str(raised.value)


@pytest.mark.process
@pytest.mark.parametrize(
    ("task", "said"),
    [
        (Doubled, "task 'lift': scene() has two bodies called 'red_cube'"),
        (Misnamed, "task 'lift': check() raised KeyError: 'red cube' at "),
    ],
)
def test_plugins_check_names_one_cause_once(task, said):
    @hookimpl
    def memo_task_suites():
        return [Backend("suite", "own", "Own tasks.", lambda settings: (task(),))]

    registry = Registry([FakeEntryPoint("own", "own-tasks", memo_task_suites=memo_task_suites)])
    results = [one for one in check_backend(registry, registry.get("suite", "own")) if one.rule not in GENERAL]
    broken = [result for result in results if result.outcome == "broken"]
    assert len(broken) == 1 and broken[0].why.startswith(said)
    assert all(result.why.startswith("follows from") for result in results if result.outcome == "skipped")
