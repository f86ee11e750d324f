"""The driver of a WSG gripper. One thread sends commands, reads what the gripper answers and polls its state."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import struct
import threading
import time

from memo_core.plugin import BackendUnavailable, Flag, GripperDescription, GripperDriver, Health, check_gripper_command
from memo_wsg.protocol import FLOAT, FLOATS, Broken, Command, Grasping, Status, packed, unpacked
from memo_wsg.settings import WsgSettings

_POLL_S = 0.01
_POLLED = (Command.WIDTH, Command.GRASPING_STATE)
_PATIENCE_S = 0.2  # without an answer, after which it is polled again
_MOTIONS = (Command.MOVE, Command.GRASP, Command.RELEASE, Command.HOME)
_LEAST_FORCE = 5.0  # N
_REMEDIES = {
    Status.NOT_INITIALIZED: "home it on its web page",
    Status.AXIS_BLOCKED: "free its fingers, acknowledge the error on its web page",
    Status.ACCESS_DENIED: "acknowledge its fast stop on its web page",
    Status.CMD_UNKNOWN: "its firmware lacks a command, or a script that must run on the gripper does not",
    Status.NOT_AVAILABLE: "end what else controls it (its web page, a script)",
}
# Fingers that met nothing, or something else than was expected, are no fault of a grasp.
_GRASPED_NOTHING = (Status.CMD_FAILED, Status.AXIS_BLOCKED, Status.TIMEOUT)


class WsgGripper(GripperDriver):
    """One gripper. It grasps to close and moves to open; its errors are never acknowledged unasked. A motion begins
    once the gripper has told the end of the one before."""

    def __init__(self, settings: WsgSettings) -> None:
        self._settings = settings
        self._gripper = GripperDescription()
        self._socket: socket.socket | None = None
        self._thread: threading.Thread | None = None
        self._wake = (0, 0)  # a pipe: what is written ends the thread's waiting
        self._closing = threading.Event()
        self._stopping = Flag()
        self._answered = threading.Event()  # the first width is known
        self._problem = "it is not open"
        self._width, self._state = 0.0, Grasping.IDLE
        self._lock = threading.Lock()  # of what is wanted
        self._wanted: tuple[float, float] | None = None  # width (m) and force (N) of a motion that was not begun yet
        self._since = 0.0  # when the newest motion was wanted
        self._running: tuple[float, float] | None = None  # the one whose end was not told yet
        self._ending = False  # a stop was sent and not answered yet
        self._asked: set[Command] = set()  # polls that were not answered yet
        self._polled = self._heard = 0.0

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self, gripper: GripperDescription) -> None:
        where = f"{self._settings.address}:{self._settings.port}"
        self._gripper = gripper
        try:
            self._socket = socket.create_connection(
                (self._settings.address, self._settings.port), self._settings.timeout_s
            )
        except OSError as error:
            remedy = "check the cable, the address, and that its command interface is on (TCP) on its web page"
            raise BackendUnavailable("gripper_driver", "wsg", f"{where}: {error}", remedy) from error
        self._wake = os.pipe()
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for event in (self._closing, self._stopping, self._answered):
            event.clear()
        self._wanted = self._running = None
        self._ending = False
        self._asked.clear()
        self._problem, self._polled, self._heard = "", 0.0, time.monotonic()
        self._thread = threading.Thread(target=self._run, args=(self._socket,), name="wsg", daemon=True)
        self._thread.start()
        if not self._answered.wait(self._settings.timeout_s) or self._problem:
            problem = self._problem or "it does not answer"
            self.close()
            raise BackendUnavailable("gripper_driver", "wsg", f"{where}: {problem}", "home it on its web page")

    def close(self) -> None:
        self._closing.set()
        if self._thread is not None:
            self._thread.join(1.0)
            self._thread = None
        if self._socket is not None:
            _take_leave(self._socket)
            self._socket.close()
            self._socket = None
            for end in self._wake:
                os.close(end)
        self._problem = "it is not open"

    def health(self) -> Health:
        waiting = self._wanted is not None or self._running is not None
        if not self._problem and waiting and time.monotonic() - self._since > self._settings.deadline_s:
            return Health(False, f"it did not end its motion within {self._settings.deadline_s:g} s; free its fingers")
        return Health(not self._problem, self._problem, {"width": self._width})

    # -- commands ------------------------------------------------------------------------------------------------------
    def move(self, width: float, force: float) -> None:
        check_gripper_command(self._gripper, width, force)
        if self._problem:
            raise BackendUnavailable("gripper_driver", "wsg", self._problem)
        self._stopping.clear()
        with self._lock:
            self._wanted, self._since = (width, force), time.monotonic()
        os.write(self._wake[1], b"m")

    def stop(self) -> None:
        self._stopping.set()  # this may be called by a signal handler, which must wait for no lock: the thread sends it
        if self._thread is not None:
            os.write(self._wake[1], b"s")

    def width(self) -> float:
        return self._width

    def holding(self) -> bool:
        return self._state == Grasping.HOLDING

    # -- in a thread of its own ----------------------------------------------------------------------------------------
    def _run(self, connection: socket.socket) -> None:
        received, stopped = b"", False
        try:
            while not self._closing.is_set():
                stopping = self._stopping.is_set() and not stopped
                stopped = self._stopping.is_set()
                self._command(connection, stopping)
                self._poll(connection)
                ready, _, _ = select.select([connection.fileno(), self._wake[0]], [], [], _POLL_S)
                if self._wake[0] in ready:
                    os.read(self._wake[0], 64)
                if connection.fileno() in ready:
                    data = connection.recv(4096)
                    if not data:
                        self._problem = "it closed the connection: check its power and cable"
                        return
                    received += data
                    while (message := unpacked(received)) is not None:
                        command, payload, received = message
                        self._hear(command, payload)
                elif time.monotonic() - self._heard > self._settings.timeout_s:
                    timeout = self._settings.timeout_s
                    self._problem = f"it has not answered for {timeout:g} s: check its power and cable"
                    return
        except (Broken, struct.error, IndexError) as error:
            self._problem = f"it sent what is no message of its protocol ({error}): check its address and firmware"
        except OSError as error:
            self._problem = f"the connection was lost ({error}): check its power and cable"

    def _command(self, connection: socket.socket, stopping: bool) -> None:
        """Send a stop, or the motion that is wanted."""
        with self._lock:
            if self._stopping.is_set():
                self._wanted = None
            waits = self._ending or self._running is not None
            interrupts = stopping or (self._wanted is not None and waits and not self._ending)
            if self._wanted is not None and not waits and not stopping:
                self._running, self._wanted = self._wanted, None
        if interrupts:
            self._ending = True
            connection.sendall(packed(Command.STOP))
        if interrupts or waits or self._running is None:
            return
        width, force = self._running
        connection.sendall(packed(Command.FORCE_LIMIT, FLOAT.pack(max(force, _LEAST_FORCE))))
        target = FLOATS.pack(1000 * width, 1000 * self._gripper.speed)
        if width < self._width:
            connection.sendall(packed(Command.GRASP, target))
        else:
            connection.sendall(packed(Command.MOVE, b"\0" + target))

    def _poll(self, connection: socket.socket) -> None:
        """Ask for the width and the state, once those before were told: a slow gripper is not flooded."""
        since = time.monotonic() - self._polled
        if since < _POLL_S or (self._asked and since < _PATIENCE_S):
            return
        self._polled = time.monotonic()
        self._asked.update(_POLLED)
        for command in _POLLED:
            connection.sendall(packed(command, b"\0\0\0"))

    def _hear(self, command: int, payload: bytes) -> None:
        """Take notice of one answer. Raises ``struct.error`` or ``IndexError`` for one that is too short."""
        self._heard = time.monotonic()
        (status,) = struct.unpack_from("<H", payload)
        if status == Status.CMD_PENDING:
            return
        if command in _POLLED:
            self._asked.discard(Command(command))
        if command == Command.STOP:
            self._ending, self._running = False, None
        elif command in _MOTIONS and self._ends(status):
            self._running = None
        if status == Status.SUCCESS:
            if command == Command.WIDTH:
                self._width = FLOAT.unpack_from(payload, 2)[0] / 1000
                self._answered.set()
            elif command == Command.GRASPING_STATE:
                self._state = Grasping(payload[2]) if payload[2] in set(Grasping) else Grasping.ERROR
            return
        ended = command in _MOTIONS and status in (Status.CMD_ABORTED, Status.ALREADY_RUNNING)
        if ended or (command == Command.GRASP and status in _GRASPED_NOTHING):
            return
        known = status in set(Status)
        name = Status(status).name.lower().replace("_", " ") if known else f"error {status}"
        question = Command(command).name.lower().replace("_", " ") if command in set(Command) else f"{command:#x}"
        remedy = (_REMEDIES.get(Status(status)) if known else None) or "see its web page"
        self._problem = f"it answers {name} to {question}: {remedy}"
        self._answered.set()

    def _ends(self, status: int) -> bool:
        """Whether an answer to a motion is about the one that runs. One that was refused because the fingers still move
        is wanted again; what a stop has ended is told by the stop's answer, after which that motion counts no more."""
        if status == Status.ALREADY_RUNNING:
            with self._lock:
                self._wanted = self._wanted or self._running
            return True
        return status != Status.CMD_ABORTED


def _take_leave(connection: socket.socket) -> None:
    """Announce the end and wait for the answer: a connection that is closed with something unread is reset, which a
    gripper may take for a lost client."""
    received, end = b"", time.monotonic() + _PATIENCE_S
    with contextlib.suppress(OSError, Broken):
        connection.sendall(packed(Command.DISCONNECT))
        while time.monotonic() < end:
            connection.settimeout(_PATIENCE_S)
            if not (data := connection.recv(4096)):
                return
            received += data
            while (message := unpacked(received)) is not None:
                command, _, received = message
                if command == Command.DISCONNECT:
                    return
