"""The driver ``franka`` without an arm: its commands go through TCP and UDP to a double of the control box, and the
experiment's simulator is what the double moves. Every task and command that works in simulation works with it:

    memo tasks verify stack-the-cubes -s robot.backend=fr3 -s robot.driver=franka-double

The double is served by the thread that calls the link, within the call, and the driver's own code by another. So the
simulator is used by one thread, and the robot's clock stands still while nobody asks the link for anything.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import queue
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

import numpy as np

from memo_core.plugin import (
    Array,
    BackendUnavailable,
    GripperDriver,
    GuardedLink,
    Health,
    IncludedGripper,
    InvalidArgument,
    Link,
    LinkCheckpoint,
    RobotDescription,
    RobotDriver,
    Simulator,
)
from memo_franka.driver import FrankaDriver, FrankaLink
from memo_franka.scheduling import Scheduling
from memo_franka.settings import DoubleSettings, FrankaSettings
from memo_franka.testing.arm import DT, SceneBody
from memo_franka.testing.control_box import ControlBox
from memo_franka.testing.hand import HandDouble, SceneFingers

_PATIENCE_S = 30.0  # wall-clock time in which a busy computer answers
_REPEAT_S = 0.2  # the client library gives up after 1 s without a packet
_HAND_S = 10.0  # wall-clock time in which a command reaches the Hand, and the driver reads what it has told
_SAME_M = 1e-4

_Result = TypeVar("_Result")


class FrankaDouble(RobotDriver):
    """Makes links through a double of the control box to the experiment's simulator."""

    simulated = True

    def __init__(self, settings: DoubleSettings) -> None:
        self._settings = settings
        self.longest_tick = DT if settings.mode == "impedance" else math.inf

    def link(self, robot: RobotDescription, gripper: GripperDriver, simulator: Simulator | None = None) -> Link:
        if simulator is None:
            raise InvalidArgument("robot.driver", "'franka-double' has no simulator", "an experiment with one")
        if not gripper.included:
            raise InvalidArgument("robot.gripper_driver", "the double brings its Hand", "included")
        if simulator.control_period > 1.01 * self.longest_tick:
            given = f"has a control period of {1000 * simulator.control_period:g} ms"
            raise InvalidArgument("simulator", given, "1 ms for robot.driver.mode=impedance: shorten_tick(0.001)")
        return RehearsalLink(self._settings, robot, simulator)


