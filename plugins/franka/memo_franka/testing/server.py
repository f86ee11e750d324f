"""What the doubles of the control box and of the Hand share: framed commands over TCP, states over UDP."""

from __future__ import annotations

import contextlib
import socket
import struct
from abc import abstractmethod

from memo_core.testing.device_double import DeviceDouble


class FrankaServer(DeviceDouble):
    """A server whose messages begin with ``header``: command, number of the message, size in bytes with the header."""

    header: struct.Struct

    def __init__(self, address: str, port: int) -> None:
        super().__init__(address, port)
        self._peer = ("", 0)  # where states are sent to; port 0 until the client has named one

    def listen(self) -> None:
        super().listen()
        self._udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._udp.bind((self.address, 0))
        self._udp.setblocking(False)

    def _close_sockets(self) -> None:
        super()._close_sockets()
        self._udp.close()

    def _connected(self, host: str) -> None:
        self._peer = (host, 0)

    def _disconnected(self) -> None:
        self._peer = ("", 0)

    def _answer_received(self) -> None:
        while len(self._received) >= self.header.size:
            command, number, size = self.header.unpack_from(self._received)
            if len(self._received) < size:
                return
            payload, self._received = self._received[self.header.size : size], self._received[size:]
            self._answer(command, number, payload)

    @abstractmethod
    def _answer(self, command: int, number: int, payload: bytes) -> None:
        """Carry out one command of the client."""

    def _respond(self, command: int, number: int, payload: bytes) -> None:
        self._send(self.header.pack(command, number, self.header.size + len(payload)) + payload)

    def _send_packet(self, packet: bytes) -> None:
        """A state, to the port that the client has named."""
        if not self._peer[1]:
            return
        with contextlib.suppress(OSError):
            self._udp.sendto(packet, self._peer)
