"""MEMO's tasks as Gymnasium environments: Gymnasium's own checker, the task's own check, a policy that solves one."""

from __future__ import annotations

import importlib.util
import warnings
from pathlib import Path

import gymnasium
import memo_gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from memo_gymnasium.scene_arrays import RELATIONS, SceneArrays

import memo_core
from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.task import Outcome

pytestmark = pytest.mark.sim

EXAMPLE = Path(__file__).parents[2] / "examples" / "gym_policy.py"
FRIDGE = "memo/OpenTheFridge-v0"


@pytest.fixture
def made():
    """Makes environments and closes them."""
    open_now = []

    def make(task: str = "open-the-fridge", **settings) -> memo_gymnasium.TaskEnv:
        open_now.append(memo_gymnasium.TaskEnv(task, **settings))
        return open_now[-1]

    yield make
    for one in open_now:
        one.close()


def test_every_task_of_every_suite_can_be_made_and_stepped():
    names = {
        (suite.name, task.name)
        for suite in memo_core.registry().backends("suite")
        if not suite.own_world
        for task in suite.factory(suite.config())
    }
    assert len(names) >= 41
    for suite, name in names:
        spec = gymnasium.spec(memo_gymnasium.env_id(name))
        assert spec.kwargs == {"task": name, "suite": suite}
        environment = gymnasium.make(spec)  # wrapped in Gymnasium's passive checker
        observation, info = environment.reset(seed=0)
        assert not info["success"] and info["instruction"] and observation["seen"].sum() == len(info["labels"])
        hold = np.array([*observation["joints"], 0.08, 20.0], np.float32)
        _, reward, done, late, after = environment.step(hold)
        assert (reward, done, late) == (0.0, False, False) and after["time"] == pytest.approx(0.05)
        environment.close()


@pytest.mark.parametrize("action", ["joint", "cartesian"])
def test_gymnasiums_own_checker_passes(action, made):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it advises on bounds of spaces: ours are in SI units
        check_env(made(action=action), skip_render_check=True)


def test_a_seed_is_the_scene_of_memo_run_and_the_same_actions_lead_to_the_same_place(made):
    def rollout(seed: int) -> list[np.ndarray]:
        environment = made("stack-the-cubes")
        environment.action_space.seed(5)
        seen = [environment.reset(seed=seed)[0]]
        seen += [environment.step(environment.action_space.sample())[0] for _ in range(10)]
        return [np.concatenate([o["joints"], o["nodes"].ravel()]) for o in seen]

    first, again, other = rollout(3), rollout(3), rollout(4)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[0], other[0])
    experiment = memo_core.load(task="stack-the-cubes", seed=3)
    with memo_core.make_environment(experiment) as world:
        expected = SceneArrays(24).of(world.look())
    environment = made("stack-the-cubes")
    assert np.allclose(environment.reset(seed=3)[0]["nodes"], expected["nodes"], atol=1e-6)


def test_without_a_seed_the_next_scene_is_another_one(made):
    environment = made("stack-the-cubes", scene_graph=True)
    first = environment.reset(seed=1)[0]["nodes"]
    assert not np.array_equal(first, environment.reset()[0]["nodes"])


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vector_environments_step_together(mode):
    many = gymnasium.make_vec(FRIDGE, num_envs=2, vectorization_mode=mode, action="cartesian")
    observations, info = many.reset(seed=[0, 1])
    assert observations["joints"].shape == (2, 7) and list(info["instruction"]) == ["open the fridge"] * 2
    assert not np.array_equal(observations["nodes"][0], observations["nodes"][1])
    hands = observations["hand"][:, :3] + [0.0, 0.0, -0.05]
    down = np.tile([np.pi, 0.0, 0.0, 0.08, 20.0], (2, 1))
    for _ in range(20):
        observations, rewards, *_ = many.step(np.concatenate([hands, down], axis=1).astype(np.float32))
    assert np.allclose(observations["hand"][:, :3], hands, atol=0.01) and not rewards.any()
    many.close()


def test_the_arm_goes_no_faster_than_its_joints_may(made):
    environment = made()
    start = environment.reset(seed=0)[0]["joints"]
    far = environment.action_space.low.copy()
    after = environment.step(far)[0]["joints"]
    assert 0.0 < np.abs(after - start).max() < 0.05 * 2.7  # rad in 0.05 s; the fastest joints do 2.6 rad/s


def test_the_fingers_close_and_hold(made):
    environment = made()
    observation, _ = environment.reset(seed=0)
    hold = np.array([*observation["joints"], 0.02, 20.0], np.float32)
    for _ in range(30):
        observation, *_ = environment.step(hold)
    assert observation["gripper"] == pytest.approx([0.02, 0.0], abs=2e-3)


def load_example():
    spec = importlib.util.spec_from_file_location("gym_policy", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_scripted_policy_solves_a_task_by_what_it_observes():
    done, reason = load_example().episode(seed=0)
    assert done, reason


def test_a_success_that_does_not_last_is_taken_back(made, monkeypatch):
    environment = made()
    observation, _ = environment.reset(seed=0)
    world = environment._world
    hold = np.array([*observation["joints"], 0.08, 20.0], np.float32)
    monkeypatch.setattr(world, "check", lambda: Outcome(world.time() < 0.06, "open for a moment"))
    _, reward, done, _, info = environment.step(hold)
    assert (reward, done, info["success"]) == (0.0, False, False)
    assert info["time"] == pytest.approx(0.05)  # the world is where it was
    monkeypatch.setattr(world, "check", lambda: Outcome(world.time() > 0.06, "open and stays so"))
    environment.step(hold)  # shortly after, it is not tried again
    for _ in range(10):
        _, reward, done, _, info = environment.step(hold)
    assert (reward, done, info["success"]) == (1.0, True, True)


def test_pictures_are_observed_and_rendered(made):
    environment = made(cameras=("front",), image_size=(48, 64), scene_graph=False, render_mode="rgb_array")
    try:
        observation, _ = environment.reset(seed=0)
    except BackendUnavailable as error:
        pytest.skip(str(error))
    assert observation in environment.observation_space and "nodes" not in observation
    assert observation["camera_front"].std() > 10
    assert environment.render().shape == (48, 64, 3)


def test_an_episode_ends_at_the_tasks_time_limit():
    assert gymnasium.spec(FRIDGE).max_episode_steps == 300 / 0.05


def test_relations_are_in_the_rows_of_their_nodes(made):
    environment = made()
    observation, info = environment.reset(seed=0)
    door = info["labels"].index("fridge door")
    assert observation["relations"][RELATIONS.index("closed"), door, door] == 1
    assert info["sentences"] == ("the fridge door is closed",)


@pytest.mark.parametrize(
    ("settings", "error", "said"),
    [
        ({"task": "open-the-frigde"}, memo_core.ConfigErrors, "did you mean 'open-the-fridge'"),
        ({"action": "torque"}, InvalidArgument, "'joint' or 'cartesian'"),
        ({"render_mode": "human"}, InvalidArgument, "rgb_array"),
        ({"suite": "tabeltop"}, memo_core.ConfigErrors, "did you mean 'tabletop'"),
    ],
)
def test_wrong_settings_are_named(settings, error, said, made):
    with pytest.raises(error, match=said):
        made(**settings)


def test_too_few_rows_and_a_step_before_the_first_reset_are_named(made):
    with pytest.raises(InvalidArgument, match="rows"):
        made("stack-the-cubes", rows=2).reset(seed=0)
    with pytest.raises(InvalidArgument, match="reset"):
        made().step(np.zeros(9, np.float32))