class RehearsalLink(Link):
    """The guarded link of the driver ``franka``, with the double at its other end. It can be restored, as the simulator
    can, but what follows is not bit-exactly what followed then: packets take as long as they take."""

    real_time = False
    can_restore = True
    feels_force = True

    def __init__(self, settings: DoubleSettings, robot: RobotDescription, simulator: Simulator) -> None:
        super().__init__(settings.safety.kept_by(robot))
        self.simulator = simulator
        self._settings = settings
        self._robot = robot
        self._driven: Link | None = None
        self._jobs: queue.SimpleQueue[tuple[Callable[[], Any], Future[Any]] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None
        self._calling = threading.RLock()
        self._ticking = False  # within a tick, whose listeners ask for the state too

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        robot, simulator = self._robot, self.simulator
        self._body = SceneBody(simulator, robot)
        self._fingers = SceneFingers(simulator)
        self.box, self.hand = _listening(robot, self._body, self._fingers)
        self.inner = self._franka()
        guarded = GuardedLink(self.inner, robot, self._settings.safety)
        self._stop = guarded._stop  # one stop, latched in one place
        self.control_period = guarded.control_period
        self._thread = threading.Thread(target=self._work, name="driver of the rehearsal", daemon=True)
        self._thread.start()
        self._driven = guarded
        try:
            self._through(guarded.open)
        except BaseException:
            self.close()
            raise
        self.box.reader = lambda: self.inner.awaited

    def _franka(self) -> FrankaLink:
        settings = FrankaSettings(
            self.box.address,
            realtime="ignore",
            mode=self._settings.mode,
            collision_force=self._settings.collision_force,
            collision_torque=0.75 * self._settings.collision_force,
            clock_timeout_s=_PATIENCE_S,
            hand_deadline_s=2 * _PATIENCE_S,
        )
        link = FrankaDriver(settings).link(self._robot, IncludedGripper())
        assert isinstance(link, FrankaLink)
        link.called = "franka-double"
        link.real_time = False  # the double's clock is the simulator's
        return link

    def close(self) -> None:
        driven, self._driven = self._driven, None
        if self._thread is None:
            return
        try:
            if driven is not None:
                self.box.reader = None
                self._through(driven.close)
        finally:
            self._jobs.put(None)
            self._thread.join(_PATIENCE_S)  # one that an interrupt has left in a call ends when no state comes
            self._thread = None
            self.box.stop()
            self.hand.stop()

    def health(self) -> Health:
        return self.inner.health() if self._driven is not None else Health(False, "not open")

    def particulars(self) -> dict[str, str]:
        return self._through(self._link.particulars)

    def stop(self) -> None:
        self._link.stop()

    def release(self) -> None:
        self._through(self._link.release)

    def recover(self) -> None:
        self._through(self._link.recover)

    # -- two threads ---------------------------------------------------------------------------------------------------
    @property
    def _link(self) -> Link:
        if self._driven is None:
            raise BackendUnavailable("robot_driver", "franka-double", "the link is not open", "open()")
        return self._driven

    def _through(self, call: Callable[[], _Result]) -> _Result:
        """The result of ``call`` in the driver's thread; meanwhile this one is the robot."""
        with self._calling:
            done: Future[_Result] = Future()
            self._jobs.put((call, done))
            while not done.done():
                if self._thread is None or not self._thread.is_alive():
                    raise BackendUnavailable("robot_driver", "franka-double", "its driver's thread has ended", "open()")
                self._ticking = True
                try:
                    self.box.round()
                finally:
                    self._ticking = False
            return done.result()

    def _work(self) -> None:
        """The driver's thread. It keeps the connection alive while the calling thread computes."""
        with contextlib.suppress(OSError):
            Scheduling.current().raised().take()
        while True:
            try:
                job = self._jobs.get(timeout=_REPEAT_S)
            except queue.Empty:
                self.box.repeat()
                continue
            if job is None:
                return
            call, done = job
            try:
                done.set_result(call())
            except BaseException as error:
                done.set_exception(error)

    # -- commands ------------------------------------------------------------------------------------------------------
    def check(self, skill: str, targets: Array) -> None:
        self._through(lambda: self._link.check(skill, targets))

    def send(self, targets: Array) -> None:
        self._through(lambda: self._link.send(targets))

    def halt(self, targets: Array) -> None:
        self._through(lambda: self._link.halt(targets))

    def set_gripper(self, width: float, force: float) -> None:
        """The robot's clock stands still until the command has reached the Hand."""
        heard = self.hand.heard
        self._link.set_gripper(width, force)
        self._until(lambda: self.hand.heard > heard or self.stopped or not self.health().ready)

    # -- state ---------------------------------------------------------------------------------------------------------
    def joint_positions(self) -> Array:
        return self.simulator.joint_positions() if self._ticking else self._through(self._link.joint_positions)

    def joint_velocities(self) -> Array:
        return self.simulator.joint_velocities() if self._ticking else self._through(self._link.joint_velocities)

    def joint_targets(self) -> Array:
        return self._link.joint_targets()

    def contact_wrench(self) -> Array:
        return self._body.force if self._ticking else self._through(self._link.contact_wrench)

    def gripper_width(self) -> float:
        self._until(self._hand_is_read)
        return self._link.gripper_width()

    def holding(self) -> bool:
        self._until(self._hand_is_read)
        return self._link.holding()

    def _hand_is_read(self) -> bool:
        link, hand = self._link, self.hand
        there = abs(link.gripper_width() - hand.fingers.width) < _SAME_M
        return there and link.holding() == (hand.grasped and hand.fingers.width > _SAME_M)

    def _until(self, happened: Callable[[], bool]) -> None:
        """Wait for the Hand's own thread, which a busy computer starves."""
        end = time.monotonic() + (0.0 if self._ticking else _HAND_S)
        while not happened() and time.monotonic() < end:
            time.sleep(0.001)

    def time(self) -> float:
        return self.simulator.time

    # -- restoring -----------------------------------------------------------------------------------------------------
    def checkpoint(self) -> bytes:
        world = self.simulator.checkpoint()
        return LinkCheckpoint(self.joint_targets(), self._body.state(), world, self.hand.state()).packed()

    def restore(self, checkpoint: bytes) -> None:
        """Raises ``InvalidArgument`` for bytes that are not a checkpoint of this link, ``RobotFault``."""
        then = LinkCheckpoint.unpacked(checkpoint, self.description, hand=len(self.hand.state()))
        nothing = np.empty((0, len(self.description.joints)))
        self.halt(nothing)
        self.simulator.restore(then.world)
        self.hand.recall(then.hand)
        self._body.recall(then.felt)
        self.box.place(then.targets)
        self._through(self._begin)
        self.halt(nothing)

    def _begin(self) -> None:
        """Start from where the arm was placed, not from a state that was sent before."""
        placed = self.box.ticks * DT
        while self.inner.time() <= placed:
            ...
        self.inner.begin()


_NUMBERS = itertools.count()


def _listening(robot: RobotDescription, body: SceneBody, fingers: SceneFingers) -> tuple[ControlBox, HandDouble]:
    """Doubles that listen on a loopback address which no other process uses. Raises ``BackendUnavailable``."""
    for _ in range(200):
        number = next(_NUMBERS)
        address = f"127.{1 + os.getpid() % 250}.{100 + os.getpid() // 250 % 100}.{1 + number % 250}"
        hand = HandDouble(address, fingers)
        box = ControlBox(robot, address, body, patience_s=_PATIENCE_S, hand=hand, paced=False)
        try:
            hand.start()
        except OSError:
            continue
        try:
            box.listen()
        except OSError:
            hand.stop()
            continue
        return box, hand
    problem = "no loopback address has its ports 1337 and 1338 free"
    raise BackendUnavailable("robot_driver", "franka-double", problem, "end other processes that use the double")
