"""Tasks through TCP and UDP: the driver ``franka-double``, with the simulator behind the double of the control box."""

from __future__ import annotations

import numpy as np
import pytest
from memo_franka.settings import DoubleSettings
from memo_franka.testing.rehearsal import FrankaDouble, RehearsalLink

from memo_core.arm.link_checkpoint import LinkCheckpoint
from memo_core.arm.simulated_link import IncludedGripper
from memo_core.config import load_experiment
from memo_core.environment.task_verification import run_code, verify_task
from memo_core.errors import InvalidArgument, RobotFault
from memo_core.interfaces.simulator import Simulator
from memo_core.plugins.registry import Registry
from memo_core.runs.factories import environment_of, sandbox_of, task_of
from memo_core.runs.sections import SECTIONS
from memo_core.testing.fake_drivers import FakeGripper

pytest.importorskip("franky", reason="pip install 'plugins/franka[hardware]'")
pytestmark = pytest.mark.usefixtures("real_time")

PICK = """
import math
x, y, z = get_position("red cube")
along = get_axes("red cube")[0]
yaw = (math.atan2(along[1], along[0]) + math.pi / 4) % (math.pi / 2) - math.pi / 4
move_to([x, y, z + 0.12], top_orientation(yaw))
move_straight([x, y, z])
close_gripper()
move_straight([x, y, z + 0.1])
print(is_holding())
"""


def experiment_with(*overrides: str, task: str = "stack-the-cubes"):
    given = ("robot=fr3", "robot.driver=franka-double", *overrides)
    return load_experiment(Registry(), None, given, SECTIONS, task, 0)


@pytest.mark.sim
def test_a_cube_is_picked_up_through_the_wire_and_all_is_restored():
    experiment = experiment_with()
    task = task_of(experiment, "stack-the-cubes")
    with environment_of(experiment, task, 0) as world, sandbox_of(experiment) as sandbox:
        link = world.link
        assert isinstance(link, RehearsalLink)
        before, joints, start = world.checkpoint(), link.joint_positions(), world.time()
        execution = run_code(world, PICK, sandbox)
        assert execution.succeeded and execution.printed == "True\n", execution.error
        assert not link.box.arm.violations and link.box.recoveries == 0
        assert not world.check().success, "a cube in the hand is no tower"
        assert world.time() > start + 5 and link.gripper_width() < 0.06
        with pytest.raises(InvalidArgument, match="joints"):
            link.restore(LinkCheckpoint(np.zeros(6), [0.0] * 6, b"", [0.0] * 9).packed())
        world.restore(before)
        assert np.abs(link.joint_positions() - joints).max() < 1e-3
        assert 0 <= world.time() - start < 1, "more than the reading of states on a busy computer"
        assert not link.holding() and link.gripper_width() > 0.075
        assert not run_code(world, "move_straight([0.4, 0.0, 0.5])", sandbox).error
        assert not link.box.arm.violations


def test_in_the_mode_impedance_the_simulator_ticks_at_a_millisecond_by_itself():
    for given, timestep in (("simulator.timestep=0.002",), 0.001), (("simulator.timestep=0.0004",), 0.001 / 3):
        experiment = experiment_with("robot.driver.mode=impedance", *given)
        simulator = environment_of(experiment, task_of(experiment, "stack-the-cubes"), 0).simulator
        assert simulator.control_period == pytest.approx(0.001) and simulator.timestep == pytest.approx(timestep)
    experiment = experiment_with()
    assert environment_of(experiment, task_of(experiment, "stack-the-cubes"), 0).simulator.control_period == 0.01


class Standing(Simulator):
    """One whose control period is what it is."""

    control_period = 0.01


def test_a_simulator_that_cannot_tick_so_fast_is_refused():
    Standing.__abstractmethods__ = frozenset()
    Standing().shorten_tick(0.01)
    with pytest.raises(InvalidArgument, match="has a control period of 10 ms, and cannot change it"):
        Standing().shorten_tick(0.001)


@pytest.mark.sim
def test_the_fridge_opens_without_much_force():
    """The reference solution turns the handle about the hinge, not about a line that is millimetres from it."""
    experiment = load_experiment(Registry(), None, ("robot=fr3",), SECTIONS, "open-the-fridge", 0)
    task = task_of(experiment, "open-the-fridge")
    with environment_of(experiment, task, 0) as world, sandbox_of(experiment) as sandbox:
        felt = []
        world.simulator.add_tick_listener(lambda: felt.append(np.linalg.norm(world.link.contact_wrench()[:3])))
        execution = run_code(world, task.reference_solution, sandbox)
        assert execution.succeeded and world.check().success, execution.error
        assert max(felt) < 25.0, "it would end in a reflex, or at robot.safety.max_force, on a stiff real arm"


@pytest.mark.sim
def test_too_much_force_on_a_stiff_arm_is_told_with_what_makes_it_give_way():
    pulled = """
grip, out = get_position("fridge handle"), get_axes("fridge door")[0]
out = [-v for v in out] if out[0] > 0 else out
hand = side_orientation([-v for v in out], "horizontal")
open_gripper(0.05)
move_to([g + 0.1 * o for g, o in zip(grip, out)], hand)
follow_path([[grip, hand]])
close_gripper()
follow_path([[[g + 0.2 * o for g, o in zip(grip, out)], hand]])
"""
    # Without so low a limit the handle slips and hits a finger with 80 N, as much as ends a motion by a reflex.
    experiment = experiment_with("robot.safety.max_force=12", task="open-the-fridge")
    with environment_of(experiment, task_of(experiment, "open-the-fridge"), 0) as world:
        with sandbox_of(experiment) as sandbox:
            execution = run_code(world, pulled, sandbox)
        assert "12 N are allowed" in execution.error and "robot.driver.mode=impedance" in execution.error
        assert not world.link.box.arm.violations


@pytest.mark.sim
def test_a_fault_of_the_robot_is_no_outcome_of_the_reference_solution(monkeypatch):
    def pushed(self, targets):
        raise RobotFault("127.0.0.2", "reflex", "it ended the motion by a reflex", "look what happened")

    monkeypatch.setattr(RehearsalLink, "send", pushed)
    experiment = experiment_with()
    task = task_of(experiment, "stack-the-cubes")
    make = lambda seed: environment_of(experiment, task, seed)
    with pytest.raises(RobotFault, match="reflex"):
        list(verify_task(make, lambda: sandbox_of(experiment), [0]))


@pytest.mark.parametrize(
    ("mode", "gripper", "simulated", "told"),
    [
        ("velocity", IncludedGripper, False, "has no simulator"),
        ("velocity", FakeGripper, True, "brings its Hand"),
        ("impedance", IncludedGripper, True, "1 ms"),
    ],
)
def test_what_the_double_cannot_do_is_said_before_anything_is_opened(mode, gripper, simulated, told):
    experiment = experiment_with()
    simulator = experiment.create("simulator") if simulated else None
    with pytest.raises(InvalidArgument, match=told):
        FrankaDouble(DoubleSettings(mode=mode)).link(experiment.create("robot"), gripper(), simulator)
