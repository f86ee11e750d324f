"""Links keep their promises, and the suite that says so rejects a wrong link for every rule."""

from __future__ import annotations

import pytest
from memo_franka.description import panda
from memo_sim_mujoco.simulator import MujocoSimulator

from memo_core.arm.simulated_link import SimulatorLink
from memo_core.scene.description import SceneDescription
from memo_core.testing.ideal_link import IdealLink
from memo_core.testing.link import RULES
from memo_core.testing.wrong_links import WRONG_LINKS


@pytest.fixture
def make_simulator_link():
    opened = []

    def make() -> SimulatorLink:
        simulator = MujocoSimulator()
        simulator.open()
        opened.append(simulator)
        simulator.build(SceneDescription(()), panda())
        return SimulatorLink(simulator, panda())

    yield make
    for simulator in opened:
        simulator.close()


@pytest.mark.sim
@pytest.mark.parametrize("rule", RULES)
def test_the_simulator_link_conforms(rule, make_simulator_link):
    RULES[rule](make_simulator_link)


@pytest.mark.parametrize("rule", RULES)
def test_the_ideal_link_conforms(rule):
    RULES[rule](lambda: IdealLink(panda()))


@pytest.mark.parametrize("rule", RULES)
def test_every_rule_rejects_its_wrong_link(rule):
    with pytest.raises(AssertionError):
        RULES[rule](lambda: WRONG_LINKS[rule](panda()))
