"""A world can be put back exactly, whatever watched it; the same seed is the same world; others' states are refused."""

from __future__ import annotations

import json
from itertools import pairwise

import pytest

from memo_core.config import load_experiment
from memo_core.environment.simulated import find_task
from memo_core.environment.task_verification import run_code
from memo_core.errors import InvalidArgument, UnknownName
from memo_core.evaluation.lesions import VariedTask
from memo_core.interfaces.task import Monitor
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, sandbox_of, tasks_of
from memo_core.runs.sections import SECTIONS

pytestmark = pytest.mark.sim

NOISY = ("perception.backend=ground-truth", "perception.position_noise=0.003")
MOVE = "open_gripper(0.05)\nmove_to([0.45, 0.1, 0.3], top_orientation())\nclose_gripper()\nlook()\n"
PUSH = "p = get_position(get_objects()[0])\nlook()\nmove_straight([0.4, -0.1, 0.25])\nopen_gripper()\nlook()\n"


@pytest.fixture(scope="module")
def experiment():
    return load_experiment(Registry(), None, NOISY, SECTIONS)


@pytest.fixture(scope="module")
def sandbox(experiment):
    with sandbox_of(experiment) as opened:
        yield opened


@pytest.fixture
def world(experiment):
    with environment_of(experiment, tasks_of(experiment)[0], 3) as opened:
        yield opened


def follow(world, sandbox) -> tuple[bytes, list]:
    """Act and look; what came of it, to the last bit and the last digit of noise."""
    execution = run_code(world, PUSH, sandbox)
    assert execution.succeeded, execution.error
    seen = [node.pose for node in world.look().nodes]
    return world.checkpoint(), seen


def test_code_is_kept_in_the_same_workspace_as_in_a_run(world, sandbox):
    beyond = world.robot.reach + 0.4
    execution = run_code(world, f"move_to([{beyond}, 0.0, 0.3], top_orientation())", sandbox)
    assert execution.kind == "MotionError" and "outside the workspace" in execution.error


def test_what_follows_a_restore_is_exactly_what_followed_before(world, sandbox):
    assert run_code(world, MOVE, sandbox).succeeded
    start = world.checkpoint()
    first = follow(world, sandbox)
    world.restore(start)
    assert world.checkpoint() == start
    assert follow(world, sandbox) == first


def test_watching_changes_nothing_and_sees_the_whole_motion(world, sandbox):
    start = world.checkpoint()
    unwatched = follow(world, sandbox)
    world.restore(start)
    world.start_watching()
    watched = follow(world, sandbox)
    sightings = world.stop_watching()
    assert watched == unwatched
    assert sightings[0].time < sightings[-1].time == world.time()
    gaps = [b.time - a.time for a, b in pairwise(sightings)]
    assert max(gaps) <= 0.52 and len(sightings) >= 3
    assert world.stop_watching() == ()


def test_a_persons_glance_is_true_where_the_robots_look_is_noisy(world):
    first, second = world.look(), world.look()
    assert [n.pose for n in first.nodes] != [n.pose for n in second.nodes]
    assert [n.pose for n in world.glance().nodes] == [n.pose for n in world.glance().nodes]


def test_the_same_seed_is_the_same_world_and_another_is_not(experiment):
    task = tasks_of(experiment)[0]

    def seen(seed: int) -> list:
        with environment_of(experiment, task, seed) as world:
            return [node.pose for node in world.look().nodes]

    assert seen(3) == seen(3) != seen(4)


def test_a_checkpoint_of_another_world_is_refused_in_clear_words(experiment, world):
    with environment_of(experiment, tasks_of(experiment)[0], 4) as other:
        foreign = other.checkpoint()
    with pytest.raises(InvalidArgument, match="seed 4"):
        world.restore(foreign)
    with pytest.raises(InvalidArgument, match="not a checkpoint"):
        world.restore(b"\x00nonsense")


@pytest.mark.parametrize("part", ["task", "seed", "link", "perception", "control", "monitors"])
@pytest.mark.parametrize("damage", ["gone", None, "~~~", [[]], {"left": 1}])
def test_a_damaged_checkpoint_is_refused_and_the_world_stays_as_it_was(world, part, damage):
    before = world.checkpoint()
    state = json.loads(before)
    if damage == "gone":
        del state[part]
    else:
        state[part] = damage
    with pytest.raises(InvalidArgument, match=r"checkpoint|state"):
        world.restore(json.dumps(state).encode())
    assert world.checkpoint() == before


class Ticks(Monitor):
    """Counts ticks."""

    name = "ticks"

    def __init__(self) -> None:
        self.count = 0

    def reset(self, world) -> None:
        self.count = 0

    def update(self, world) -> None:
        self.count += 1

    def memory(self) -> dict:
        return {"count": self.count}

    def recall(self, memory: dict) -> None:
        self.count = memory["count"]


class Counted(VariedTask):
    def monitors(self):
        return (Ticks(),)


def test_monitors_watch_every_tick_and_a_retry_inherits_nothing(experiment):
    task = Counted(tasks_of(experiment)[0], lambda scene: scene, "counted")
    with environment_of(experiment, task, 0) as world:
        world.settle(0.2)
        ticks = world.monitors["ticks"]
        assert ticks.count == 20
        start = world.checkpoint()
        world.settle(0.5)
        assert ticks.count == 70
        world.restore(start)
        assert ticks.count == 20


def test_an_unknown_task_is_named_with_those_there_are(experiment):
    with pytest.raises(UnknownName, match="did you mean"):
        find_task(tasks_of(experiment), "stack-the-cube")


def test_closing_twice_or_unopened_is_harmless(experiment):
    world = environment_of(experiment, tasks_of(experiment)[0], 0)
    world.close()
    world.open()
    world.close()
    world.close()
