"""The driver of a real Franka arm, over franky-control: position targets streamed in one of two modes (``streaming``),
velocity or impedance. The link is paced by the robot's clock, never by wall-clock time.
"""

from __future__ import annotations

import contextlib
import time
import warnings
from importlib.metadata import version
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import (
    Array,
    BackendUnavailable,
    GripperDriver,
    Health,
    InvalidArgument,
    Link,
    RobotDescription,
    RobotDriver,
    RobotFault,
    Simulator,
)
from memo_franka.faults import fault, fault_of_error, fault_of_state
from memo_franka.hand import FrankaHand, import_franky
from memo_franka.scheduling import Scheduling
from memo_franka.settings import FrankaSettings, HandSettings
from memo_franka.streaming import ImpedanceStreaming, Streaming, VelocityStreaming

_SHARE = 0.95  # of the limits of acceleration and jerk that is used
_REST_S = 2.0  # on the robot's clock, in which a halted arm comes to rest
_POLL_S = 0.0005
_ENDED_S = 1.0  # wall-clock time in which a motion's thread ends after a fault; one without a fault goes on
_TOLD_S = 0.1  # wall-clock time after a motion's end in which the robot's state tells why
_TARE_STATES = 20


class FrankaLink(Link):
    """One arm with its gripper. One thread moves it; ``stop`` and ``health`` may come from any."""

    feels_force = True

    def __init__(self, settings: FrankaSettings, robot: RobotDescription, gripper: GripperDriver) -> None:
        super().__init__(robot)
        self._settings = settings
        self.called = settings.address  # the arm, in messages
        self.gives_way = "robot.driver.mode=impedance" if settings.mode == "velocity" else ""
        self._gripper = gripper
        self._franky: Any = None
        self._robot: Any = None
        self._state: Any = None  # the last one
        self._fault: RobotFault | None = None
        self._lower = np.array([joint.lower for joint in robot.joints])
        self._upper = np.array([joint.upper for joint in robot.joints])
        self._targets = np.array(robot.home)
        self._streaming: Streaming | None = None
        self._control = Scheduling.current()  # of the threads that control the arm, once there is a connection
        self._due = 0.0  # s on the robot's clock, at which the next command is due
        self._tare = np.zeros(6)

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Connect, check, set limits, collision thresholds and load. Nothing moves, and no error is cleared. Raises
        ``BackendUnavailable`` without the client library, else ``RobotFault``."""
        self._franky = import_franky()
        self._fault = None
        try:
            self._robot = self._connected()
            self._read()
            wrong = self._told(self._state)
            if wrong is not None:
                raise wrong
            self._set_up()
            self._gripper.open(self.description.gripper)
        except BaseException:
            self.close()
            raise
        self.begin()

    def _connected(self) -> Any:
        franky, config = self._franky, self._franky.RealtimeConfig
        kernel = Path("/sys/kernel/realtime")
        realtime = kernel.is_file() and kernel.read_text().strip() == "1"
        enforce = self._settings.realtime == "enforce" or (self._settings.realtime == "auto" and realtime)
        if self._settings.realtime == "auto" and not realtime:
            told = "this computer's kernel is not real-time (PREEMPT_RT): motions may end in lost packets at any moment"
            warnings.warn(told, RuntimeWarning, stacklevel=2)
        own = Scheduling.current()
        try:
            robot = franky.Robot(self._settings.address, realtime_config=config.Enforce if enforce else config.Ignore)
            self._control = Scheduling.current()
            return robot
        except franky.RealtimeException as error:
            remedy = "a PREEMPT_RT kernel and rtprio for your user, or robot.driver.realtime=ignore"
            raise BackendUnavailable("robot_driver", "franka", " ".join(str(error).split()), remedy) from error
        except Exception as error:
            raise fault_of_error(self.called, error) from error
        finally:
            own.take()

    def _set_up(self) -> None:
        robot, settings = self._robot, self._settings
        joints = self.description.joints
        positions = np.array(self._state.q)
        if (outside := (positions < self._lower) | (positions > self._upper)).any():
            worst = int(np.argmax(outside))
            raise fault(self.called, "outside", f"{joints[worst].name} at {positions[worst]:.3f} rad")
        # A wheel that was built for another arm offers that one's limits: never more than either's.
        for name, limit in (("acceleration", robot.joint_acceleration_limit), ("jerk", robot.joint_jerk_limit)):
            limit.set(np.minimum([_SHARE * getattr(joint, name) for joint in joints], limit.max))
        fastest = np.minimum([joint.velocity for joint in joints], robot.joint_velocity_limit.max)
        robot.joint_velocity_limit.set(fastest)
        if settings.mode == "impedance":
            self._streaming = ImpedanceStreaming(self._franky, robot, self.description, settings)
        else:
            self._streaming = VelocityStreaming(self._franky, robot, fastest)
        try:
            robot.set_collision_behavior(settings.collision_torque, settings.collision_force)
            if settings.load_mass > 0:
                robot.set_load(settings.load_mass, settings.load_centre, np.zeros(9))
        except Exception as error:
            raise self._failed(error) from error

    def begin(self) -> None:
        """Start from the robot's own desired position, with what is felt now as zero force. Nothing moves. Raises
        ``RobotFault``."""
        self._read()
        self._targets = np.array(self._state.q_d)
        felt = []
        for _ in range(_TARE_STATES):
            self._read()
            felt.append(self._state.O_F_ext_hat_K)
        self._tare = np.mean(felt, axis=0)
        self._due = self._now

    def close(self) -> None:
        if self._robot is not None and self._fault is None and self._state is not None:
            with contextlib.suppress(RobotFault):
                self._rest()
        self._gripper.close()
        self._robot = self._streaming = None

    def health(self) -> Health:
        if self._robot is None:
            return Health(False, f"not connected to {self.called}")
        if self._fault is not None:
            return Health(False, str(self._fault))
        gripper = self._gripper.health()
        if not gripper.ready:
            return Health(False, gripper.problem)
        measures = {"time": self._now, "success_rate": float(self._state.control_command_success_rate)}
        return attrs.evolve(super().health(), measures=measures)

    def particulars(self) -> dict[str, str]:
        """Raises ``RobotFault``."""
        state, settings = self._read(), self._settings
        hand = ", ".join(f"{value:g}" for value in np.round(np.asarray(state.F_x_Cee, dtype=float), 4))
        return {
            "client library": f"franky-control {version('franky-control')}, which speaks version 10",
            "mode": settings.mode,
            "end effector": f"{state.m_ee:.2f} kg with its centre at ({hand}) m in the flange's frame, set in Desk",
            "load": f"{state.m_load:.2f} kg beyond it",
            "collision thresholds": f"{settings.collision_force:g} N, {settings.collision_torque:g} Nm",
            "force sign": f"{settings.force_sign:g}",
        }

    def stop(self) -> None:
        super().stop()
        self._gripper.stop()

    def release(self) -> None:
        """Raises ``RobotFault`` if the robot has a fault; the stop then stays latched."""
        self._check()
        super().release()

    def recover(self) -> None:
        closed = self._robot is None
        if closed:
            self._franky = import_franky()
            self._robot = self._connected()
        try:
            self._discard_ended_motion()
            self._robot.recover_from_errors()
            self._fault, self._state = None, self._robot.state
        except Exception as error:
            raise self._failed(error) from error
        finally:
            if closed:
                self._robot = None
        if (wrong := self._told(self._state)) is not None:
            raise self._latched(wrong)
        if not closed:
            self.begin()

    def _discard_ended_motion(self) -> None:
        """Wait for the last motion's thread and discard the exception that ended it: where the state told of the fault
        first, the client library still keeps that exception and would raise it at the next call."""
        with contextlib.suppress(self._franky.Exception, RuntimeError):  # the second where the network was gone
            self._robot.join_motion(_ENDED_S)

    # -- commands ------------------------------------------------------------------------------------------------------
    def send(self, targets: Array) -> None:
        self.check_stop("moving")
        self._stream(targets)

    def halt(self, targets: Array) -> None:
        for row in targets:
            self._stream(row)
        self._rest()

    def set_gripper(self, width: float, force: float) -> None:
        self.check_stop("moving the fingers")
        gripper = self.description.gripper
        self._gripper.move(float(np.clip(width, 0.0, gripper.stroke)), float(np.clip(force, 0.0, gripper.max_force)))

    def _stream(self, targets: Array) -> None:
        """Send targets (n,) and wait for one control period of the robot's clock."""
        self._check()
        row = np.array(targets, dtype=float)
        if row.shape != self._targets.shape or not np.isfinite(row).all():
            raise InvalidArgument("targets", f"are {targets}", f"{len(self._targets)} finite numbers")
        state = self._read()
        ahead = (row - self._targets) / self.control_period
        allowed = np.array([joint.velocity for joint in self.description.joints])
        if (np.abs(ahead) > allowed).any():
            joint = int(np.argmax(np.abs(ahead) / allowed))
            problem = f"{self.description.joints[joint].name} would have to move at {abs(ahead[joint]):.1f} rad/s"
            raise InvalidArgument("targets", problem, f"steps of at most {allowed[joint]:.2f} rad/s")
        before, self._targets = self._targets, row
        late = self._now - self._due if self._keeps_pace else 0.0
        assert self._streaming is not None
        try:
            with self._control.inherited():
                self._streaming.send(state, before, row, self.control_period, late)
        except Exception as error:
            raise self._failed(error) from error
        self._wait()

    def _wait(self) -> None:
        """Wait until the next command is due; after a pause the timing starts anew."""
        self._due = (self._due if self._keeps_pace else self._now) + self.control_period
        while self._now < self._due - 1e-6:
            time.sleep(_POLL_S)
            self._read()

    @property
    def _keeps_pace(self) -> bool:
        """Whether the command that is next follows the one before without a pause."""
        return self._now < self._due + 2 * self.control_period

    def _rest(self) -> None:
        """Hold the last target until the arm is at rest, and leave it to the robot's own controller."""
        end, streaming = self._now + _REST_S, self._streaming
        while streaming is not None and self._now < end and not streaming.resting(self._state):
            self._wait()
        try:
            if streaming is not None:
                streaming.end()
        except Exception as error:
            raise self._failed(error) from error

    # -- state ---------------------------------------------------------------------------------------------------------
    @property
    def _now(self) -> float:
        return float(self._state.time.to_sec())

    @property
    def awaited(self) -> float:
        """Time on the robot's clock that was read, or for which a command waits (s). A double's clock keeps to it."""
        return max(self._now, self._due)

    def _read(self) -> Any:
        """The robot's state. Raises ``RobotFault`` if it has a fault or no state arrives."""
        before = self._state
        since = time.monotonic()
        while True:
            stood = time.monotonic() - since  # before the state is read: what delays this thread later is no fault
            try:
                if not self._robot.is_in_control:
                    self._robot.poll_motion()  # raises what ended the motion
                self._state = self._robot.state
            except Exception as error:
                raise self._failed(error) from error
            if before is None or self._state.time.to_msec() != before.time.to_msec():
                break
            if stood > self._settings.clock_timeout_s:
                raise self._latched(fault(self.called, "clock", f"{stood:.1f} s"))
            time.sleep(_POLL_S)
        if (wrong := self._told(self._state)) is not None and before is not None:
            raise self._latched(wrong)
        return self._state

    def _told(self, state: Any) -> RobotFault | None:
        return fault_of_state(self.called, state, self.gives_way)

    def _check(self) -> None:
        if self._robot is None:
            raise BackendUnavailable("robot", self.called, "the link is not open", "open()")
        if self._fault is not None:
            raise self._fault
        if not (gripper := self._gripper.health()).ready:
            raise self._latched(fault(self.called, "gripper", gripper.problem))

    def _failed(self, error: Exception) -> RobotFault:
        """The fault behind an exception of the client library, preferably from the robot's own state."""
        if isinstance(error, RobotFault):
            return self._latched(error)
        wrong = fault_of_error(self.called, error)
        if wrong.fault in ("reflex", "ended", "user-stop"):
            end, told = time.monotonic() + _TOLD_S, None
            try:
                while told is None and time.monotonic() < end:
                    told = self._told(self._robot.state)
                wrong = told or wrong
            except Exception as further:
                wrong = fault_of_error(self.called, further)
        return self._latched(wrong)

    def _latched(self, wrong: RobotFault) -> RobotFault:
        self._fault = self._fault or wrong
        if self._streaming is not None:
            self._streaming.abandon()
        return self._fault

    def joint_positions(self) -> Array:
        return np.array(self._read().q)

    def joint_velocities(self) -> Array:
        return np.array(self._read().dq)

    def joint_targets(self) -> Array:
        return self._targets.copy()

    def gripper_width(self) -> float:
        return self._gripper.width()

    def holding(self) -> bool:
        return self._gripper.holding()

    def contact_wrench(self) -> Array:
        """The wrench that the environment exerts, without the one measured when the link was opened; the stiffness
        frame K is the tool's."""
        return self._settings.force_sign * (np.array(self._read().O_F_ext_hat_K) - self._tare)

    def time(self) -> float:
        return float(self._read().time.to_sec())

    def checkpoint(self) -> bytes:
        raise BackendUnavailable("robot", self.called, "hardware cannot be restored", "put things back by hand")

    def restore(self, checkpoint: bytes) -> None:
        self.checkpoint()


class FrankaDriver(RobotDriver):
    """Makes links to the arm at an address; its Hand is moved too, unless another gripper driver is configured."""

    def __init__(self, settings: FrankaSettings) -> None:
        self._settings = settings

    @property
    def address(self) -> str:
        return self._settings.address

    def link(self, robot: RobotDescription, gripper: GripperDriver, simulator: Simulator | None = None) -> Link:
        if len(robot.joints) != 7:
            raise InvalidArgument("robot.driver", f"{robot.name!r} has {len(robot.joints)} joints", "panda or fr3")
        settings = self._settings
        hand = HandSettings(settings.address, settings.hand_deadline_s)
        return FrankaLink(settings, robot, FrankaHand(hand) if gripper.included else gripper)
