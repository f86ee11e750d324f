"""A task's scene behind the double: a cube is picked up through TCP and UDP."""

from __future__ import annotations

import os

import pytest
from memo_franka.testing.scene import TaskCell

from memo_core.config import load_experiment
from memo_core.plugins import Registry
from memo_core.runs.factories import sandbox_of, task_of
from memo_core.runs.sections import SECTIONS

pytest.importorskip("franky", reason="pip install 'plugins/franka[hardware]'")
pytestmark = pytest.mark.filterwarnings("ignore:this computer's kernel is not real-time")

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


def test_a_cube_is_picked_up_through_the_wire():
    experiment = load_experiment(Registry(), None, ("robot=fr3",), SECTIONS, "stack-the-cubes", 0)
    task = task_of(experiment, "stack-the-cubes")
    simulator, robot, perception = (experiment.create(kind) for kind in ("simulator", "robot", "perception"))
    address = f"127.{1 + os.getpid() % 200}.250.1"
    with TaskCell(task, 0, simulator, robot, perception, address) as cell, sandbox_of(experiment) as sandbox:
        execution = cell.run(PICK, sandbox)
        assert execution.succeeded and execution.printed == "True\n", execution.error
        assert not cell.box.arm.violations and cell.box.recoveries == 0
        assert not cell.check().success, "a cube in the hand is no tower"
