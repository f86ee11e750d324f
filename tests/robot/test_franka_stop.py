"""Ctrl-C and generated code at the wire: signals, sandbox, arm and driver as in a run, on the clock of the double."""

from __future__ import annotations

import os
import signal
import threading

import numpy as np
import pytest

from memo_core.arm.control import ArmControl
from memo_core.errors import Stopped
from memo_core.process.stop_switch import StopSwitch
from memo_core.robot.safety import SafetyLimits
from memo_core.runs.signal_handling import Supervisor
from memo_core.sandbox.sandbox import Sandbox
from memo_core.skills.contract import BUILTIN_SKILLS
from memo_core.skills.skill import skill_library
from tests.support.arms import FixedPerception
from tests.support.franka_cell import ROBOT, Cell, running_cell, until

pytest.importorskip("franky", reason="pip install 'plugins/franka[hardware]'")
pytestmark = [
    pytest.mark.filterwarnings("ignore:this computer's kernel is not real-time"),
    pytest.mark.usefixtures("real_time"),
    pytest.mark.process,
]

LIMITS = SafetyLimits()
STOP_MS = 50  # from the signal to the last command that continues the motion
AWAY = "move_to([0.45, 0.45, 0.5])"


@pytest.fixture
def cell():
    with running_cell() as cell:
        yield cell


@pytest.fixture
def sandbox():
    with Sandbox(skill_library(BUILTIN_SKILLS)) as sandbox:
        yield sandbox


def controlled(cell: Cell, mode: str = "velocity") -> ArmControl:
    link = cell.guarded(LIMITS, mode=mode)
    return ArmControl(link.description, link, FixedPerception())


def watched(cell: Cell) -> list[tuple[int, np.ndarray]]:
    """The box's clock and the joints' velocities (rad/s) in each of its ticks."""
    body, ticks = cell.box.body, []
    tick, drive = body.tick, body.drive

    def noted(move):
        def moved(*given):
            move(*given)
            ticks.append((cell.box.ticks, body.dq.copy()))

        return moved

    body.tick, body.drive = noted(tick), noted(drive)
    return ticks


@pytest.mark.parametrize("mode", ["velocity", "impedance"])
def test_ctrl_c_in_motion_brakes_at_once_within_the_limits_and_keeps_the_grip(cell, sandbox, mode, record_property):
    cell.hand.fingers.thing = 0.04
    control, ticks = controlled(cell, mode), watched(cell)
    link, stop = control._link, StopSwitch()
    supervisor, pressed = Supervisor(stop), []

    def press() -> None:
        """The robot's clock waits until the signal has been handled."""
        os.kill(os.getpid(), signal.SIGINT)
        until(lambda: link.stopped)

    def person() -> None:
        assert until(lambda: cell.box._moment.speed >= 0.2)
        cell.box._inject(press)
        pressed.append(cell.box.disturbed)

    def work() -> None:
        control.close_gripper(None)
        assert control.holding()
        threading.Thread(target=person, daemon=True).start()
        code = f"{AWAY}\n{AWAY.replace('0.45, 0.45', '0.45, -0.45')}"
        execution = sandbox.run(code, control, stopped=lambda: link.stopped)
        assert execution.ended == "stopped", execution.error

    with stop.waking(link.stop):
        supervisor.run(work)
    assert stop.pressed and link.stopped
    since = pressed[0]
    after = [velocity for tick, velocity in ticks if tick >= since.tick]
    speeds = np.array([velocity @ after[0] for velocity in after]) / np.linalg.norm(after[0])
    continued = int(np.flatnonzero(speeds >= 0.99 * speeds.max())[-1])
    record_property("continued_ms", continued)
    record_property("rest_ms", int(np.flatnonzero(np.abs(speeds) > 1e-3)[-1]) + 1)
    assert since.speed > 0.2 and continued <= STOP_MS
    assert np.abs(after[-1]).max() < 2e-3 and not cell.box.arm.violations and cell.box.mode.name != "REFLEX"
    assert link.holding() and abs(link.gripper_width() - 0.04) < 0.001
    with pytest.raises(Stopped):
        control.move_to([0.45, 0.0, 0.5], None, None, 0.7, 1.0)


def test_code_that_asks_for_2_metres_a_second_moves_at_the_limit_and_is_told_so(cell, sandbox):
    control, ticks = controlled(cell), watched(cell)
    execution = sandbox.run("move_to([0.45, 0.3, 0.5], speed=2)", control, stopped=lambda: False)
    assert execution.succeeded, execution.error
    assert "2 is faster than this robot may move; it moves at its limit" in execution.printed
    positions = cell.box.arm.kinematics.forward
    assert not cell.box.arm.violations and len(ticks) > 1000
    joints = np.array(ROBOT.home)[:, None] + np.cumsum([velocity for _, velocity in ticks], axis=0).T * 0.001
    places = positions(joints)[1]
    fastest = np.linalg.norm(np.diff(places, axis=1), axis=0).max() / 0.001
    assert 0.7 * LIMITS.tool_speed < fastest <= 1.02 * LIMITS.tool_speed
