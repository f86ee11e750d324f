"""What feels keeps its promises: the arm in physics, the point hand of the fakes; wrong controls are rejected."""

from __future__ import annotations

import pytest
from memo_franka.description import panda
from memo_sim_mujoco.simulator import MujocoSimulator

from memo_core.arm.control import ArmControl
from memo_core.arm.simulated_link import SimulatorLink
from memo_core.scene.description import SceneDescription
from memo_core.scene.pose import Pose
from memo_core.skills.contract import top_orientation
from memo_core.testing.fake_control import FakeControl
from memo_core.testing.touch import RULES, WRONG_CONTROLS, check_touch
from tests.support.arms import FixedPerception


@pytest.fixture(scope="module")
def above_the_table():
    """Gives the arm back, free above the table, as often as asked."""
    with MujocoSimulator() as simulator:
        simulator.build(SceneDescription(()), panda())
        control = ArmControl(panda(), SimulatorLink(simulator, panda()), FixedPerception())
        control.move_to([0.5, 0.0, 0.06], top_orientation.call(None), None, 0.0, 1.0)
        control.close_gripper(None)
        start, memory = control._link.checkpoint(), control.state()

        def again() -> ArmControl:
            control._link.restore(start)
            control.restore(memory)
            return control

        yield again


@pytest.mark.sim
@pytest.mark.parametrize("rule", RULES)
def test_the_arm_keeps_the_rule(rule, above_the_table):
    RULES[rule](above_the_table)


def point_hand(kind: type[FakeControl] = FakeControl) -> FakeControl:
    return kind(nodes=(), pose=Pose((0.4, 0.0, 0.08), (0.0, 1.0, 0.0, 0.0)))


@pytest.mark.parametrize("rule", RULES)
def test_the_point_hand_keeps_the_rule(rule):
    RULES[rule](point_hand)


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_rejects_its_wrong_control(rule):
    with pytest.raises(AssertionError):
        RULES[rule](lambda: point_hand(WRONG_CONTROLS[rule]))


def test_the_suite_names_the_broken_promise():
    with pytest.raises(AssertionError, match="pressing_keeps_its_force: ``press`` presses"):
        check_touch(lambda: point_hand(WRONG_CONTROLS["pressing_keeps_its_force"]))
