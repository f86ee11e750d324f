"""How joint targets become motions of a Franka arm: as velocities, or as the reference of a joint impedance.

Both keep the arm safe from a program that stalls: a velocity is valid for 35 ms of the robot's clock and is followed by
standstill.
"""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import Array, RobotDescription
from memo_franka.settings import FrankaSettings

_GAIN = 10.0  # 1/s
_LIFE_S = 0.035  # of a velocity that nothing follows, on the robot's clock
_TORQUE_RATE = 800.0  # Nm/s, of the 1000 that the control box lets through
_PASSED = 0.386  # of a torque's step in 1 ms, by the client library's filter (first order, 100 Hz)
_TORQUE_STEP = 0.95 / _PASSED  # Nm a tick, that the library lets into its filter: it then leaves with 950 Nm/s
_WATCH_S = 0.004  # wall-clock time between two looks whether a reference was renewed
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


@attrs.frozen(eq=False)
class Coasting:
    """The reference after the last target ``row`` (n,), which was to be reached at ``velocity`` (n,): smoothly to rest
    in ``braking`` (s). It begins so gently that a target which is some milliseconds late does not feel it."""

    row: Array
    velocity: Array
    due: float  # s on the robot's clock, of the target
    braking: float

    def at(self, now: float) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations (n,) at a time of the robot's clock (s)."""
        braked = min(max(now - self.due, 0.0), self.braking)
        if self.braking == 0.0:
            return self.row, self.velocity, self.velocity
        angle = np.pi * braked / self.braking
        position = self.row + self.velocity * (braked + self.braking / np.pi * np.sin(angle)) / 2
        velocity = self.velocity * (1 + np.cos(angle)) / 2
        return position, velocity, -self.velocity * np.pi / (2 * self.braking) * np.sin(angle)


class ImpedanceStreaming(Streaming):
    """A spring and damper at each joint, torque = K (q_r - q) + D (dq_r - dq) + M ddq_r, computed a thousand times a
    second by the client library. The arm gives way to contact, and does not reach its targets under a load.

    The reference q_r is the middle of each control period's segment, since it is held for that period. Where no target
    follows, it goes on and brakes (``Coasting``); how far it is then from the next target is taken back at ``_GAIN``.
    """

    def __init__(self, franky: Any, robot: Any, description: RobotDescription, settings: FrankaSettings) -> None:
        count = len(description.joints)
        self._franky, self._robot = franky, robot
        self._stiffness = np.array(settings.stiffness)
        self._strongest = np.array([joint.acceleration for joint in description.joints])
        self._tracker: Any = None
        self._watched: Any = None  # the newest tracker; after a fault that did not end its motion it still brakes
        self._renewing = threading.Lock()  # of the reference
        self._velocity, self._offset, self._mass = np.zeros(count), np.zeros(count), np.zeros((count, count))
        self._coasting = Coasting(np.zeros(count), np.zeros(count), 0.0, 0.0)
        self._coasts = False

    def send(self, state: Any, before: Array, row: Array, period: float, late: float) -> None:
        velocity = (row - before) / period
        if self._tracker is not None and not self._robot.is_in_control:
            self._tracker = None  # its motion has ended: reading the state tells why
        begins = self._tracker is None
        if begins:
            if not velocity.any():
                return
            self._velocity, self._offset, self._coasts = np.zeros(len(row)), np.zeros(len(row)), False
            self._tracker = self._franky.JointImpedanceTracker(
                self._robot, stiffness=self._stiffness, max_delta_tau=_TORQUE_STEP
            )
        now, mass = state.time.to_sec(), np.asarray(self._robot.model.mass(state))
        with self._renewing:
            if self._coasts:
                position, self._velocity, _ = self._coasting.at(now)
                self._offset, self._coasts = position - (before + late * velocity), False
            acceleration = np.clip((velocity - self._velocity) / period, -self._strongest, self._strongest)
            middle = row - velocity * (period - late) / 2 + self._offset
            self._tracker.set_target(middle, velocity - _GAIN * self._offset, mass @ acceleration)
            self._offset = self._offset * (1 - _GAIN * period)
            slowing, rate = np.abs(velocity) / self._strongest, np.abs(mass @ velocity) / _TORQUE_RATE
            braking = float(max(np.pi / 2 * slowing.max(), np.pi * np.sqrt(rate.max() / 2)))
            self._coasting = Coasting(row + self._offset, velocity, now - late + period, braking)
            self._velocity, self._mass = velocity, mass
        if begins:
            self._watched = self._tracker
            threading.Thread(target=self._watch, args=(self._tracker,), name="reference watch", daemon=True).start()

    def _watch(self, tracker: Any) -> None:
        """Lead the reference on where no target follows, until the motion ends. A busy computer keeps the clock of a
        test double waiting, and has its time too."""
        while self._watched is tracker:
            time.sleep(_WATCH_S)
            try:
                if not self._robot.is_in_control:
                    return
                now = self._robot.state.time.to_sec()
            except (self._franky.Exception, RuntimeError):  # the second where the network is gone
                return  # the thread that moves the robot is told
            with self._renewing:
                if self._watched is tracker and now - self._coasting.due > _WATCH_S:
                    self._coasts = True
                    position, velocity, acceleration = self._coasting.at(now + _WATCH_S / 2)
                    tracker.set_target(position, velocity, self._mass @ acceleration)

    def resting(self, state: Any) -> bool:
        return bool(np.abs(state.dq).max() <= _SETTLED)

    def end(self) -> None:
        tracker = self._tracker
        self.abandon()
        if tracker is not None and self._robot.is_in_control:
            tracker.stop()

    def abandon(self) -> None:
        self._tracker = None
