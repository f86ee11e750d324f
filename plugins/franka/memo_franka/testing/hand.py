"""A test double of the Franka Hand: commands over TCP, states over UDP, and fingers that can grasp an object."""

from __future__ import annotations

import threading

import numpy as np

from memo_core.plugin import Simulator
from memo_franka.testing.server import FrankaServer
from memo_franka.testing.wire import (
    HAND_GRASP,
    HAND_HEADER,
    HAND_MOVE,
    HAND_PORT,
    HAND_STATE,
    HAND_VERSION,
    HandCommand,
    HandStatus,
)

_STROKE = 0.08  # m
_THERE = 0.0005  # m from the goal
_STATE_S = 0.01  # between two states
_PRESSED = 1.5  # N, above which the fingers press on an object
_STILL_S = 0.05
_STUCK_S = 100.0  # after which a real Hand gives up a ``move`` that is blocked by an object


class Fingers:
    """Ideal fingers. ``thing``: width (m) of the object between them; None if there is none."""

    def __init__(self, width: float = _STROKE) -> None:
        self.width = width
        self.thing: float | None = None
        self._goal, self._speed = width, 0.0

    def command(self, width: float, speed: float, force: float) -> None:
        self._goal, self._speed = width, speed

    def halt(self) -> None:
        self._goal = self.width

    def advance(self, seconds: float) -> None:
        way = self._speed * seconds
        width = self.width + float(np.clip(self._goal - self.width, -way, way))
        if self.thing is not None and self._goal < self.thing <= self.width:
            width = max(width, self.thing)
        self.width = width

    @property
    def blocked(self) -> bool:
        return self.thing is not None and self._goal < self.thing and self.width <= self.thing + 1e-9


class SceneFingers:
    """The fingers of the robot in a built simulator, which ``SceneBody`` ticks. Only ``advance`` uses the simulator,
    because it allows one user at a time."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._goal, self._force, self._still = _STROKE, 40.0, 0.0
        self.width = simulator.gripper_width()
        self.blocked = False

    def command(self, width: float, speed: float, force: float) -> None:
        self._goal, self._force, self._still, self.blocked = width, force, 0.0, False

    def halt(self) -> None:
        self._goal, self._force = self.width, 40.0

    def state(self) -> list[float]:
        return [self._goal, self._force, self._still, self.width, float(self.blocked)]

    def recall(self, state: list[float]) -> None:
        self._goal, self._force, self._still, self.width, blocked = state
        self.blocked = bool(blocked)

    def advance(self, seconds: float) -> None:
        self._simulator.command_gripper(self._goal, self._force)
        width = self._simulator.gripper_width()
        self._still = self._still + seconds if abs(width - self.width) < 1e-5 else 0.0
        self.width = width
        pressed = width > self._goal + _THERE and self._simulator.gripper_effort() > _PRESSED
        self.blocked = pressed and self._still > _STILL_S


class HandDouble(FrankaServer):
    """One Hand at ``address``. Its fingers move in real time, unless a ``ControlBox`` calls ``advance``."""

    header = HAND_HEADER
    period_s = 0.005

    def __init__(self, address: str = "127.0.0.2", fingers: Fingers | SceneFingers | None = None) -> None:
        super().__init__(address, HAND_PORT)
        self.fingers = fingers or Fingers()
        self.driven = False  # whether a control box's clock moves the fingers
        self._move: tuple[HandCommand, int, float] | None = None  # command, id, seconds since it began
        self._grasp = (0.0, 0.0, 0.0)
        self._grasped = False
        self.heard = 0  # motions that were commanded
        self._number = 0
        self._since_state = 0.0
        self._lock = threading.RLock()

    def advance(self, seconds: float) -> None:
        """Move the fingers for ``seconds`` and report motions that have ended."""
        with self._lock:
            self.fingers.advance(seconds)
            if self._move is None:
                return
            command, number, took = self._move
            self._move = (command, number, took + seconds)
            there = abs(self.fingers.width - self._grasp[0]) < _THERE
            if command == HandCommand.MOVE and there:
                self._end(HandStatus.SUCCESS)
            elif command == HandCommand.MOVE and took > _STUCK_S:
                self._end(HandStatus.UNSUCCESSFUL)
            elif command == HandCommand.GRASP and (self.fingers.blocked or there):
                width, inner, outer = self._grasp
                self._grasped = self.fingers.blocked and width - inner <= self.fingers.width <= width + outer
                # A real Hand too reports success for empty fingers if the tolerance is that wide.
                self._end(
                    HandStatus.SUCCESS if width - inner <= self.fingers.width <= width + outer else HandStatus.FAIL
                )

    def _end(self, status: HandStatus) -> None:
        move, self._move = self._move, None
        if move is not None:
            self._respond(move[0], move[1], int(status).to_bytes(2, "little"))

    # -- serving -------------------------------------------------------------------------------------------------------
    def _communicate(self) -> None:
        with self._lock:
            super()._communicate()

    def _advance(self, seconds: float) -> None:
        if not self.driven:
            self.advance(seconds)
        self._since_state += seconds
        if self._since_state >= _STATE_S:
            self._since_state = 0.0
            self._send_state()

    def _send_state(self) -> None:
        self._number += 1
        self._send_packet(HAND_STATE.pack(self._number, self.fingers.width, _STROKE, self.grasped, 30))

    @property
    def grasped(self) -> bool:
        """Whether a grasp has succeeded and its object is still there."""
        return self._grasped and self.fingers.blocked

    def state(self) -> list[float]:
        """For checkpoints: of the fingers in a scene, and of the last grasp."""
        assert isinstance(self.fingers, SceneFingers)
        with self._lock:
            return [*self.fingers.state(), *self._grasp, float(self._grasped)]

    def recall(self, state: list[float]) -> None:
        """Back to ``state``; a motion that goes on is aborted."""
        assert isinstance(self.fingers, SceneFingers)
        with self._lock:
            self._end(HandStatus.ABORTED)
            self.fingers.recall(state[:5])
            width, inner, outer, grasped = state[5:]
            self._grasp, self._grasped = (width, inner, outer), bool(grasped)

    def _answer(self, command: int, number: int, payload: bytes) -> None:
        if command == HandCommand.CONNECT:
            port = int.from_bytes(payload[2:4], "little")
            self._peer = (self._peer[0], port)
            self._respond(command, number, b"\0\0" + HAND_VERSION.to_bytes(2, "little"))
            self._send_state()
        elif command == HandCommand.HOMING:
            self.fingers.command(_STROKE, 0.1, 40.0)
            self._respond(command, number, b"\0\0")
        elif command == HandCommand.STOP:
            self.fingers.halt()
            self._end(HandStatus.ABORTED)
            self._respond(command, number, b"\0\0")
        else:
            self._end(HandStatus.ABORTED)
            if command == HandCommand.MOVE:
                width, speed = HAND_MOVE.unpack(payload)
                self._grasp, force = (width, 0.0, 0.0), 40.0
            else:
                width, inner, outer, speed, force = HAND_GRASP.unpack(payload)
                self._grasp = (width, inner, outer)
            self._grasped = False
            self._move = (HandCommand(command), number, 0.0)
            self.heard += 1
            self.fingers.command(width, speed, force)
