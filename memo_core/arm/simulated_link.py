"""The link to a simulator: one send is one tick."""

from __future__ import annotations

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.link_checkpoint import LinkCheckpoint
from memo_core.arm.wrench import WrenchEstimate
from memo_core.errors import BackendUnavailable, InvalidArgument, Stopped
from memo_core.interfaces.driver import GripperDriver, RobotDriver
from memo_core.interfaces.link import Health, Link
from memo_core.interfaces.simulator import Simulator
from memo_core.robot.description import GripperDescription, RobotDescription
from memo_core.scene.pose import Array

_MOVED_BY_THE_ARM = "the robot's driver moves this gripper"
_REMEDY = "set robot.gripper_driver, or move the gripper in the link where gripper.included"


class SimulatorLink(Link):
    """Joint-level access to the robot in a built simulator. Its checkpoint holds the simulator's and the targets."""

    real_time = False
    can_restore = True
    feels_force = True

    def __init__(self, simulator: Simulator, description: RobotDescription) -> None:
        super().__init__(description)
        self.simulator = simulator
        self.control_period = simulator.control_period
        self.servo_lag = tuple(joint.kv / joint.kp for joint in description.joints)
        # Bound once: looking them up costs a third of what a send may cost.
        self._stopped = self._stop.is_set
        self._command = simulator.command_joints
        self._tick = simulator.tick
        self._wrench = WrenchEstimate(Kinematics(description), simulator.control_period)
        self._targets: Array = simulator.joint_positions().copy()
        self._command(self._targets)

    def joint_positions(self) -> Array:
        return self.simulator.joint_positions()

    def joint_velocities(self) -> Array:
        return self.simulator.joint_velocities()

    def joint_targets(self) -> Array:
        return self._targets.copy()

    def gripper_width(self) -> float:
        return self.simulator.gripper_width()

    def holding(self) -> bool:
        return self.simulator.gripper_effort() > self.description.gripper.holding_force

    def contact_wrench(self) -> Array:
        simulator = self.simulator
        return self._wrench.at(
            simulator.time,
            simulator.joint_positions(),
            simulator.joint_velocities(),
            simulator.joint_accelerations(),
            simulator.joint_torques(),
        )

    def send(self, targets: Array) -> None:
        if self._stopped():
            raise Stopped("moving")
        self._command(targets)
        self._targets = targets.copy()
        self._tick()

    def halt(self, targets: Array) -> None:
        for row in targets:
            self._command(row)
            self._targets = row.copy()
            self._tick()

    def set_gripper(self, width: float, force: float) -> None:
        if self._stopped():
            raise Stopped("moving the fingers")
        self.commanded_width = width
        self.simulator.command_gripper(width, force)

    def time(self) -> float:
        return self.simulator.time

    def checkpoint(self) -> bytes:
        felt, world = self._wrench.state(), self.simulator.checkpoint()
        return LinkCheckpoint(self._targets, felt, world, opening=self.commanded_width).packed()

    def restore(self, checkpoint: bytes) -> None:
        """Raises ``InvalidArgument`` for bytes that are not a checkpoint of this link."""
        then = LinkCheckpoint.unpacked(checkpoint, self.description)
        try:
            self._wrench.recall(then.felt)
        except ValueError as error:
            raise InvalidArgument("checkpoint", f"is not one of this link ({error})", "bytes of checkpoint()") from None
        self.simulator.restore(then.world)
        self._targets, self.commanded_width = then.targets, then.opening
        self._command(then.targets)


class SimulatedDriver(RobotDriver):
    """The simulator of the experiment moves the robot and its gripper."""

    simulated = True

    def link(self, robot: RobotDescription, gripper: GripperDriver, simulator: Simulator | None = None) -> Link:
        """``simulator`` must be open and built with this robot."""
        if simulator is None:
            raise InvalidArgument("robot.driver", "'simulated' has no simulator", "an experiment with one")
        if not gripper.included:
            raise InvalidArgument("robot.gripper_driver", "a simulated robot brings its gripper", "included")
        return SimulatorLink(simulator, robot)


class IncludedGripper(GripperDriver):
    """No connection of its own: the robot's driver moves the gripper."""

    included = True

    def open(self, gripper: GripperDescription) -> None: ...

    def close(self) -> None: ...

    def health(self) -> Health:
        return Health(False, _MOVED_BY_THE_ARM)

    def stop(self) -> None: ...

    def move(self, width: float, force: float) -> None:
        raise self._refusal()

    def width(self) -> float:
        raise self._refusal()

    def holding(self) -> bool:
        raise self._refusal()

    @staticmethod
    def _refusal() -> BackendUnavailable:
        return BackendUnavailable("gripper_driver", "included", _MOVED_BY_THE_ARM, _REMEDY)
