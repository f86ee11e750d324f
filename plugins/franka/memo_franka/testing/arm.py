"""The arm behind the test double: its commands, its motion, and the limits that end a motion. Time advances in ticks of
1 ms. Commanded joint velocities are integrated to the desired state (q_d, dq_d), after the control box's checks of
position, velocity, acceleration and jerk; a body then follows it. Without a scene the body is ideal except for external
pushes, and accepts torques instead, as a rigid arm without friction; in a scene a simulator moves it (``SceneBody``).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from memo_core.plugin import Array, Kinematics, RobotDescription, Simulator, ToolDynamics, WrenchEstimate
from memo_franka.testing.wire import Error

DT = 0.001  # s
_SLACK = 1.05  # of the limits, for the rounding of differences of differences
_TORQUE_RATE = 1000.0  # Nm/s
_STIFFNESS = 3000.0  # Nm/rad with which the ideal body resists a push


class Body(Protocol):
    """The body that follows the desired state. ``force``: wrench of the environment on the tool, N and Nm, base axes,
    shape (6,)."""

    q: Array
    dq: Array
    force: Array
    takes_torques: bool

    def tick(self, q_d: Array, dq_d: Array) -> None: ...

    def drive(self, torques: Array) -> None:
        """One tick under joint torques (n,), Nm, beyond those that carry the arm's weight; if ``takes_torques``."""


class IdealBody:
    """An arm without a scene. ``push`` is a force on the tool (N), base axes, shape (3,)."""

    takes_torques = True

    def __init__(self, robot: RobotDescription) -> None:
        self._dynamics = ToolDynamics(Kinematics(robot))
        self.q = np.array(robot.home)
        self.dq = np.zeros(len(robot.home))
        self.force = np.zeros(6)
        self.push = np.zeros(3)

    def tick(self, q_d: Array, dq_d: Array) -> None:
        self.force[:3] = self.push
        give = np.zeros_like(q_d)
        if self.push.any():
            give = self._dynamics.jacobian(q_d).T[:, :3] @ self.push / _STIFFNESS
        self.q, self.dq = q_d + give, dq_d.copy()

    def drive(self, torques: Array) -> None:
        self.force[:3] = self.push
        q, dq, still = self.q, self.dq, np.zeros_like(self.q)
        acting = torques + self._dynamics.torques(q, still, still)  # the arm carries its weight by itself
        if self.push.any():
            acting = acting + self._dynamics.jacobian(q).T[:, :3] @ self.push
        self.dq = dq + self._dynamics.accelerations(q, dq, acting) * DT
        self.q = q + self.dq * DT


class SceneBody:
    """The robot in a built simulator, which is ticked once in each of its control periods. One with a control period of
    1 ms takes torques too: its position servos are given the target at which they exert them. Their damping then adds
    kv times 1 ms to each joint's inertia."""

    def __init__(self, simulator: Simulator, robot: RobotDescription) -> None:
        self.simulator = simulator
        self._lag = np.array([joint.kv / joint.kp for joint in robot.joints])
        self._wrench = WrenchEstimate(Kinematics(robot), simulator.control_period)
        self._every = round(simulator.control_period / DT)
        self._stiffness, self._damping = np.array([(joint.kp, joint.kv) for joint in robot.joints]).T
        self.takes_torques = self._every == 1
        self._ticks = 0
        self.q, self.dq = simulator.joint_positions().copy(), simulator.joint_velocities().copy()
        self.force = np.zeros(6)

    def state(self) -> list[float]:
        """What the estimate of the force remembers, for checkpoints."""
        return self._wrench.state()

    def recall(self, felt: list[float]) -> None:
        """Go on from the simulator's present state, with that memory."""
        self._wrench.recall(felt)
        self.q, self.dq = self.simulator.joint_positions().copy(), self.simulator.joint_velocities().copy()

    def tick(self, q_d: Array, dq_d: Array) -> None:
        self._ticks += 1
        if self._ticks % self._every:
            self.q = self.q + self.dq * DT
            return
        self._move(q_d + self._lag * dq_d)

    def drive(self, torques: Array) -> None:
        self._move(self.q + (torques + self._damping * self.dq) / self._stiffness)

    def _move(self, targets: Array) -> None:
        simulator = self.simulator
        simulator.command_joints(targets)
        simulator.tick()
        self.q, self.dq = simulator.joint_positions().copy(), simulator.joint_velocities().copy()
        self.force = self._wrench.at(
            simulator.time, self.q, self.dq, simulator.joint_accelerations(), simulator.joint_torques()
        )


