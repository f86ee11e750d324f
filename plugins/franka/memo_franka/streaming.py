"""How joint targets become motions of a Franka arm: as velocities, or as the reference of a joint impedance.

Both keep the arm safe from a program that stalls: a velocity is valid for 35 ms and is followed by standstill, and a
reference that is not renewed for 60 ms is held.
"""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from memo_core.robot.description import RobotDescription
from memo_core.scene.pose import Array
from memo_franka.settings import FrankaSettings

_GAIN = 10.0  # 1/s
_LIFE_S = 0.035  # of a velocity that nothing follows, on the robot's clock
_HELD_S = 0.06  # wall-clock time after which a reference that nothing follows is held
_STILL = 1e-4  # rad and rad/s: nothing is sent to an arm that stands where it should
_SETTLED = 2e-3  # rad/s: a compliant arm is at rest


class Streaming(ABC):
    """Targets of one control period after the other, for one connected robot. Calls may raise the client library's
    exceptions."""

    @abstractmethod
    def send(self, state: Any, before: Array, row: Array, period: float) -> None:
        """Move on from target ``before`` (n,) to ``row`` (n,), which is due in ``period`` (s)."""

    @abstractmethod
    def resting(self, state: Any) -> bool:
        """Whether the arm has come to rest after the last target."""

    @abstractmethod
    def end(self) -> None:
        """Leave the resting arm to its own controller. Idempotent."""

    @abstractmethod
    def abandon(self) -> None:
        """Forget a motion that a fault has ended."""


class VelocityStreaming(Streaming):
    """Short-lived joint velocities: v = (row - before) / period + gain (before - q_d). The client library keeps
    acceleration and jerk within their limits, and the control box follows stiffly."""

    def __init__(self, franky: Any, robot: Any, fastest: Array) -> None:
        """``fastest``: greatest speed of each joint (n,), rad/s."""
        self._franky, self._robot, self._fastest = franky, robot, fastest

    def send(self, state: Any, before: Array, row: Array, period: float) -> None:
        wanted = (row - before) / period + _GAIN * (before - np.array(state.q_d))
        velocity = np.clip(wanted, -self._fastest, self._fastest)
        if np.abs(velocity).max() <= _STILL and np.abs(state.dq_d).max() <= _STILL:
            return
        waypoint, life = self._franky.JointVelocityWaypoint, self._franky.Duration(round(1000 * _LIFE_S))
        motion = self._franky.JointVelocityWaypointMotion(
            [waypoint(velocity, hold_target_duration=life), waypoint(np.zeros(len(velocity)))]
        )
        self._robot.move(motion, asynchronous=True)

    def resting(self, state: Any) -> bool:
        return bool(np.abs(state.dq_d).max() <= _STILL) and not self._robot.is_in_control

    def end(self) -> None: ...

    def abandon(self) -> None: ...


class ImpedanceStreaming(Streaming):
    """A spring and damper at each joint, torque = K (q_r - q) + D (dq_r - dq) + M ddq_r, computed a thousand times a
    second by the client library. The arm gives way to contact, and does not reach its targets under a load.

    The reference q_r is the middle of each control period's segment, since it is held for that period.
    """

    def __init__(self, franky: Any, robot: Any, description: RobotDescription, settings: FrankaSettings) -> None:
        self._franky, self._robot = franky, robot
        self._stiffness = np.array(settings.stiffness)
        self._strongest = np.array([joint.acceleration for joint in description.joints])
        self._tracker: Any = None
        self._velocity = np.zeros(len(description.joints))
        self._renewed = threading.Event()
        self._held: Array | None = None

    def send(self, state: Any, before: Array, row: Array, period: float) -> None:
        velocity = (row - before) / period
        if self._tracker is not None and not self._robot.is_in_control:
            self._tracker = None  # its motion has ended: reading the state tells why
        if self._tracker is None:
            if not velocity.any():
                return
            self._begin()
        acceleration = np.clip((velocity - self._velocity) / period, -self._strongest, self._strongest)
        self._velocity = velocity
        self._held = row.copy()
        middle = row - velocity * period / 2
        self._tracker.set_target(middle, velocity, np.asarray(self._robot.model.mass(state)) @ acceleration)
        self._renewed.set()

    def _begin(self) -> None:
        self._velocity[:] = 0.0
        self._tracker = self._franky.JointImpedanceTracker(self._robot, stiffness=self._stiffness)
        threading.Thread(target=self._watch, args=(self._tracker,), name="reference watch", daemon=True).start()

    def _watch(self, tracker: Any) -> None:
        """Hold the last target if none follows."""
        while self._tracker is tracker:
            if self._renewed.wait(_HELD_S):
                self._renewed.clear()
                time.sleep(_HELD_S / 2)
            elif self._held is not None and self._tracker is tracker:
                tracker.set_target(self._held)

    def resting(self, state: Any) -> bool:
        return bool(np.abs(state.dq).max() <= _SETTLED)

    def end(self) -> None:
        tracker = self._tracker
        self.abandon()
        if tracker is not None and self._robot.is_in_control:
            tracker.stop()

    def abandon(self) -> None:
        self._tracker = None
