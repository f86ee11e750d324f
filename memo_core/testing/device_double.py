"""A test double of a device with a TCP connection: the server thread, its client and the bytes that have arrived.

Subclasses add the protocol and the physics. The real client library connects over loopback, so that a driver is tested
down to its packets.
"""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import threading
import time
from abc import ABC, abstractmethod
from types import TracebackType
from typing import Self

_SEND_S = 5.0  # in which a client takes a message


class DeviceDouble(ABC):
    """One device at ``address``. Use as a context manager, or ``start`` and ``stop``. Without a thread of its own it is
    driven by calls: ``listen``, then ``round`` again and again."""

    period_s = 0.002  # between two rounds of the server thread
    keeps_first_client = False  # whether a second client is turned away; otherwise it replaces the first

    def __init__(self, address: str, port: int) -> None:
        """Touches nothing. Each double of a test needs its own loopback address, such as ``127.0.0.2``."""
        self.address = address
        self.port = port
        self._client: socket.socket | None = None
        self._received = b""  # bytes of messages that are not complete yet
        self._running = False
        self._thread: threading.Thread | None = None

    # -- starting and stopping -----------------------------------------------------------------------------------------
    def start(self) -> None:
        """Serve in a thread. Raises ``OSError`` where the port is taken."""
        self.listen()
        self._thread = threading.Thread(target=self._run, name=type(self).__name__, daemon=True)
        self._thread.start()

    def listen(self) -> None:
        """Accept connections, which ``round`` serves. Raises ``OSError`` where the port is taken."""
        self._listener = socket.create_server((self.address, self.port), backlog=1)
        self._listener.setblocking(False)
        self._last = time.monotonic()
        self._running = True

    def round(self) -> None:
        """Answer what has arrived, and let the device's clock advance once."""
        self._communicate()
        self._cycle()

    def stop(self) -> None:
        """End the thread and all connections, as if the cable was pulled. Idempotent."""
        listening, self._running = self._running, False
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        elif listening:
            self._close_sockets()

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    # -- the server thread ---------------------------------------------------------------------------------------------
    def _run(self) -> None:
        _come_first()
        try:
            while self._running:
                self.round()
        finally:
            self._close_sockets()

    def _communicate(self) -> None:
        self._serve()
        self._accept()

    def _cycle(self) -> None:
        """One round of the device's clock, which is real time unless overridden."""
        now = time.monotonic()
        seconds, self._last = now - self._last, now
        self._advance(seconds)
        time.sleep(self.period_s)

    def _close_sockets(self) -> None:
        for one in (self._client, self._listener):
            if one is not None:
                one.close()
        self._client = None

    def _accept(self) -> None:
        with contextlib.suppress(BlockingIOError):
            client, (host, *_) = self._listener.accept()
            if self._client is not None and self.keeps_first_client:
                client.close()
                return
            while self._client is not None and self._serve():
                pass  # what the replaced client said last counts
            if self._client is not None:
                self._disconnect()
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._client, self._received = client, b""
            self._connected(host)

    def _serve(self) -> bool:
        """Answer what the client has sent, or take notice that it has gone. Returns whether there was either."""
        if self._client is None:
            return False
        try:
            data = self._client.recv(65536)
        except BlockingIOError:
            return False
        except OSError:
            data = b""
        if not data:
            self._disconnect()
        else:
            self._received += data
            self._answer_received()
        return True

    def _disconnect(self) -> None:
        assert self._client is not None
        self._client.close()
        self._client = None
        self._disconnected()

    def _send(self, message: bytes) -> None:
        if self._client is None:
            return
        with contextlib.suppress(OSError):
            self._client.settimeout(_SEND_S)
            try:
                self._client.sendall(message)
            finally:
                self._client.setblocking(False)

    # -- for subclasses ------------------------------------------------------------------------------------------------
    @abstractmethod
    def _answer_received(self) -> None:
        """Answer every complete message in ``_received`` and remove it from there."""

    def _advance(self, seconds: float) -> None:
        """Let the device's mechanics move for ``seconds``."""

    def _connected(self, host: str) -> None:
        """A client at ``host`` has connected."""

    def _disconnected(self) -> None:
        """The client has closed the connection, or died."""


def _come_first() -> None:
    """Where the calling thread has inherited real-time priority, raise it by one: a device goes on whatever its client
    computes, while threads of one priority wait for each other (``sched(7)``)."""
    if sys.platform != "linux" or not (priority := os.sched_getparam(0).sched_priority):
        return
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.sched_getscheduler(0), os.sched_param(priority + 1))
