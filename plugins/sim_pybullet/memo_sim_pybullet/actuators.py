"""Actuation of joints in Bullet: the arm's position servos, the gripper, springs and catches of the scene.

A servo of gains kp, kv pulls with kp (q* - q) - kv dq/dt. Integrated explicitly that is unstable at 2 ms on a light
wrist, so Bullet's velocity motor, an implicit constraint, is used: its target velocity is kp/kv (q* - q), at which the
servo's torque vanishes, and its torque is limited to that of the blocked servo, kp |q* - q|, or the damping torque, kv
|dq/dt|. A free joint lags kv/kp seconds behind its target; a blocked one pushes as hard as the servo; it never
overshoots. Catches of the scene are driven in the same way, because as explicit forces 12 N within 4 mm throw out a
lever of 60 g instead of holding it.
"""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from memo_core.plugin import Array, Latch
from memo_sim_pybullet.world import BulletWorld

# The gripper's servo on the opening, critically damped for two fingers of 0.5 kg.
_FINGER_STIFFNESS = 8000.0  # N/m
_FINGER_DAMPING = 90.0  # N s/m

_TOUCH = 0.002  # m between a cup and what it sucks to it

_CATCH_LAG = 0.02  # s, damping over stiffness of a catch


class RobotDrive:
    """Servos of the arm and the gripper, with gravity compensated. ``push`` is called before every physics step."""

    def __init__(self, client: Any, world: BulletWorld) -> None:
        import pybullet

        self._client, self._body = client, world.robot_body
        self._velocity, self._torque = pybullet.VELOCITY_CONTROL, pybullet.TORQUE_CONTROL
        gripper = world.robot.gripper
        self._cup = world.pads[0][0] if gripper.kind == "vacuum" else None
        self._stroke, self._world_frame = gripper.stroke, pybullet.WORLD_FRAME
        self._arm, self._fingers, self._linkage = world.arm, world.fingers, world.linkage
        self._joints = [*world.arm, *world.fingers]
        self._count = len(world.arm)
        # Bullet numbers degrees of freedom in the order of its links.
        moving = [
            index for index in range(client.getNumJoints(self._body)) if client.getJointInfo(self._body, index)[3] > -1
        ]
        self._order = [moving.index(index) for index in self._joints]
        self._moving = moving
        self._servos = [(joint.kp / joint.kv, joint.kp, joint.kv, joint.effort) for joint in world.robot.joints]
        self.targets = [float(angle) for angle in world.robot.home]
        # Looking a call up in the client costs as much as the call.
        self._read, self._control = client.getJointStates, client.setJointMotorControlArray
        self.opening = 0.0  # m, the gripper's set point
        self.force = world.robot.gripper.max_force
        self.sent: tuple[list[float], list[float], list[float]] = ([], [], [])  # with the last step
        self._before = [0.0] * self._count  # rad/s, before the last step
        self._recalled: list[float] | None = None  # Nm, until the next step
        self._gravity: list[float] = [0.0] * len(self._joints)
        self._still = [0.0] * len(moving)

    def states(self) -> tuple[Array, Array, Array]:
        """Positions, velocities and motor torques of arm and fingers now."""
        states = self._read(self._body, self._joints)
        return (
            np.array([state[0] for state in states]),
            np.array([state[1] for state in states]),
            np.array([state[3] for state in states]),
        )

    def compensate(self) -> None:
        """Compute the torques that carry the robot's own weight; once per tick suffices."""
        states = self._read(self._body, self._moving)
        torques = self._client.calculateInverseDynamics(
            self._body, [state[0] for state in states], self._still, self._still
        )
        self._gravity = [torques[index] for index in self._order]

    def torques(self) -> Array:
        """What the arm's motors did in the last step and carry since then, shape (n,), Nm."""
        return self._motors() + np.array(self._gravity[: self._count])

    def _motors(self) -> Array:
        return self.states()[2][: self._count] if self._recalled is None else np.array(self._recalled)

    def accelerations(self, timestep: float) -> Array:
        """rad/s2 over the last step, shape (n,)."""
        return (self.states()[1][: self._count] - np.array(self._before)) / timestep

    def last_step(self) -> list[list[float]]:
        """State of the last step that Bullet's own file does not contain, as JSON numbers for ``recall``."""
        return [self._before, self._gravity, self._motors().tolist()]

    def recall(self, last_step: list[list[float]]) -> None:
        self._before, self._gravity, self._recalled = last_step

    def push(self) -> None:
        # Plain numbers and no calls: NumPy costs three times as much on seven joints.
        states = self._read(self._body, self._joints)
        wanted, limit, speeds = [], [], []
        for state, target, (rate, kp, kv, effort) in zip(states, self.targets, self._servos, strict=False):
            error, speed = target - state[0], state[1]
            speeds.append(speed)
            wanted.append(rate * error)
            held = kp * error if error > 0.0 else -kp * error
            damped = kv * speed if speed > 0.0 else -kv * speed
            strength = held if held > damped else damped
            limit.append(strength if strength < effort else effort)
        self._before, self._recalled = speeds, None
        if self._linkage is not None:
            self._push_linkage(states[self._count :], wanted, limit)
        elif self._fingers:
            gap = self.opening - sum(state[0] for state in states[self._count :])
            share = gap / len(self._fingers) * _FINGER_STIFFNESS / _FINGER_DAMPING
            strength = min(_FINGER_STIFFNESS * abs(gap), self.force)
            wanted += [share] * len(self._fingers)
            limit += [strength] * len(self._fingers)
        self.sent = (wanted, limit, self._gravity)
        self.send(*self.sent)
        if self._cup is not None and self.opening < 0.5 * self._stroke:
            self._suck(self._cup)

    def _suck(self, cup: int) -> None:
        """Pull what the cup touches to it, and the cup to that, along the contacts' normals."""
        points = [
            one for one in self._client.getContactPoints(bodyA=self._body, linkIndexA=cup) or () if one[8] < _TOUCH
        ]
        outside = [one for one in points if one[2] != self._body]
        for point in outside:
            pull = self.force / len(outside) * np.array(point[7])  # the normal, from the other body to the cup
            apply = self._client.applyExternalForce
            apply(point[2], point[4], pull.tolist(), point[6], self._world_frame)
            apply(self._body, cup, (-pull).tolist(), point[5], self._world_frame)

    def _push_linkage(self, states: Any, wanted: list[float], limit: list[float]) -> None:
        """Fingers on hinges: every joint for itself towards where the opening wants it, with its share of the force."""
        linkage = self._linkage
        assert linkage is not None
        lever = abs(linkage.lever(states[0][0])) / len(states)
        rate = _FINGER_STIFFNESS / _FINGER_DAMPING
        for state, goal, multiplier in zip(states, linkage.positions(self.opening), linkage.multipliers, strict=True):
            error = float(goal) - state[0]
            share = lever / max(abs(multiplier), 1e-6)
            wanted.append(rate * error)
            limit.append(min(_FINGER_STIFFNESS * lever * share * len(states) * abs(error), self.force * share))

    def send(self, velocities: list[float], limits: list[float], torques: list[float]) -> None:
        """Hand one step's commands to the engine."""
        control = self._control
        control(self._body, self._joints, self._velocity, targetVelocities=velocities, forces=limits)
        control(self._body, self._joints, self._torque, forces=torques)


