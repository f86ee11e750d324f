"""The contact wrench at the tool, estimated from joint torques.

The generalised force of contact is what the rigid-body equation leaves over, tau_ext = M(q) ddq + C(q, dq) dq + g(q) -
tau with tau the actuators' torques, and the wrench F at the tool its least-squares solution of J^T F = tau_ext (survey:
Haddadin, De Luca, Albu-Schäffer, "Robot Collisions", T-RO 2017). Accelerations must be those of the moment at which the
torques are read: a servo answers each new target within a few milliseconds, so that differences of velocities over a
control period say something else (off by 72 N s/m times the hand's speed for a stiff arm, measured).
"""

from __future__ import annotations

import numpy as np

from memo_core.arm.forward_kinematics import tool_link_frame
from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.scene.pose import Array

_FILTER = 0.01  # s, time constant
_DAMPING = 1e-6  # keeps the solution finite where the arm is singular


class ToolDynamics:
    """Tool placement, Jacobian and inverse dynamics of one configuration, quick enough for every control period."""

    def __init__(self, kinematics: Kinematics) -> None:
        """Prepare the dynamics; armatures are those of the robot's description.

        Args:
            kinematics: kinematics of the arm; its model is copied.
        """
        import pinocchio as pin

        description = kinematics.description
        self._pin = pin
        self._model = model = pin.Model(kinematics.model)
        joints = [model.joints[number] for number in kinematics.joint_ids]
        self._places = np.array([joint.idx_q for joint in joints], dtype=np.intp)
        self._speeds = np.array([joint.idx_v for joint in joints], dtype=np.intp)
        for joint, described in zip(joints, description.joints, strict=True):
            model.armature[joint.idx_v] = described.armature
        frame = tool_link_frame(model, description)
        offset = pin.SE3(description.tool_offset.rotation, np.array(description.tool_offset.position))
        placement = frame.placement * offset
        self._frame = model.addFrame(pin.Frame("memo/tool", frame.parentJoint, placement, pin.FrameType.OP_FRAME))
        self._data = model.createData()
        self._neutral = pin.neutral(model)

    def jacobian(self, joints: Array) -> Array:
        """Jacobian of the tool's origin.

        Args:
            joints: joint positions (n,), rad (m for a slide).

        Returns:
            Linear over angular rows in base axes, shape (6, n).
        """
        pin = self._pin
        q = self._full(joints)
        whole = pin.computeFrameJacobian(
            self._model, self._data, q, self._frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        return np.asarray(whole)[:, self._speeds]

    def placement(self, joints: Array) -> tuple[Array, Array]:
        """Pose of the tool in the base frame.

        Args:
            joints: joint positions (n,), rad (m for a slide).

        Returns:
            Rotation matrix (3, 3) and position (3,), m.
        """
        pin = self._pin
        pin.framesForwardKinematics(self._model, self._data, self._full(joints))
        found = self._data.oMf[self._frame]
        return found.rotation.copy(), found.translation.copy()

    def torques(self, joints: Array, velocities: Array, accelerations: Array) -> Array:
        """Torques with which the free arm makes a motion, gravity included.

        Args:
            joints: joint positions (n,), rad (m for a slide).
            velocities: joint velocities (n,), rad/s.
            accelerations: joint accelerations (n,), rad/s2.

        Returns:
            Joint torques (n,), Nm (N for a slide).
        """
        speed, change = np.zeros(self._model.nv), np.zeros(self._model.nv)
        speed[self._speeds], change[self._speeds] = velocities, accelerations
        return self._pin.rnea(self._model, self._data, self._full(joints), speed, change)[self._speeds]

    def accelerations(self, joints: Array, velocities: Array, torques: Array) -> Array:
        """Accelerations of the free arm under torques, the fingers held.

        Args:
            joints: joint positions (n,), rad (m for a slide).
            velocities: joint velocities (n,), rad/s.
            torques: torques of the actuators (n,), Nm (N for a slide).

        Returns:
            Joint accelerations (n,), rad/s2.
        """
        mass = self._pin.crba(self._model, self._data, self._full(joints))[np.ix_(self._speeds, self._speeds)]
        mass = np.triu(mass) + np.triu(mass, 1).T
        rest = self.torques(joints, velocities, np.zeros_like(joints))
        return np.linalg.solve(mass, torques - rest)

    def _full(self, joints: Array) -> Array:
        q = self._neutral.copy()
        q[self._places] = joints
        return q


class WrenchEstimate:
    """The estimate over time. ``state`` and ``recall`` make it part of a checkpoint."""

    def __init__(self, kinematics: Kinematics, period: float) -> None:
        """Start without a measurement.

        Args:
            kinematics: kinematics of the arm.
            period: time between two calls of ``at`` while the arm is in use (s), its control period.
        """
        self._dynamics = ToolDynamics(kinematics)
        self._period = period
        self._share = 1.0 - np.exp(-period / _FILTER)
        self._time: float | None = None
        self._wrench = np.zeros(6)

    def at(self, time: float, joints: Array, velocities: Array, accelerations: Array, torques: Array) -> Array:
        """Estimate the contact wrench from one measurement, filtered over time.

        A call within half a period of the last one returns that one's estimate; after a pause the filter starts anew.

        Args:
            time: time of the measurement (s).
            joints: joint positions (n,), rad (m for a slide).
            velocities: joint velocities (n,), rad/s.
            accelerations: joint accelerations (n,), rad/s2, of the moment at which the torques are read.
            torques: torques of the actuators (n,), Nm (N for a slide).

        Returns:
            Force (N), then torque (Nm), that the environment exerts on the tool at its centre, base axes, shape (6,).
                The torque is 0 for an arm with fewer than six joints.
        """
        since = np.inf if self._time is None else time - self._time
        if 0.0 <= since < self._period / 2:
            return self._wrench.copy()
        left = self._dynamics.torques(joints, velocities, accelerations) - torques
        jacobian = self._dynamics.jacobian(joints)
        if len(joints) < 6:
            jacobian = jacobian[:3]
        square = jacobian @ jacobian.T
        raw = np.zeros(6)
        raw[: len(jacobian)] = np.linalg.solve(square + _DAMPING * np.eye(len(square)), jacobian @ left)
        running = 0.0 < since < 1.5 * self._period
        self._wrench = self._wrench + self._share * (raw - self._wrench) if running else raw
        self._time = time
        return self._wrench.copy()

    def state(self) -> list[float]:
        """JSON numbers that ``recall`` takes back."""
        return [*self._wrench.tolist(), *([] if self._time is None else [self._time])]

    def recall(self, state: list[float]) -> None:
        """Restore an estimate.

        Args:
            state: result of ``state``.

        Raises:
            ValueError: if the count of numbers is wrong.
        """
        if len(state) not in (6, 7):
            raise ValueError(f"{len(state)} numbers")
        self._wrench = np.array(state[:6])
        self._time = state[6] if len(state) > 6 else None
