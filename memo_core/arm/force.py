"""Guarded and force-controlled motions: until contact, and along a path while pressing.

Both follow a joint path that was planned before anything moved. A guarded motion brakes when its force is measured.
Pressing is admittance control in one direction (Seraji, "Adaptive admittance control", ICRA 1994): the path is shifted
along the pressing direction at a speed proportional to the force error, (f - felt) / b, with the damping b chosen from
the combined stiffness of arm and contact; in all other directions the path is unchanged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import attrs
import numpy as np

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.trajectory import stopping
from memo_core.arm.wrench import ToolDynamics
from memo_core.errors import MotionError, Stopped
from memo_core.interfaces.link import Link
from memo_core.scene.pose import Array, Pose

SEARCH_SPEED = 0.01  # m/s of a spiral search
STRAY = 0.03  # m by which pressing may leave the path along its direction
_SEEK_SPEED = 0.015  # m/s towards what is to be pressed on
_TOUCHED = 0.6  # share of the force from which on something is touched
_CORRECTION_SPEED = 0.008  # m/s, most that the force may shift the path by
_BANDWIDTH = 10.0  # 1/s of the force loop
_BEND = 0.004  # m, most that the arm is expected to give way across what it presses on
# Taken at once, what is done against the bending is felt in full a tick later: where a contact sticks, that alternates.
_BEND_SHARE = 0.2  # of its change a tick
_REGAIN, _REGAIN_SPEED = 0.02, 0.01  # m/s2 up to m/s towards what was touched, where contact is lost
_SLOPE_SPEED = 0.02  # m/s, most of it that is learnt
_MEASURABLE = 0.0003  # m of travel from which on a contact's stiffness is measured
_SOFTEST = 300.0  # N/m
_LOST = 0.2  # share of the force below which contact counts as lost
_PATIENCE = 0.4  # s of lost contact that end a motion
_SETTLE = 0.3  # s in which a force is reached after contact
_NULLSPACE = 0.2  # share of the way back to the planned posture a tick
_OVERLOAD_TICKS = 3  # control periods of too much force beyond which a motion ends
_EASE_TICKS = 12  # control periods in which the targets go to where the arm is


@attrs.frozen(eq=False)
class Pressed:
    """The result of pressing along a path."""

    mean_force: float  # N
    offset: float  # m along the direction that the path was shifted by at its end
    deepest: float  # m, most it was shifted by
    stopped_early: bool


class ForceMotion:
    """Executes planned joint paths (T, n) under force control. ``limit`` is the largest allowed force (N)."""

    def __init__(self, link: Link, kinematics: Kinematics, limit: float) -> None:
        self._link = link
        self._kinematics = kinematics
        self._dynamics = ToolDynamics(kinematics)
        self._limit = limit
        self._period = link.control_period
        self._lag = np.array(link.servo_lag) if len(link.servo_lag) else np.zeros(kinematics.count)
        self._gains = np.array([joint.kp for joint in link.description.joints])
        self._fastest = kinematics.velocity * self._period
        self._last = self._before = np.zeros(kinematics.count)

    def wrench(self) -> Array:
        """The wrench measured now: force (N), then torque (Nm), at the tool, base axes, shape (6,)."""
        return self._link.contact_wrench()

    # -- until something is felt -------------------------------------------------------------------------------------
    def until_contact(self, skill: str, targets: Array, direction: Array, force: float, bias: Array) -> bool:
        """Follow targets (T, n) until ``force`` (N) is measured against a unit direction, come to rest there and reduce
        the pressure to that force. False if the path ended without contact. Raises ``MotionError`` (``force``) and
        ``Stopped``."""
        self._begin()
        try:
            for row in targets:
                self._send(row, row - self._last)
                felt = (self.wrench() - bias)[:3]
                if -felt @ direction >= force:
                    break
                if np.linalg.norm(felt) > self._limit:
                    self._ease()
                    raise self._overloaded(skill, felt)
            else:
                return False
            # The servo has run ahead of the arm by what it lags: ease off from where the arm is.
            self._ease()
            loop = _Loop(direction, force, bias, self._stiffness(direction))
            self._along(skill, np.repeat(self._last[None], round(_SETTLE / self._period), axis=0), loop, None)
        except Stopped:
            self._brake(skill)
        return True

    # -- along a path ------------------------------------------------------------------------------------------------
    def along(
        self,
        skill: str,
        targets: Array,
        direction: Array,
        force: float,
        bias: Array,
        until: Callable[[float], bool] | None = None,
    ) -> Pressed:
        """Press with ``force`` (N) in a unit direction while following targets (T, n). The hand first moves at most
        ``STRAY`` along the direction until it touches something. ``until`` is called every tick with the shift (m)
        since then and can end the motion early. Raises ``MotionError`` (``no-contact``, ``force``) and ``Stopped``."""
        self._begin()
        loop = _Loop(direction, force, bias, self._stiffness(direction))
        try:
            self._seek(skill, loop)
            settle = np.repeat(targets[:1], round(_SETTLE / self._period), axis=0)
            self._along(skill, settle, loop, None)
            loop.restart()
            early = self._along(skill, targets, loop, until)
        except Stopped:
            self._brake(skill)
        return Pressed(loop.mean, loop.offset - loop.surface, loop.deepest - loop.surface, early)

    def _seek(self, skill: str, loop: _Loop) -> None:
        """Move along the direction until contact; the rate at which the force then rises gives the stiffness."""
        start = self._last.copy()
        first: tuple[float, float] | None = None  # felt, and how far the hand was along the direction
        while (felt := loop.felt(self.wrench())) < _TOUCHED * loop.force:
            if felt > 0.15 * loop.force and first is None:
                first = (felt, self._reached(loop.direction))
            if loop.offset > STRAY:
                raise MotionError(
                    skill,
                    f"nothing to press against within {100 * STRAY:.0f} cm: {max(felt, 0.0):.1f} N were felt of "
                    f"{loop.force:.1f} N",
                    cause="no-contact",
                )
            loop.offset += _SEEK_SPEED * self._period
            self._shifted(start, np.zeros_like(start), loop)
        if first is not None and (gone := self._reached(loop.direction) - first[1]) > _MEASURABLE:
            soft = max((felt - first[0]) / gone, _SOFTEST)
            loop.stiffness = 1 / (1 / loop.stiffness + 1 / soft)

    def _stiffness(self, direction: Array) -> float:
        """Stiffness (N/m) of the arm's position servos along a direction, as measured against a rigid surface."""
        along = direction @ self._dynamics.jacobian(self._last)[:3]
        return 1 / max(float(along @ (along / self._gains)), 1e-6)

    def _bend(self, wrench: Array, loop: _Loop) -> float:
        """Deflection (m) of the arm's servos along the direction under all measured forces except the pressing force.
        Friction pulls a sliding hand into the surface or lifts it off, which causes chatter; compensating for this
        deflection prevents it."""
        jacobian = self._dynamics.jacobian(self._last)
        aside = wrench - loop.bias
        aside[:3] -= (aside[:3] @ loop.direction) * loop.direction
        give = loop.direction @ jacobian[:3] @ ((jacobian.T @ aside) / self._gains)
        return float(np.clip(give, -_BEND, _BEND))

    def _reached(self, direction: Array) -> float:
        return float(self._dynamics.placement(self._link.joint_positions())[1] @ direction)

    def _along(self, skill: str, targets: Array, loop: _Loop, until: Callable[[float], bool] | None) -> bool:
        """Whether ``until`` ended the motion. A search stops moving sideways while the hand drops, so that it does not
        pass the hole."""
        lost = over = number = 0
        before = targets[0]
        while number < len(targets):
            wrench = self.wrench()
            felt = loop.felt(wrench)
            free = felt < _LOST * loop.force
            falling = free and until is not None
            row = before if falling else targets[number]
            number += not falling
            loop.step(felt, self._period)
            loop.bend += _BEND_SHARE * (self._bend(wrench, loop) - loop.bend)
            self._shifted(row, row - before, loop)
            before = row
            over = over + 1 if np.linalg.norm((wrench - loop.bias)[:3]) > self._limit else 0
            lost = lost + 1 if free and not falling else 0
            if over > _OVERLOAD_TICKS:
                self._ease()
                raise self._overloaded(skill, (wrench - loop.bias)[:3])
            if lost * self._period > _PATIENCE or loop.offset - loop.surface > STRAY:
                self._ease()
                problem = f"contact was lost: {max(felt, 0.0):.1f} N were felt of {loop.force:.1f} N"
                raise MotionError(skill, problem, cause="no-contact")
            if until is not None and until(loop.offset - loop.surface):
                self._rest()
                return True
        return False

    # -- commands ----------------------------------------------------------------------------------------------------
    def _begin(self) -> None:
        self._last = self._before = self._link.joint_targets()

    def _send(self, joints: Array, lead: Array) -> None:
        """Command joints (n,), with feed-forward of the servo's lag times ``lead`` (n,), their planned change in this
        tick."""
        self._link.send(joints + lead / self._period * self._lag)
        self._before, self._last = self._last, joints

    def _shifted(self, row: Array, change: Array, loop: _Loop) -> None:
        """One tick of a planned row (n,) shifted by the loop's offset: a Newton step of the inverse kinematics."""
        rotation, position = self._dynamics.placement(row)
        joints = self._last + change
        turned, placed = self._dynamics.placement(joints)
        error = np.empty(6)
        error[:3] = position + (loop.offset - loop.bend) * loop.direction - placed
        error[3:] = 0.5 * np.cross(turned.T, rotation.T).sum(axis=0)
        jacobian = self._dynamics.jacobian(joints)
        square = jacobian @ jacobian.T + 1e-6 * np.eye(6)
        posture = _NULLSPACE * (row - joints)
        step = posture + jacobian.T @ np.linalg.solve(square, error - jacobian @ posture)
        wanted = np.clip(joints + step, self._kinematics.lower, self._kinematics.upper)
        self._send(self._last + np.clip(wanted - self._last, -self._fastest, self._fastest), change)

    def _rest(self) -> None:
        for row in stopping(self._kinematics, self._before, self._last, self._period):
            self._send(row, np.zeros_like(row))

    def _ease(self) -> None:
        """Come to rest without pressing: the final targets are the arm's actual position."""
        self._rest()
        ahead = self._last
        here = self._link.joint_positions()
        for part in np.linspace(0.0, 1.0, _EASE_TICKS + 1)[1:]:
            share = part**3 * (10 - 15 * part + 6 * part**2)  # least jerk
            self._send(ahead + share * (here - ahead), np.zeros_like(here))

    def _overloaded(self, skill: str, felt: Array) -> MotionError:
        most = f"{self._limit:.0f} N this arm may press with"
        return MotionError(skill, f"{np.linalg.norm(felt):.0f} N were felt, more than the {most}", cause="force")

    def _brake(self, skill: str) -> None:
        self._link.halt(stopping(self._kinematics, self._before, self._last, self._period))
        raise Stopped(skill) from None


