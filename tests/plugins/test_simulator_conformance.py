"""The conformance suite passes for every simulator here, and rejects one deliberately wrong simulator a rule."""

from __future__ import annotations

import pytest
from memo_sim_mujoco.simulator import MujocoSimulator
from memo_sim_pybullet.simulator import PybulletSimulator

from memo_core.testing.simulator import RULES, check_simulator
from memo_core.testing.wrong_simulators import wrong_simulators

pytestmark = pytest.mark.sim

SIMULATORS = {"mujoco": MujocoSimulator, "pybullet": PybulletSimulator}
WRONG = wrong_simulators(MujocoSimulator)


@pytest.mark.parametrize("simulator", SIMULATORS)
@pytest.mark.parametrize("name", RULES)
def test_the_simulator_keeps_the_rule(name, simulator):
    RULES[name](SIMULATORS[simulator])


def test_every_rule_has_a_wrong_simulator():
    assert set(WRONG) == set(RULES)


@pytest.mark.parametrize("name", RULES)
def test_the_rule_rejects_a_simulator_that_breaks_it(name):
    with pytest.raises(AssertionError):
        RULES[name](WRONG[name])


def test_the_suite_names_the_broken_promise():
    with pytest.raises(AssertionError, match=r"starts_at_home: After build"):
        check_simulator(WRONG["starts_at_home"])
