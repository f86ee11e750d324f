"""The last check of commands to a real robot: limits that no program, plan or bug in the layers above can exceed. It is
between the arm's code and a driver's link. Commands that would leave the workspace, violate a joint's margin or exceed
the speed of the tool or of a joint are refused before they are sent; if the measured force is too large, the arm comes
to rest. Driver and arm are checked too: targets must start where the arm is measured, sends must take as long as they
should, and the arm must follow. This is not a certified safety function.
"""

from __future__ import annotations

import time

import numpy as np

from memo_core.arm.inverse_kinematics import Kinematics
from memo_core.arm.settling import APART, apart, uncounted
from memo_core.arm.trajectory import stopping
from memo_core.errors import BackendUnavailable, MotionError, RobotFault
from memo_core.interfaces.link import Health, Link
from memo_core.robot.description import RobotDescription
from memo_core.robot.safety import SafetyLimits
from memo_core.scene.pose import Array

_ROUNDING = 1.02  # share of the tool's speed that is let pass
_TICKS = 3  # control periods of too much force, or of an arm that does not follow, that end a motion
_CARRIED = 0.2  # rad (m for a slide) between target and measured, beyond the servo's lag: contact explains less
_PACE = 0.9  # share of the control period that a send takes at least, on average
_AHEAD_S = 0.05  # by which sends may be ahead of the clock on the wall
COUNTED = "robot.backend: the description of this arm, and a driver that answers for each of its joints"
STARTS = "its open(), and release() and recover(), must start joint_targets() at the measured positions"