@attrs.define
class _Loop:
    """State of the force loop: ``offset`` (m) along ``direction``, ``surface`` where contact was found."""

    direction: Array
    force: float  # N wanted
    bias: Array  # wrench (6,) felt while free
    stiffness: float  # N/m of arm and contact together
    offset: float = 0.0
    bend: float = 0.0  # m that the arm gives way along the direction by what it feels across it
    lost: float = 0.0  # s without contact
    slope: float = 0.0  # m/s at which the surface recedes, as learnt
    surface: float = 0.0
    deepest: float = 0.0
    total: float = 0.0
    ticks: int = 0

    def felt(self, wrench: Array) -> float:
        """Pressing force (N): the measured force against the direction."""
        return float(-(wrench - self.bias)[:3] @ self.direction)

    def step(self, felt: float, period: float) -> None:
        missing = (self.force - felt) * _BANDWIDTH / self.stiffness
        self.lost = self.lost + period if felt < _LOST * self.force else 0.0
        # Slowly at first: to come back to something hard at speed is a knock that throws the hand off again.
        missing = max(missing, min(_REGAIN * self.lost, _REGAIN_SPEED)) if self.lost else missing
        # The integral follows a surface not parallel to the path, slowly enough not to overshoot.
        slope = float(np.clip(self.slope + missing * _BANDWIDTH / 8 * period, -_SLOPE_SPEED, _SLOPE_SPEED))
        if abs(missing) < _CORRECTION_SPEED:
            self.slope = slope
        self.offset += float(np.clip(missing, -_CORRECTION_SPEED, _CORRECTION_SPEED) + self.slope) * period
        self.deepest = max(self.deepest, self.offset)
        self.total += felt
        self.ticks += 1

    def restart(self) -> None:
        self.surface = self.deepest = self.offset
        self.total, self.ticks = 0.0, 0

    @property
    def mean(self) -> float:
        return self.total / max(self.ticks, 1)


def spiral(centre: Pose, direction: Sequence[float], radius: float, pitch: float) -> list[Array]:
    """Points (3,) on an Archimedean spiral about a pose's position, across ``direction``, out to ``radius`` (m), and
    the centre again at its end."""
    along = np.asarray(direction)
    side = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    side /= np.linalg.norm(side)
    other = np.cross(along, side)
    points = []
    angle = 0.0
    while pitch * angle / (2 * np.pi) < radius:
        r = pitch * angle / (2 * np.pi)
        points.append(np.asarray(centre.position) + r * (np.cos(angle) * side + np.sin(angle) * other))
        angle += min(0.5, 0.001 / max(r, 0.0005))
    return [*points[1:], np.asarray(centre.position)]
