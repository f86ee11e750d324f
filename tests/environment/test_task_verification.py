"""``verify_task`` by physics: what a teacher sees of a task that the check calls done, and what does not stay put."""

from __future__ import annotations

import pytest

from memo_core.config import load_experiment
from memo_core.environment.task_verification import hidden_now, mechanics, run_code, verify_task
from memo_core.interfaces.task import Outcome, Task
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, sandbox_of, task_of
from memo_core.runs.sections import SECTIONS
from memo_core.scene.description import Body, Free, Geom, SceneDescription
from memo_core.scene.hollow import cup
from memo_core.scene.pose import Pose
from memo_core.teachers.goal_check import unmet_goal, unseen_goal
from memo_core.teachers.simulated_teacher import SimulatedTeacher, SimulatedTeacherSettings

FOOT = Geom("box", (0.11, 0.11, 0.012), Pose((0.0, 0.0, 0.006)))
POLE = Geom("cylinder", (0.01, 0.09), Pose((0.0, 0.0, 0.057)))
WALL = 0.014


class RingOnAPost(Task):
    """A ring that stands around a post and is called done by the check; foot and pole are one body, or two."""

    name = "ring"
    instruction = "put the ring on the post"
    reference_solution = "wait(0.1)"
    settle = 0.5

    def __init__(self, place: str) -> None:
        self.goal = (f"the ring is on the {place}", "the hand has let go of the ring")

    def scene(self, rng) -> SceneDescription:
        pose = Pose((0.5, 0.1, 0.0))
        post = [Body("post", (FOOT, POLE), pose, label="post", fixture=True)]
        if "the ring is on the base" in self.goal:
            post = [
                Body(name, (one,), pose, label=name, fixture=True) for name, one in (("base", FOOT), ("post", POLE))
            ]
        ring = cup(0.028, 0.03 + WALL, WALL, sides=16)[1:]
        at = Pose((0.5, 0.1, FOOT.size[2] - WALL))
        return SceneDescription((*post, Body("ring", ring, at, Free(), mass=0.08, label="ring")))

    def check(self, world, monitors) -> Outcome:
        return Outcome(True, "the post stands in the ring's hole")


@pytest.fixture(scope="module")
def experiment():
    return load_experiment(Registry(), None, (), SECTIONS)


@pytest.mark.sim
@pytest.mark.parametrize(
    ("place", "unmet", "judged"),
    [("post", ["'the ring is on the post' is not fulfilled"], "correct"), ("base", [], "approve")],
)
def test_a_success_is_put_before_the_simulated_teacher(experiment, place, unmet, judged):
    task = RingOnAPost(place)
    [found] = verify_task(lambda seed: environment_of(experiment, task, seed), lambda: sandbox_of(experiment), [0])
    assert found.reference.success and found.watched is not None and found.watched.goal == task.goal
    assert unmet_goal(found.watched) == unmet
    teacher = SimulatedTeacher(SimulatedTeacherSettings(misjudges=0.0))
    teacher.open()
    assert teacher.judge_task(found.watched).kind == judged, "what it says of the same in a run"
    assert unseen_goal(task.goal, task.scene(None)) == []


class Dropped(RingOnAPost):
    """A block that starts so far above the table."""

    def __init__(self, height: float) -> None:
        super().__init__("table")
        self.height = height

    def scene(self, rng) -> SceneDescription:
        block = Geom("box", (0.04, 0.04, 0.04), mass=0.1)
        grain = Body("grain", (block,), Pose((0.5, 0.2, 0.12)), Free(), heap="sand")
        at = Pose((0.5, -0.1, 0.02 + self.height))
        return SceneDescription((grain, Body("block", (block,), at, Free(), label="ring")))


@pytest.mark.sim
@pytest.mark.parametrize(("height", "moved"), [(0.014, {"block": pytest.approx(0.014, abs=5e-4)}), (0.001, {})])
def test_what_falls_before_the_robot_moves_is_told_with_how_far(experiment, height, moved):
    task = Dropped(height)
    [found] = verify_task(lambda seed: environment_of(experiment, task, seed), lambda: sandbox_of(experiment), [0])
    assert found.unsettled == moved


class Overlapping(Dropped):
    """Two blocks of which one stands 1 cm deep in the other."""

    def scene(self, rng) -> SceneDescription:
        block = Geom("box", (0.04, 0.04, 0.04), mass=0.1)
        places = {"block": -0.10, "cup": -0.07}
        return SceneDescription(
            tuple(Body(name, (block,), Pose((0.5, y, 0.02)), Free(), label=name) for name, y in places.items())
        )


@pytest.mark.sim
def test_what_was_put_into_something_else_is_told_with_what_it_touches(experiment):
    task = Overlapping(0.0)
    [found] = verify_task(lambda seed: environment_of(experiment, task, seed), lambda: sandbox_of(experiment), [0])
    assert found.touching == {"block": ["cup", "table"], "cup": ["block", "table"]}


@pytest.mark.sim
def test_the_inside_of_a_closed_thing_is_told_to_the_author_of_robot_code(experiment):
    task = task_of(experiment, "put-the-cube-away")
    with environment_of(experiment, task, 0) as world, sandbox_of(experiment) as sandbox:
        [inside] = [one for body, _ in world.description.walk() for one in body.cavities][:1]
        error = run_code(world, f"get_position({inside.label!r})", sandbox).error
        assert hidden_now(error, world) == f"; {inside.label!r} is seen only while the joint {inside.door!r} is open"
        assert hidden_now("unknown object 'moon'", world) == ""
        told = mechanics(world)
    assert told["joints"][inside.door] == pytest.approx(0.0, abs=1e-3) and told["locks"] == {}


@pytest.mark.sim
def test_the_locks_of_a_scene_are_told(experiment):
    quirks = load_experiment(Registry(), None, ("suite.backend=quirks",), SECTIONS)
    with environment_of(quirks, task_of(quirks, "open-the-safe"), 0) as world:
        assert set(mechanics(world)["locks"].values()) == {True}
