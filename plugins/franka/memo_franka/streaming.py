"""How joint targets become motions of a Franka arm: as velocities, or as the reference of a joint impedance.

Both keep the arm safe from a program that stalls: a velocity is valid for 35 ms and is followed by standstill, and a
reference that is not renewed for 60 ms is held. Both times are those of the robot's clock.
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
_HELD_S = 0.06  # after which a reference that nothing follows is held, on the robot's clock
_STILL = 1e-4  # rad and rad/s: nothing is sent to an arm that stands where it should
_SETTLED = 2e-3  # rad/s: a compliant arm is at rest


class Streaming(ABC):
    """Targets of one control period after the other, for one connected robot. Calls may raise the client library's
    exceptions."""

    @abstractmethod
    def send(self, state: Any, before: Array, row: Array, period: float, late: float) -> None:
        """Move on from target ``before`` (n,) to ``row`` (n,), which is due ``period`` (s) after it. ``before`` was due
        ``late`` (s) before ``state``."""

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
    """Short-lived joint velocities: v = f + gain (before + late f - q_d) with f = (row - before) / period. The client
    library keeps acceleration and jerk within their limits, and the control box follows stiffly."""

    def __init__(self, franky: Any, robot: Any, fastest: Array) -> None:
        """``fastest``: greatest speed of each joint (n,), rad/s."""
        self._franky, self._robot, self._fastest = franky, robot, fastest

    def send(self, state: Any, before: Array, row: Array, period: float, late: float) -> None:
        forward = (row - before) / period
        wanted = forward + _GAIN * (before + late * forward - np.array(state.q_d))
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
        self._renewing = threading.Lock()
        self._held, self._sent = np.zeros(len(description.joints)), 0.0  # the last target, and when it was sent

    def send(self, state: Any, before: Array, row: Array, period: float, late: float) -> None:
        velocity = (row - before) / period
        if self._tracker is not None and not self._robot.is_in_control:
            self._tracker = None  # its motion has ended: reading the state tells why
        begins = self._tracker is None
        if begins:
            if not velocity.any():
                return
            self._velocity = np.zeros(len(row))
            self._tracker = self._franky.JointImpedanceTracker(self._robot, stiffness=self._stiffness)
        acceleration = np.clip((velocity - self._velocity) / period, -self._strongest, self._strongest)
        middle = row - velocity * period / 2
        torque = np.asarray(self._robot.model.mass(state)) @ acceleration
        with self._renewing:
            self._velocity, self._held, self._sent = velocity, row.copy(), state.time.to_sec()
            self._tracker.set_target(middle, velocity, torque)
        if begins:
            threading.Thread(target=self._watch, args=(self._tracker,), name="reference watch", daemon=True).start()

    def _watch(self, tracker: Any) -> None:
        """Hold the last target if none follows, until the motion ends. A busy computer keeps the clock of a test double
        waiting, and has its time too."""
        while self._tracker is tracker:
            time.sleep(_HELD_S / 4)
            try:
                if not self._robot.is_in_control:
                    return
                now = self._robot.state.time.to_sec()
            except self._franky.Exception:
                return  # the thread that moves the robot is told
            with self._renewing:
                if self._tracker is tracker and now - self._sent > _HELD_S:
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
