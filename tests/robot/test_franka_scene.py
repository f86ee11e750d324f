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
from memo_core.plugins import Registry
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


def experiment_with(*overrides: str):
    given = ("robot=fr3", "robot.driver=franka-double", *overrides)
    return load_experiment(Registry(), None, given, SECTIONS, "stack-the-cubes", 0)


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


def test_a_fault_of_the_robot_is_a_failed_trial_of_the_sweep(monkeypatch):
    def pushed(self, targets):
        raise RobotFault("127.0.0.2", "reflex", "it ended the motion by a reflex", "look what happened")

    monkeypatch.setattr(RehearsalLink, "send", pushed)
    experiment = experiment_with()
    task = task_of(experiment, "stack-the-cubes")
    make = lambda seed: environment_of(experiment, task, seed)
    [found] = verify_task(make, lambda: sandbox_of(experiment), [0])
    assert not found.reference.success and "reflex" in found.error


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
