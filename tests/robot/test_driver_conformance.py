"""The suites for drivers accept right drivers and reject, rule by rule, a wrong one; the config chooses drivers."""

from __future__ import annotations

import importlib.metadata

import numpy as np
import pytest

from memo_core.arm.simulated_link import IncludedGripper
from memo_core.cli import robot as command
from memo_core.cli.main import main
from memo_core.config import ConfigErrors, load_experiment
from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.backend import Backend
from memo_core.plugins.hooks import hookimpl
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, task_of
from memo_core.runs.sections import SECTIONS
from memo_core.testing import gripper_driver, robot_driver
from memo_core.testing.fake_drivers import FakeDriver, FakeDriverLink, FakeGripper
from memo_core.testing.fake_entry_point import FakeEntryPoint
from memo_core.testing.wrong_drivers import WRONG_DRIVERS, WRONG_GRIPPERS


@pytest.mark.parametrize("rule", robot_driver.RULES)
def test_a_right_robot_driver_conforms_and_a_wrong_one_does_not(rule):
    robot_driver.RULES[rule](FakeDriver)
    with pytest.raises(AssertionError):
        robot_driver.RULES[rule](WRONG_DRIVERS[rule])


def test_a_driver_that_ignores_how_many_joints_the_robot_has_breaks_a_rule_and_one_that_refuses_is_not_tried():
    class Seven(FakeDriverLink):
        def joint_positions(self):
            return np.zeros(7)

    class Ignores(FakeDriver):
        def link(self, robot, gripper, simulator=None):
            return Seven(robot, gripper)

    class Refuses(FakeDriver):
        def link(self, robot, gripper, simulator=None):
            raise InvalidArgument("robot.driver", f"{robot.name!r} has {len(robot.joints)} joints", "an arm of 7")

    rule = robot_driver.RULES["each_joint_has_one_finite_value"]
    with pytest.raises(AssertionError, match=r"fake has 1 joint: one finite number for each.*link\(\) raises"):
        rule(Ignores)
    with pytest.raises(BackendUnavailable, match=r"'fake' has 1 joints; expected an arm of 7.*--robot NAME"):
        rule(Refuses)


@pytest.mark.process
def test_a_driver_is_checked_with_the_arm_that_is_named_and_a_device_moves_only_after_a_yes(monkeypatch, capsys):
    monkeypatch.setattr("memo_core.cli.standard_input.answer_to", lambda question: "n")
    with pytest.raises(SystemExit, match="2"):
        main(["plugins", "check", "robot_driver/double"])
    assert "answers at the default address of double (double), and move it" in capsys.readouterr().err
    counted = []
    rule = lambda make, robot: counted.append(len(robot.joints))
    monkeypatch.setattr(robot_driver, "_RULES", {"counts": rule})
    with pytest.raises(SystemExit, match="0"):
        main(["plugins", "check", "robot_driver/double", "--robot", "ur5e", "--yes"])
    assert counted == [6]
    with pytest.raises(SystemExit, match="2"):
        main(["plugins", "check", "ur5e", "--robot", "ur5e"])
    assert "no robot driver" in capsys.readouterr().err


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


@pytest.mark.parametrize("rule", robot_driver.RULES)
def test_the_double_for_rehearsals_conforms(rule):
    backend = Registry().get("robot_driver", "double")
    robot_driver.RULES[rule](lambda: backend.factory(backend.config()))


def test_the_double_moves_any_robot_from_where_it_is_said_to_stand(capsys):
    start = [0.1, *experiment().create("robot").home[1:]]
    given = ["robot.driver=double", f"robot.start={start}"]
    command.jog(1, 3.0, None, given, True)
    assert "at rest; joints 0.152" in capsys.readouterr().out
    with pytest.raises(InvalidArgument, match=r"robot\.driver\.start.*2 values.*7 joints"):
        command.jog(1, 3.0, None, ["robot.driver=double", "robot.start=[0, 0]"], True)


def test_a_driver_that_has_only_its_own_fingers_may_refuse_others_and_none_at_all_names_the_key():
    class OwnFingers(FakeDriver):
        def link(self, robot, gripper, simulator=None):
            if not gripper.included:
                raise InvalidArgument("robot.gripper_driver", "this arm brings its gripper", "included")
            return super().link(robot, gripper)

    for rule in robot_driver.RULES.values():
        rule(OwnFingers)
    with pytest.raises(BackendUnavailable, match=r"set robot\.gripper_driver, or move the gripper in the link"):
        IncludedGripper().width()


def test_hardware_is_refused_where_only_simulators_work():
    chosen = experiment("robot.driver=wire")
    [task, *_] = chosen.create("suite")
    with pytest.raises(BackendUnavailable, match="wire"):
        environment_of(chosen, task_of(chosen, task.name), 0)
