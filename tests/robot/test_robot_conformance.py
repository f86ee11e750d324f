"""The conformance suite for robot descriptions passes for the Panda and rejects one wrong description a rule."""

from __future__ import annotations

import pytest
from memo_franka.description import panda

from memo_core.testing.robot import RULES, check_robot_description, wrong_robots
from memo_core.testing.simulator_scenes import check_robot

WRONG = wrong_robots(panda())


@pytest.mark.parametrize("name", RULES)
def test_the_panda_keeps_the_rule(name):
    RULES[name](panda)


def test_the_simulator_suites_robot_keeps_the_rules():
    check_robot_description(check_robot)


def test_every_rule_has_a_wrong_robot():
    assert set(WRONG) == set(RULES)


@pytest.mark.parametrize("name", RULES)
def test_the_rule_rejects_a_description_that_breaks_it(name):
    with pytest.raises(AssertionError):
        RULES[name](lambda: WRONG[name])
