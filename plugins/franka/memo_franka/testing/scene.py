"""A task's scene behind the test double, so that a task runs unchanged through TCP and UDP.

with TaskCell(task, seed, simulator, fr3(), perception, "127.0.0.2") as cell:
    cell.run(task.reference_solution, sandbox)
    print(cell.check())
"""

from __future__ import annotations

from types import TracebackType
from typing import Any, Literal

from memo_core.arm.control import ArmControl
from memo_core.arm.guarded_link import GuardedLink
from memo_core.arm.simulated_link import IncludedGripper
from memo_core.environment.task_environment import generator
from memo_core.errors import InvalidArgument
from memo_core.interfaces.link import Link
from memo_core.interfaces.perception import Perception, PerceptionContext
from memo_core.interfaces.simulator import Simulator
from memo_core.interfaces.task import Outcome, Task
from memo_core.robot.description import RobotDescription
from memo_core.robot.safety import SafetyLimits
from memo_core.sandbox.execution import Execution
from memo_core.sandbox.sandbox import Sandbox
from memo_core.sandbox.workspace import Workspace
from memo_franka.driver import FrankaDriver
from memo_franka.settings import FrankaSettings
from memo_franka.testing.arm import SceneBody
from memo_franka.testing.control_box import ControlBox
from memo_franka.testing.hand import HandDouble, SceneFingers


class _BetweenTicks:
    """A simulator whose methods are called between two ticks of the control box that ticks it."""

    def __init__(self, simulator: Simulator, box: ControlBox) -> None:
        self._simulator = simulator
        self._box = box

    def __getattr__(self, name: str) -> Any:
        with self._box.paused():
            value = getattr(self._simulator, name)
        if not callable(value):
            return value

        def called(*args: Any, **kwargs: Any) -> Any:
            with self._box.paused():
                return value(*args, **kwargs)

        return called


class TaskCell:
    """A simulator ticked by a control box, the driver connected to it, and the parts of a task above the link.

    Contact forces in a simulator have peaks that would end motions at a careful threshold: ``collision_force`` (N)."""

    def __init__(
        self,
        task: Task,
        seed: int,
        simulator: Simulator,
        robot: RobotDescription,
        perception: Perception,
        address: str = "127.0.0.2",
        collision_force: float = 80.0,
        limits: SafetyLimits | None = None,
        mode: Literal["velocity", "impedance"] = "velocity",
    ) -> None:
        """``simulator`` and ``perception`` come unopened; perception may read the simulator. For the mode ``impedance``
        the simulator's control period must be 1 ms. Raises ``InvalidArgument`` otherwise."""
        if mode == "impedance" and simulator.control_period > 0.00101:
            given = f"has a control period of {1000 * simulator.control_period:g} ms"
            expected = "1 ms: simulator.timestep=0.001 simulator.steps_per_tick=1"
            raise InvalidArgument("simulator", given, expected)
        self.task = task
        self.seed = seed
        self.simulator = simulator
        self.robot = robot
        self.perception = perception
        self._limits = limits or SafetyLimits()
        torque = 0.75 * collision_force
        self._settings = FrankaSettings(
            address,
            mode=mode,
            collision_force=collision_force,
            collision_torque=torque,
            clock_timeout_s=10.0,
            hand_deadline_s=60.0,
        )

    def __enter__(self) -> TaskCell:
        address = self._settings.address
        scene = self.task.scene(generator(self.seed, "scene"))
        self.simulator.open()
        self.simulator.build(scene, self.robot)
        self.monitors = {monitor.name: monitor for monitor in self.task.monitors()}
        for monitor in self.monitors.values():
            monitor.reset(self.simulator)
        self.simulator.add_tick_listener(self._update_monitors)
        self.hand = HandDouble(address, SceneFingers(self.simulator))
        self.box = ControlBox(self.robot, address, SceneBody(self.simulator, self.robot), hand=self.hand)
        self.hand.start()
        self.box.start()
        inner = FrankaDriver(self._settings).link(self.robot, IncludedGripper())
        self.link: Link = GuardedLink(inner, self.robot, self._limits)
        try:
            self.link.open()
            self.control = ArmControl(self.link.description, self.link, self.perception)
            self.perception.open()
            seen: Any = _BetweenTicks(self.simulator, self.box)
            rng = generator(self.seed, "perception")
            self.perception.start(PerceptionContext(rng, self.robot, self.link, self.control.tool_pose, seen, scene))
            self._table = self.control.look().table_height
        except BaseException:
            self.close()
            raise
        return self

    def close(self) -> None:
        self.perception.close()
        self.link.close()
        self.box.stop()
        self.hand.stop()
        self.simulator.close()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def run(self, code: str, sandbox: Sandbox) -> Execution:
        """Run robot code as in a run, then let objects come to rest. Raises ``RobotFault``."""
        workspace = Workspace.around(self.robot.reach, self._table)
        execution = sandbox.run(
            code, self.control, stopped=lambda: self.link.stopped, workspace=workspace, clock=self.link.time
        )
        self.control.wait(self.task.settle)
        return execution

    def check(self) -> Outcome:
        """The result of the task's success check for the simulator's state."""
        with self.box.paused():
            return self.task.check(self.simulator, self.monitors)

    def _update_monitors(self) -> None:
        for monitor in self.monitors.values():
            monitor.update(self.simulator)
