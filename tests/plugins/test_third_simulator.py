"""A third simulator: ``examples/own_simulator.py`` is plugged in, moves the arm, and is told which rules it breaks."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

from memo_core.config import load_experiment
from memo_core.plugins.registry import Registry
from memo_core.testing.fake_entry_point import FakeEntryPoint
from memo_core.testing.simulator import RULES

EXAMPLE = Path(__file__).parents[2] / "examples" / "own_simulator.py"
# It has no contacts, its scene's joints stand still, and it draws nothing (which is allowed).
BREAKS = {
    "bodies_rest_on_the_table",
    "the_larger_friction_holds",
    "pads_grip_as_both_surfaces_allow",
    "springs_and_catches_hold",
    "mechanisms_lock_and_release",
    "mechanisms_feel_what_the_robot_presses",
    "joints_keep_their_range",
    "gripper_holds_with_force",
    "a_grip_is_let_go_at_once",
    "a_held_object_is_lifted",
    "torques_carry_the_arm_and_its_load",
}


@pytest.fixture(scope="module")
def example() -> dict:
    return runpy.run_path(str(EXAMPLE))


@pytest.mark.parametrize("name", RULES)
def test_the_suite_says_which_rules_it_breaks(name, example):
    if name in BREAKS:
        with pytest.raises(AssertionError):
            RULES[name](example["GhostSimulator"])
    else:
        RULES[name](example["GhostSimulator"])


def test_an_experiment_chooses_it_by_name_and_the_arm_moves_in_it(example):
    from memo_benchmarks.sim import _Eyes, bench_scene
    from memo_franka.description import panda

    from memo_core.arm.control import ArmControl
    from memo_core.arm.simulated_link import SimulatorLink
    from memo_core.interfaces.perception import PerceptionContext

    plugin = FakeEntryPoint("ghost", "my-lab", memo_simulators=example["memo_simulators"])
    chosen = load_experiment(Registry([plugin]), overrides=["simulator.backend=ghost"]).create("simulator")
    with chosen as simulator:
        simulator.build(bench_scene(), panda())
        link = SimulatorLink(simulator, panda())
        eyes = _Eyes()
        control = ArmControl(panda(), link, eyes)
        context = PerceptionContext(np.random.default_rng(0), panda(), link, control.tool_pose, simulator)
        eyes.start(context)
        control.look()
        control.move_to([0.45, -0.2, 0.15], [0.0, 1.0, 0.0, 0.0], None, 0.0, 1.0)
        assert np.allclose(simulator.tool_pose().position, [0.45, -0.2, 0.15], atol=2e-3)
