"""Links keep their promises, and the suite that says so rejects a wrong link for every rule."""

from __future__ import annotations

import numpy as np
import pytest
from memo_franka.description import panda
from memo_sim_mujoco.simulator import MujocoSimulator

from memo_core.arm.simulated_link import SimulatorLink
from memo_core.errors import InvalidArgument
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


@pytest.mark.sim
def test_targets_that_are_refused_do_not_become_the_last_ones(make_simulator_link):
    link = make_simulator_link()
    before = link.joint_targets()
    with pytest.raises(InvalidArgument):
        link.send(np.full(len(before), np.nan))
    with pytest.raises(InvalidArgument):
        link.halt(np.full((1, len(before)), np.nan))
    assert np.array_equal(link.joint_targets(), before)
