"""From a bare arm's URDF to stacked cubes, with nothing but what is read and guessed."""

from __future__ import annotations

import pytest

from memo_core.arm.description_from_urdf import describe_urdf
from memo_core.cli.options import load
from memo_core.environment.task_verification import verify_task
from memo_core.runs.factories import environment_of, sandbox_of, task_of
from tests.support.arms import six_joint_arm

pytestmark = pytest.mark.sim


@pytest.mark.parametrize("simulator", ["mujoco", "pybullet"])
def test_a_described_arm_stacks_the_cubes(simulator):
    robot = describe_urdf(six_joint_arm((1, 6)).urdf, "mine").robot
    _, experiment = load(None, [f"simulator.backend={simulator}"])
    task = task_of(experiment, "stack-the-cubes")

    def world(seed: int):
        made = environment_of(experiment, task, seed)
        made.robot = robot
        return made

    [found] = verify_task(world, lambda: sandbox_of(experiment), [0])
    assert found.reference.success, found.error or found.reference.reason
    assert not found.null.success