class Arm:
    """The desired state, within the limits of the description. ``violations`` counts commands that exceeded them."""

    def __init__(self, robot: RobotDescription, body: Body) -> None:
        self.body = body
        self.kinematics = Kinematics(robot)
        self.lower, self.upper = self.kinematics.lower, self.kinematics.upper
        self.q_d = body.q.copy()
        self.dq_d = np.zeros_like(self.q_d)
        self.ddq_d = np.zeros_like(self.q_d)
        self.torques = np.zeros_like(self.q_d)  # commanded last
        self.violations: list[Error] = []

    @property
    def resting(self) -> bool:
        return not self.dq_d.any() and not self.ddq_d.any()

    def place(self, q_d: Array) -> None:
        """Stand still at desired positions (n,), to which the body was taken by other means."""
        self.q_d = q_d.copy()
        self.dq_d[:] = self.ddq_d[:] = self.torques[:] = 0.0

    def hold(self) -> None:
        """One tick of standing still."""
        self.dq_d[:] = self.ddq_d[:] = self.torques[:] = 0.0
        self.body.tick(self.q_d, self.dq_d)

    def follow(self, velocity: Array) -> Error | None:
        """One tick at commanded velocities (n,). Returns the violated limit, in which case nothing has moved."""
        k = self.kinematics
        acceleration = (velocity - self.dq_d) / DT
        jerk = (acceleration - self.ddq_d) / DT
        q = self.q_d + velocity * DT
        wrong = None
        if not np.isfinite(velocity).all() or (np.abs(velocity) > k.velocity * _SLACK).any():
            wrong = Error.GENERATOR_VELOCITY_LIMITS
        elif (np.abs(acceleration) > k.acceleration * _SLACK).any():
            wrong = Error.GENERATOR_VELOCITY_DISCONTINUITY
        elif (np.abs(jerk) > k.jerk * _SLACK).any():
            wrong = Error.GENERATOR_ACCELERATION_DISCONTINUITY
        elif ((q < self.lower) | (q > self.upper)).any():
            wrong = Error.GENERATOR_POSITION_LIMITS
        if wrong is not None:
            self.violations.append(wrong)
            return wrong
        self.q_d, self.dq_d, self.ddq_d = q, velocity.copy(), acceleration
        self.body.tick(self.q_d, self.dq_d)
        return None

    def jump(self, positions: Array) -> Error | None:
        """One tick at commanded positions (n,), by the same checks."""
        return self.follow((positions - self.q_d) / DT)

    def drive(self, torques: Array) -> Error | None:
        """One tick under commanded torques (n,). Returns the violated limit, in which case nothing has moved."""
        k = self.kinematics
        effort = np.array([joint.effort for joint in k.description.joints])
        wrong = None
        if not np.isfinite(torques).all() or (np.abs(torques) > effort).any():
            wrong = Error.TORQUE_RANGE
        elif (np.abs(torques - self.torques) > _TORQUE_RATE * DT * _SLACK).any():
            wrong = Error.TORQUE_DISCONTINUITY
        elif (np.abs(self.body.dq) > k.velocity * _SLACK).any():
            wrong = Error.JOINT_VELOCITY
        elif ((self.body.q < self.lower) | (self.body.q > self.upper)).any():
            wrong = Error.JOINT_POSITION_LIMITS
        if wrong is not None:
            self.violations.append(wrong)
            return wrong
        self.torques = torques.copy()
        self.body.drive(torques)
        self.q_d, self.dq_d = self.body.q.copy(), self.body.dq.copy()
        self.ddq_d[:] = 0.0
        return None

    def brake(self) -> None:
        """One tick of decelerating as hard as the limits allow, without their jerk at the end: brakes are abrupt."""
        step = self.kinematics.acceleration * DT
        velocity = self.dq_d - np.clip(self.dq_d, -step, step)
        self.ddq_d = (velocity - self.dq_d) / DT
        self.dq_d = velocity
        self.q_d = self.q_d + velocity * DT
        if not velocity.any():
            self.ddq_d[:] = 0.0
        self.body.tick(self.q_d, self.dq_d)
