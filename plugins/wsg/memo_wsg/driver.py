"""The driver of a WSG gripper. One thread reads what it answers and polls its state; commands return at once."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import threading
import time

from memo_core.errors import BackendUnavailable
from memo_core.interfaces.driver import GripperDriver, check_gripper_command
from memo_core.interfaces.link import Health
from memo_core.robot.description import GripperDescription
from memo_wsg.protocol import FLOAT, FLOATS, Broken, Command, Grasping, Status, packed, unpacked
from memo_wsg.settings import WsgSettings

_POLL_S = 0.01
_MOTIONS = (Command.MOVE, Command.GRASP, Command.RELEASE, Command.HOME)
_LEAST_FORCE = 5.0  # N
_REMEDIES = {
    Status.NOT_INITIALIZED: "home it on its web page",
    Status.AXIS_BLOCKED: "free its fingers, acknowledge the error on its web page",
    Status.COMMAND_UNKNOWN: "its firmware lacks a command, or a script that must run on the gripper does not",
    Status.NOT_AVAILABLE: "end what else controls it (its web page, a script)",
}


class WsgGripper(GripperDriver):
    """One gripper. It grasps to close and moves to open; its errors are never acknowledged unasked."""

    def __init__(self, settings: WsgSettings) -> None:
        self._settings = settings
        self._gripper = GripperDescription()
        self._socket: socket.socket | None = None
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()
        self._wake = (0, 0)  # a pipe: what is written ends the thread's waiting
        self._closing = threading.Event()
        self._stopping = threading.Event()
        self._answered = threading.Event()  # the first width is known
        self._problem = "it is not open"
        self._width, self._state = 0.0, Grasping.IDLE
        self._since = 0.0  # when the motion at hand began
        self._begun = 0  # motions whose end was not told yet
        self._heard = 0.0

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
        self._problem, self._begun, self._heard = "", 0, time.monotonic()
        self._thread = threading.Thread(target=self._run, name="wsg", daemon=True)
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
            self._socket.close()
            self._socket = None
            for end in self._wake:
                os.close(end)
        self._problem = "it is not open"

    def health(self) -> Health:
        if not self._problem and self._begun and time.monotonic() - self._since > self._settings.deadline_s:
            return Health(False, f"it did not end its motion within {self._settings.deadline_s:g} s; free its fingers")
        return Health(not self._problem, self._problem, {"width": self._width})

    # -- commands ------------------------------------------------------------------------------------------------------
    def move(self, width: float, force: float) -> None:
        gripper = self._gripper
        check_gripper_command(gripper, width, force)
        if self._problem:
            raise BackendUnavailable("gripper_driver", "wsg", self._problem)
        self._stopping.clear()
        if self._begun:
            self._send(Command.STOP)
        self._begun, self._since = self._begun + 1, time.monotonic()
        self._send(Command.FORCE_LIMIT, FLOAT.pack(max(force, _LEAST_FORCE)))
        target = FLOATS.pack(1000 * width, 1000 * gripper.speed)
        if width < self._width:
            self._send(Command.GRASP, target)
        else:
            self._send(Command.MOVE, b"\0" + target)

    def stop(self) -> None:
        self._stopping.set()  # this may be called by a signal handler, which must wait for no lock: the thread sends it
        if self._thread is not None:
            os.write(self._wake[1], b"s")

    def width(self) -> float:
        return self._width

    def holding(self) -> bool:
        return self._state == Grasping.HOLDING

    # -- in a thread of its own ----------------------------------------------------------------------------------------
    def _run(self) -> None:
        received, stopped, polled = b"", False, 0.0
        while not self._closing.is_set():
            stopping = self._stopping.is_set() and not stopped
            stopped = self._stopping.is_set()
            if stopping:
                self._send(Command.STOP)
            if stopping or time.monotonic() - polled >= _POLL_S:
                polled = time.monotonic()
                self._send(Command.WIDTH, b"\0\0\0")
                self._send(Command.GRASPING_STATE, b"\0\0\0")
            try:
                assert self._socket is not None
                socket_number = self._socket.fileno()
                ready, _, _ = select.select([socket_number, self._wake[0]], [], [], _POLL_S)
                if self._wake[0] in ready:
                    os.read(self._wake[0], 64)
                if socket_number not in ready:
                    self._check_silence()
                    continue
                data = self._socket.recv(4096)
                if not data:
                    self._problem = "it closed the connection: check its power and cable"
                    return
                received += data
                while (message := unpacked(received)) is not None:
                    command, payload, received = message
                    self._hear(command, payload)
            except (OSError, Broken) as error:
                self._problem = f"the connection was lost ({error}): check its power and cable"
                return

    def _check_silence(self) -> None:
        if time.monotonic() - self._heard > self._settings.timeout_s:
            self._problem = f"it has not answered for {self._settings.timeout_s:g} s: check its power and cable"
            self._closing.set()

    def _hear(self, command: int, payload: bytes) -> None:
        self._heard = time.monotonic()
        status = int.from_bytes(payload[:2], "little")
        if status == Status.COMMAND_PENDING:
            return
        if command in _MOTIONS:
            self._begun -= 1
        if status == Status.SUCCESS:
            if command == Command.WIDTH:
                self._width = FLOAT.unpack_from(payload, 2)[0] / 1000
                self._answered.set()
            elif command == Command.GRASPING_STATE:
                self._state = Grasping(payload[2])
            return
        # Fingers that met nothing, or what another command ended, are no fault.
        ended = status in (Status.COMMAND_ABORTED, Status.ALREADY_RUNNING)
        if ended or (command == Command.GRASP and status in (Status.AXIS_BLOCKED, Status.TIMEOUT)):
            return
        name = Status(status).name if status in set(Status) else str(status)
        remedy = _REMEDIES.get(Status(status), "see its web page") if status in set(Status) else "see its web page"
        self._problem = f"it answers {name.lower().replace('_', ' ')} to {Command(command).name.lower()}: {remedy}"
        self._answered.set()

    def _send(self, command: Command, payload: bytes = b"") -> None:
        with self._lock, contextlib.suppress(OSError):
            if self._socket is not None:
                self._socket.sendall(packed(command, payload))
