"""A thing made of several bodies is held, although its own parts touch the hand."""

from __future__ import annotations

import pytest
from memo_tabletop import success_checks as checks

import memo_core as memo
from memo_core.environment.task_verification import run_code
from memo_core.runs.factories import environment_of, sandbox_of, task_of

pytestmark = pytest.mark.sim

LIFT = """
p = get_position("carton")
move_to([p[0], p[1], p[2] + 0.12], top_orientation())
move_straight([p[0], p[1], p[2] + 0.02])
close_gripper(12)
move_straight([p[0], p[1], p[2] + 0.15])
"""


@pytest.mark.parametrize("simulator", ["mujoco", "pybullet"])
def test_a_carton_of_several_bodies_is_held(simulator):
    name = "put-the-carton-on-the-board"
    experiment = memo.load(None, "suite.backend=quirks", f"simulator.backend={simulator}", task=name)
    with environment_of(experiment, task_of(experiment, name), 0) as world, sandbox_of(experiment) as sandbox:
        assert not checks.held(world.simulator, "carton")
        assert not run_code(world, LIFT, sandbox).error
        assert checks.held(world.simulator, "carton")
