"""A test double of a WSG gripper: its binary protocol, simulated fingers, and faults on request."""

from __future__ import annotations

from memo_core.testing.device_double import DeviceDouble
from memo_wsg.protocol import FLOAT, FLOATS, PORT, Command, Grasping, Status, packed, unpacked

_STROKE = 110.0  # mm
_THERE = 0.2  # mm


class WsgDouble(DeviceDouble):
    """``thing``: width (mm) of the object between the fingers; None if there is none."""

    def __init__(self, address: str = "127.0.0.2", port: int = PORT, width: float = _STROKE) -> None:
        super().__init__(address, port)
        self.width = width
        self.thing: float | None = None
        self.force_limit = 80.0
        self.acknowledged = 0
        self._fault: Status | None = None
        self._state = Grasping.IDLE
        self._goal, self._speed = width, 0.0
        self._motion: Command | None = None
        self._announced = False  # whether the client has said that it is about to disconnect

    def fail(self, status: Status) -> None:
        """The next motions are answered with this error."""
        self._fault = status

    def _connected(self, host: str) -> None:
        self._announced = False

    def _disconnected(self) -> None:
        """As a gripper that is set to a fast stop where its client is lost."""
        if not self._announced:
            self._goal = self.width
            self._motion, self._fault = None, Status.ACCESS_DENIED

    def _answer_received(self) -> None:
        while (message := unpacked(self._received)) is not None:
            command, payload, self._received = message
            self._answer(command, payload)

    def _advance(self, seconds: float) -> None:
        way = self._speed * seconds
        width = self.width + min(max(self._goal - self.width, -way), way)
        met = self.thing is not None and self._goal < self.thing <= self.width and width <= self.thing
        self.width = self.thing if met and self.thing is not None else width
        if self._motion is None:
            return
        there = abs(self.width - self._goal) < _THERE
        if self._motion == Command.GRASP and (met or there):
            if met:
                self._end(Grasping.HOLDING)
            else:
                self._end(Grasping.NO_PART_FOUND, Status.CMD_FAILED)
        elif self._motion != Command.GRASP and there:
            self._end(Grasping.IDLE)

    def _end(self, state: Grasping, status: Status = Status.SUCCESS) -> None:
        motion, self._motion, self._state = self._motion, None, state
        if motion is not None:
            self._respond(motion, status)

    def _answer(self, command: int, payload: bytes) -> None:
        if command in (Command.MOVE, Command.GRASP, Command.RELEASE, Command.HOME):
            self._begin(Command(command), payload)
        elif command in (Command.STOP, Command.FAST_STOP):
            self._goal = self.width
            self._end(self._state if self._state == Grasping.HOLDING else Grasping.IDLE, Status.CMD_ABORTED)
            self._respond(command, Status.SUCCESS)
        elif command == Command.DISCONNECT:
            self._announced = True
            self._respond(command, Status.SUCCESS)
        elif command == Command.ACKNOWLEDGE:
            self.acknowledged += 1
            self._fault = None
            self._respond(command, Status.SUCCESS)
        elif command == Command.FORCE_LIMIT:
            self.force_limit = FLOAT.unpack(payload)[0]
            self._respond(command, Status.SUCCESS)
        elif command == Command.GRASPING_STATE:
            self._respond(command, Status.SUCCESS, bytes([self._state]))
        elif command in (Command.WIDTH, Command.SPEED, Command.FORCE):
            values = {Command.WIDTH: self.width, Command.SPEED: self._speed, Command.FORCE: 0.0}
            self._respond(command, Status.SUCCESS, FLOAT.pack(values[Command(command)]))
        else:
            self._respond(command, Status.CMD_UNKNOWN)

    def _begin(self, command: Command, payload: bytes) -> None:
        if self._fault is not None:
            self._respond(command, self._fault)
            return
        if self._motion is not None:
            self._respond(command, Status.ALREADY_RUNNING)
            return
        width, speed = (
            FLOATS.unpack(payload[1:] if command == Command.MOVE else payload) if payload else (_STROKE, 50.0)
        )
        if not 0 <= width <= _STROKE:
            self._respond(command, Status.RANGE_ERROR)
            return
        self._motion, self._goal, self._speed = command, width, speed
        self._state = Grasping.GRASPING if command == Command.GRASP else Grasping.POSITIONING
        self._respond(command, Status.CMD_PENDING)

    def _respond(self, command: int, status: Status, payload: bytes = b"") -> None:
        self._send(packed(command, int(status).to_bytes(2, "little") + payload))