class GuardedLink(Link):
    """A hardware link that enforces ``limits``. ``robot`` is the unrestricted description; planners get
    ``limits.kept_by(robot)``."""

    def __init__(self, inner: Link, robot: RobotDescription, limits: SafetyLimits) -> None:
        """Wrap a link; no device is touched.

        Args:
            inner: the driver's link, not open; it is opened and closed with this one.
            robot: the unrestricted description.
            limits: limits to enforce.

        Raises:
            InvalidArgument: if the limits leave a joint no range, or exclude the home posture.
        """
        super().__init__(limits.kept_by(robot))
        self._inner = inner
        self._limits = limits
        self.real_time = inner.real_time
        self.control_period = inner.control_period
        self.feels_force = inner.feels_force
        self.gives_way = inner.gives_way
        self.servo_lag = inner.servo_lag
        self._stop = inner._stop  # one stop, latched in one place
        self._kinematics = Kinematics(self.description)
        self._units = robot.position_units
        self._lower = np.array([joint.lower for joint in robot.joints]) + limits.joint_margin
        self._upper = np.array([joint.upper for joint in robot.joints]) - limits.joint_margin
        self._low, self._high = np.array(limits.workspace[:3]), np.array(limits.workspace[3:])
        self._step = limits.tool_speed * _ROUNDING * inner.control_period
        self._tare = np.zeros(3)
        self._felt = self._behind = 0
        self._lag = np.array(inner.servo_lag) if len(inner.servo_lag) else np.zeros(len(robot.joints))
        self._before = self._last = self._place = np.zeros(0)
        self._gap: float | None = APART  # allowed between targets and measured positions; None once it has moved
        self._sent_at = self._ahead = 0.0  # s: when the last command was sent, and by how much it was early
        self._hasty, self._hasty_from = 0, 0.0  # commands since the last that was not early, and when that was

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        self._inner.open()
        self._begin()
        self._gap = APART
        if self.feels_force:
            self._tare = self._inner.contact_wrench()[:3]

    def close(self) -> None:
        self._inner.close()

    def health(self) -> Health:
        return self._inner.health()

    def particulars(self) -> dict[str, str]:
        return self._inner.particulars()

    def stop(self) -> None:
        self._inner.stop()

    def release(self) -> None:
        self._inner.release()
        self._begin()
        self._gap = _CARRIED if self._gap is None else self._gap

    def recover(self) -> None:
        self._inner.recover()
        if self._inner.health().ready:  # it is open
            self._begin()
        self._gap = APART

    def outside(self) -> str:
        """How the arm is outside its limits, in one sentence; empty if it is not."""
        joints = self._inner.joint_positions()
        return self._wrong(joints[:, None]) or ""

    def check_ready(self, address: str) -> None:
        """Check everything that must hold before the arm moves for the first time.

        Args:
            address: name of the robot in errors.

        Raises:
            BackendUnavailable: if the robot does not accept commands, its driver does not give one finite number for
                each joint or would start from elsewhere than where the arm is measured, or it is outside its limits.
        """
        health = self.health()
        if not health.ready:
            raise BackendUnavailable("robot", address, health.problem)
        if problem := uncounted(self._inner):
            raise BackendUnavailable("robot", address, problem, COUNTED)
        if problem := apart(self._inner):
            raise BackendUnavailable("robot", address, f"the first command would make it leap: {problem}", STARTS)
        if outside := self.outside():
            remedy = "guide it by hand until it is within hardware.safety"
            raise BackendUnavailable("robot", address, f"it is outside its limits: {outside}", remedy)

    # -- commands ------------------------------------------------------------------------------------------------------
    def check(self, skill: str, targets: Array) -> None:
        """Check a motion against the limits before anything moves; the arguments are those of ``Link.check``.

        Raises:
            MotionError: with cause ``workspace`` if a target is beyond the limits, or too fast to reach.
            RobotFault: if the driver's targets are not where the arm is measured before it first moves.
        """
        self._check_start()
        rows = np.asarray(targets, dtype=float).T
        problem = self._wrong(rows) or self._too_fast(np.column_stack([self._inner.joint_targets(), rows]))
        if problem:
            raise MotionError(skill, f"refused by this robot's safety limits: {problem}", cause="workspace")

    def send(self, targets: Array) -> None:
        """Check a command against the limits and send it; the argument is that of ``Link.send``.

        Raises:
            MotionError: if a limit ends the motion, the arm at rest: cause ``workspace`` for the target, ``force`` for
                the measured force.
            RobotFault: if the driver's targets are not where the arm is measured before it first moves; with the stop
                latched, if sends follow faster than the clock on the wall allows, or the arm does not follow them.
        """
        self._check_start()
        row = np.asarray(targets, dtype=float)
        problem = self._wrong(row[:, None]) or self._too_fast(np.column_stack([self._last, row]))
        if problem:
            self._rest()
            raise MotionError("motion", f"ended by this robot's safety limits: {problem}", cause="workspace")
        self._check_force()
        self._check_following()
        self._check_pace()
        self._inner.send(row)
        self._before, self._last, self._gap = self._last, row, None

    def halt(self, targets: Array) -> None:
        self._inner.halt(targets if self._gap is None else targets[:0])  # what has not moved needs no braking
        self._begin()

    def set_gripper(self, width: float, force: float) -> None:
        self._inner.set_gripper(width, force)

    # -- state ---------------------------------------------------------------------------------------------------------
    def joint_positions(self) -> Array:
        return self._inner.joint_positions()

    def joint_velocities(self) -> Array:
        return self._inner.joint_velocities()

    def joint_targets(self) -> Array:
        return self._inner.joint_targets()

    def gripper_width(self) -> float:
        return self._inner.gripper_width()

    def holding(self) -> bool:
        return self._inner.holding()

    def contact_wrench(self) -> Array:
        return self._inner.contact_wrench()

    def time(self) -> float:
        return self._inner.time()

    def checkpoint(self) -> bytes:
        return self._inner.checkpoint()

    def restore(self, checkpoint: bytes) -> None:
        self._inner.restore(checkpoint)
        self._begin()

    # -- limits --------------------------------------------------------------------------------------------------------
    def _begin(self) -> None:
        self._before = self._last = self._inner.joint_targets()
        self._felt = self._behind = 0
        self._ahead = 0.0

    def _check_start(self) -> None:
        """Refuse the first command of an arm that would have to leap to it."""
        if self._gap is not None and (problem := apart(self._inner, self._gap)):
            told = f"not commanded, since it would leap: {problem}"
            raise RobotFault(self.description.name, "targets", told, STARTS)

    def _check_following(self) -> None:
        """Stop an arm that stays behind its commands: once it follows again, it would leap."""
        if self._gap is not None:  # nothing has been sent yet
            return
        allowed = _CARRIED + self._lag * np.abs(self._last - self._before) / self.control_period
        follows = np.abs(self._inner.joint_positions() - self._last) <= allowed  # False where it is not a number
        self._behind = 0 if follows.all() else self._behind + 1
        if self._behind >= _TICKS:
            told = f"stopped, since the arm does not follow its commands: {apart(self._inner, allowed)}"
            self._inner.stop()
            self._rest()
            remedy = "see what blocks it, or what its controller reports"
            raise RobotFault(self.description.name, "following", told, remedy)

    def _check_pace(self) -> None:
        """Stop an arm whose driver does not wait until the control period has passed: the arm would move faster than
        planned. A simulator may."""
        if not self._inner.real_time:
            return
        now, period = time.monotonic(), self.control_period
        self._ahead = max(0.0, self._ahead - (now - self._sent_at))
        if self._ahead == 0.0:
            self._hasty, self._hasty_from = 0, now
        self._sent_at, self._ahead = now, self._ahead + _PACE * period
        if self._ahead <= _AHEAD_S:
            self._hasty += 1
            return
        self._inner.stop()
        self._rest(paced=True)
        taken = f"{self._hasty} commands in {1000 * (now - self._hasty_from):.0f} ms"
        problem = f"stopped, since its driver took {taken}, where each takes {1000 * period:g} ms"
        raise RobotFault(self.description.name, "pace", problem, "its send() must wait for a deadline")

    def _wrong(self, joints: Array) -> str:
        """The limit that joint positions (n, T) violate; empty if none."""
        if not np.isfinite(joints).all():
            return "a joint target is not a finite number"
        beyond = np.maximum(self._lower[:, None] - joints, joints - self._upper[:, None])
        joint, tick = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        if beyond[joint, tick] > 1e-9:
            name, unit = self.description.joints[joint].name, self._units[joint]
            allowed = f"{self._lower[joint]:.3f} to {self._upper[joint]:.3f} {unit}"
            return f"{name} at {joints[joint, tick]:.3f} {unit}, where {allowed} is allowed"
        _, places = self._kinematics.forward(joints)
        beyond = np.maximum(self._low[:, None] - places, places - self._high[:, None])
        axis, tick = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
        if beyond[axis, tick] > 1e-9:
            allowed = f"{self._low[axis]:g} to {self._high[axis]:g} m"
            return f"the tool at {'xyz'[axis]} = {places[axis, tick]:.3f} m, where {allowed} is allowed"
        return ""

    def _too_fast(self, joints: Array) -> str:
        """The speed limit, of the tool or of a joint, that is violated by moving from one of the joint positions (n, T)
        to the next in one control period; empty if none."""
        _, places = self._kinematics.forward(joints)
        longest = float(np.sqrt((np.diff(places, axis=1) ** 2).sum(axis=0)).max(initial=0.0))
        if longest > self._step:
            speed = longest / self.control_period
            return f"the tool at {speed:.2f} m/s, where {self._limits.tool_speed:g} m/s is allowed"
        fastest = np.abs(np.diff(joints, axis=1)).max(axis=1, initial=0.0) / self.control_period
        for joint, unit, speed in zip(self.description.joints, self._units, fastest, strict=True):
            if speed > _ROUNDING * joint.velocity:
                return f"{joint.name} at {speed:.2f} {unit}/s, where {joint.velocity:g} {unit}/s is allowed"
        return ""

    def _check_force(self) -> None:
        if not self.feels_force:
            return
        felt = float(np.linalg.norm(self._inner.contact_wrench()[:3] - self._tare))
        self._felt = self._felt + 1 if felt > self._limits.max_force else 0
        if self._felt >= _TICKS:
            self._rest()
            problem = f"{felt:.0f} N felt, where {self._limits.max_force:g} N are allowed"
            if self.gives_way:
                problem += f" (a stiff arm; {self.gives_way} makes it give way to doors and other contact)"
            raise MotionError("motion", f"ended by this robot's safety limits: {problem}", cause="force")

    def _rest(self, paced: bool = False) -> None:
        """Decelerate within the joints' limits from the velocity of the last two targets. ``paced``: wait for each
        control period here, since the driver does not."""
        rows = stopping(self._kinematics, self._before, self._last, self.control_period)
        if paced:
            for row in rows[:-1]:
                self._inner.halt(row[None])
                time.sleep(self.control_period)
            rows = rows[-1:]
        self.halt(rows)
