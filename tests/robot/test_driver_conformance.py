"""The suites for drivers accept right drivers and reject, rule by rule, a wrong one; the config chooses drivers."""

from __future__ import annotations

import importlib.metadata

import pytest

from memo_core.config import ConfigErrors, load_experiment
from memo_core.errors import BackendUnavailable
from memo_core.interfaces.backend import Backend
from memo_core.plugins.hooks import hookimpl
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, task_of
from memo_core.runs.sections import SECTIONS
from memo_core.testing import gripper_driver, robot_driver
from memo_core.testing.fake_drivers import FakeDriver, FakeGripper
from memo_core.testing.fake_entry_point import FakeEntryPoint
from memo_core.testing.wrong_drivers import WRONG_DRIVERS, WRONG_GRIPPERS


@pytest.mark.parametrize("rule", robot_driver.RULES)
def test_a_right_robot_driver_conforms_and_a_wrong_one_does_not(rule):
    robot_driver.RULES[rule](FakeDriver)
    with pytest.raises(AssertionError):
        robot_driver.RULES[rule](WRONG_DRIVERS[rule])


@pytest.mark.parametrize("rule", gripper_driver.RULES)
def test_a_right_gripper_driver_conforms_and_a_wrong_one_does_not(rule):
    gripper_driver.RULES[rule](FakeGripper)
    with pytest.raises(AssertionError):
        gripper_driver.RULES[rule](WRONG_GRIPPERS[rule])


def test_every_rule_has_a_wrong_fake():
    assert set(WRONG_DRIVERS) == set(robot_driver.RULES) and set(WRONG_GRIPPERS) == set(gripper_driver.RULES)


@hookimpl
def memo_robot_drivers():
    return [Backend("robot_driver", "wire", "for tests", lambda settings: FakeDriver())]


def experiment(*overrides: str):
    mine = FakeEntryPoint("p", "d", memo_robot_drivers=memo_robot_drivers)
    registry = Registry([*importlib.metadata.entry_points(group="memo"), mine])
    return load_experiment(registry, None, overrides, SECTIONS)


def test_the_simulator_moves_the_robot_unless_a_config_says_otherwise():
    plain = experiment()
    assert plain.choice("robot_driver").backend.name == "simulated"
    assert plain.choice("gripper_driver").backend.name == "included"
    chosen = experiment("robot.driver=wire")
    assert chosen.choice("robot_driver").backend.name == "wire"
    assert chosen.choice("robot").backend.name == plain.choice("robot").backend.name
    assert chosen.public()["robot.driver.backend"] == "wire"


def test_a_driver_nobody_offers_is_named_with_those_there_are():
    with pytest.raises(ConfigErrors, match=r"robot\.driver.*'wir'.*wire"):
        experiment("robot.driver=wir")
    with pytest.raises(ConfigErrors, match=r"robot\.driver.*port"):
        experiment('robot.driver={"backend": "wire", "port": 1}')


def test_hardware_is_refused_where_only_simulators_work():
    chosen = experiment("robot.driver=wire")
    [task, *_] = chosen.create("suite")
    with pytest.raises(BackendUnavailable, match="wire"):
        environment_of(chosen, task_of(chosen, task.name), 0)