@attrs.define(eq=False)
class _Spring:
    body: int
    index: int
    stiffness: float
    rest: float
    friction: float
    catches: tuple[Latch, ...]


class SceneDrive:
    """Springs and catches. ``push`` is called before every physics step and costs nothing where there are none."""

    def __init__(self, client: Any, world: BulletWorld, latches: tuple[Latch, ...]) -> None:
        import pybullet

        self._client, self._torque, self._velocity = client, pybullet.TORQUE_CONTROL, pybullet.VELOCITY_CONTROL
        self._read, self._control = client.getJointState, client.setJointMotorControl2
        self._joints = world.joints
        self._catches: dict[str, tuple[Latch, ...]] = {}
        for latch in latches:
            self._catches[latch.joint] = (*self._catches.get(latch.joint, ()), latch)
        self._springs = {
            name: _Spring(
                joint.body,
                joint.index,
                joint.spec.stiffness,
                joint.spec.rest,
                joint.spec.friction,
                self._catches.get(name, ()),
            )
            for name, joint in world.joints.items()
        }
        self.sent: list[tuple[int, int, float]] = []  # with the last step
        self.caught: list[tuple[int, int, float, float]] = []
        self._choose()

    def _choose(self) -> None:
        self._active = tuple(one for one in self._springs.values() if one.stiffness or one.catches)

    def spring(self, joint: str, stiffness: float, rest: float) -> None:
        """Raises ``KeyError``."""
        found = self._springs[joint]
        found.stiffness, found.rest = stiffness, rest
        self._choose()

    def limit(self, joint: str, lower: float, upper: float) -> None:
        """Raises ``KeyError``."""
        found = self._springs[joint]
        self._client.changeDynamics(found.body, found.index, jointLowerLimit=lower, jointUpperLimit=upper)

    def push(self) -> None:
        self.sent, self.caught = [], []
        for spring in self._active:
            position, speed = self._read(spring.body, spring.index)[:2]
            if spring.stiffness:
                self.sent.append((spring.body, spring.index, spring.stiffness * (spring.rest - position)))
            if spring.catches:
                wanted, limit = 0.0, spring.friction
                for latch in spring.catches:
                    error = latch.position - position
                    if abs(error) < latch.width:
                        stiffness = 4.0 * latch.effort / latch.width
                        wanted += error / _CATCH_LAG
                        limit += min(stiffness * max(abs(error), _CATCH_LAG * abs(speed)), latch.effort)
                self.caught.append((spring.body, spring.index, wanted, limit))
        self.send(self.sent, self.caught)

    def send(self, efforts: list[tuple[int, int, float]], caught: list[tuple[int, int, float, float]]) -> None:
        """Hand one step's efforts (body, joint, Nm or N) and motors (body, joint, speed wanted, Nm or N at most) to the
        engine."""
        for body, index, effort in efforts:
            self._control(body, index, self._torque, force=effort)
        for body, index, wanted, limit in caught:
            self._control(body, index, self._velocity, targetVelocity=wanted, force=limit)
