"""A double of the Franka Hand: commands over TCP, states over UDP, and fingers that something can be between."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from types import TracebackType

import numpy as np

from memo_core.interfaces.simulator import Simulator
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
_THERE = 0.0005  # m
_STATE_S = 0.01  # between two states
_PRESSED = 1.5  # N between fingers that something is between
_STILL_S = 0.05
_STUCK_S = 100.0  # that ``move`` into something takes on a real Hand


class Fingers:
    """Ideal fingers. ``thing`` is the width (m) of what is between them, None for nothing."""

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
    """The fingers of the robot in a built simulator, which somebody else ticks (``SceneBody``). The simulator is
    touched by ``advance`` only, since it stands one user at a time."""

    def __init__(self, simulator: Simulator) -> None:
        self._simulator = simulator
        self._goal, self._force, self._still = _STROKE, 40.0, 0.0
        self.width = simulator.gripper_width()
        self.blocked = False

    def command(self, width: float, speed: float, force: float) -> None:
        self._goal, self._force, self._still, self.blocked = width, force, 0.0, False

    def halt(self) -> None:
        self._goal, self._force = self.width, 40.0

    def advance(self, seconds: float) -> None:
        self._simulator.command_gripper(self._goal, self._force)
        width = self._simulator.gripper_width()
        self._still = self._still + seconds if abs(width - self.width) < 1e-5 else 0.0
        self.width = width
        pressed = width > self._goal + _THERE and self._simulator.gripper_effort() > _PRESSED
        self.blocked = pressed and self._still > _STILL_S


class HandDouble:
    """One Hand at ``address``. It has a clock of its own, unless ``advance`` is called by a ``ControlBox``."""

    def __init__(self, address: str = "127.0.0.2", fingers: Fingers | SceneFingers | None = None) -> None:
        self.address = address
        self.fingers = fingers or Fingers()
        self.driven = False  # whether somebody else's clock moves the fingers
        self._move: tuple[HandCommand, int, float] | None = None  # command, id, seconds it has taken
        self._grasp = (0.0, 0.0, 0.0)
        self._grasped = False
        self._running = False
        self._client: socket.socket | None = None
        self._peer = ("", 0)
        self._received = b""
        self._number = 0
        self._lock = threading.RLock()

    def start(self) -> None:
        self._listener = socket.create_server((self.address, HAND_PORT), backlog=1)
        self._listener.setblocking(False)
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind((self.address, 0))
        self._running = True
        self._thread = threading.Thread(target=self._run, name="hand double", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Idempotent."""
        if self._running:
            self._running = False
            self._thread.join()

    def __enter__(self) -> HandDouble:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def advance(self, seconds: float) -> None:
        """Let the fingers move, and end what has ended."""
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
                # Fingers that have met nothing within a tolerance that wide are a success to a real Hand as well.
                self._end(
                    HandStatus.SUCCESS if width - inner <= self.fingers.width <= width + outer else HandStatus.FAIL
                )

    def _end(self, status: HandStatus) -> None:
        move, self._move = self._move, None
        if move is not None:
            self._respond(move[0], move[1], int(status).to_bytes(2, "little"))

    # -- running -------------------------------------------------------------------------------------------------------
    def _run(self) -> None:
        last = told = time.monotonic()
        while self._running:
            with self._lock:
                self._serve()
                self._accept()
            now = time.monotonic()
            if not self.driven:
                self.advance(now - last)
            last = now
            if now - told >= _STATE_S:
                told = now
                self._send_state()
            time.sleep(0.002)
        for one in (self._client, self._listener, self._udp):
            if one is not None:
                one.close()

    def _send_state(self) -> None:
        if not self._peer[1]:
            return
        self._number += 1
        grasped = self._grasped and self.fingers.blocked
        packet = HAND_STATE.pack(self._number, self.fingers.width, _STROKE, grasped, 30)
        with contextlib.suppress(OSError):
            self._udp.sendto(packet, self._peer)

    def _accept(self) -> None:
        with contextlib.suppress(BlockingIOError):
            client, peer = self._listener.accept()
            client.setblocking(False)
            self._client, self._peer, self._received = client, (peer[0], 0), b""

    def _serve(self) -> None:
        if self._client is None:
            return
        try:
            data = self._client.recv(4096)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._client.close()
            self._client, self._peer = None, ("", 0)
            return
        self._received += data
        while len(self._received) >= HAND_HEADER.size:
            command, number, size = HAND_HEADER.unpack_from(self._received)
            if len(self._received) < size:
                return
            payload, self._received = self._received[HAND_HEADER.size : size], self._received[size:]
            self._answer(HandCommand(command), number, payload)

    def _answer(self, command: HandCommand, number: int, payload: bytes) -> None:
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
            self._move = (command, number, 0.0)
            self.fingers.command(width, speed, force)

    def _respond(self, command: HandCommand, number: int, payload: bytes) -> None:
        if self._client is None:
            return
        with contextlib.suppress(OSError):
            self._client.setblocking(True)
            self._client.sendall(HAND_HEADER.pack(command, number, HAND_HEADER.size + len(payload)) + payload)
            self._client.setblocking(False)
