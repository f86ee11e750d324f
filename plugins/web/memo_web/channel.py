"""Messages between the run's process and that of the pages, and the line of its own for the stop."""

from __future__ import annotations

import contextlib
import json
import socket
import struct
import threading
from collections.abc import Iterator
from typing import Any

_LENGTHS = struct.Struct("<II")


class Channel:
    """Messages over one end of a socket pair. A message is a JSON object with a ``kind``, and raw bytes."""

    def __init__(self, link: socket.socket) -> None:
        """Take over a connected socket.

        Args:
            link: one end of a socket pair.
        """
        self._link = link
        self._sending = threading.Lock()

    def send(self, kind: str, blob: bytes = b"", **fields: Any) -> None:
        """Send a message; waits while the other side is behind.

        Args:
            kind: kind of the message.
            blob: raw bytes that go with it.
            **fields: JSON values.

        Raises:
            OSError: if the other side is gone.
        """
        text = json.dumps({"kind": kind, **fields}, ensure_ascii=False).encode(
            "utf-8", "replace"
        )  # half a character is "?"
        with self._sending:
            self._link.sendall(_LENGTHS.pack(len(text), len(blob)) + text + blob)

    def receive(self) -> tuple[dict[str, Any], bytes]:
        """Wait for the next message.

        Returns:
            The JSON object and the raw bytes.

        Raises:
            EOFError: if the other side is gone.
        """
        try:
            text, blob = _LENGTHS.unpack(self._exactly(_LENGTHS.size))
            return json.loads(self._exactly(text)), self._exactly(blob)
        except OSError:
            raise EOFError from None

    def _exactly(self, count: int) -> bytes:
        parts = bytearray(count)
        view = memoryview(parts)
        while view:
            got = self._link.recv_into(view)
            if not got:
                raise EOFError
            view = view[got:]
        return bytes(parts)

    def close(self) -> None:
        """Close this end, which also ends a ``receive`` in another thread. Idempotent."""
        _close(self._link)


class StopLine:
    """A socket that carries only short lines about the stop: ``stop ID``, ``gone`` and ``back`` to the run (a person
    pressed stop; the last page is gone; a page is open again), ``stopping``, ``stopped`` and ``clear`` from it."""

    def __init__(self, link: socket.socket) -> None:
        """Take over a connected socket.

        Args:
            link: one end of a socket pair.
        """
        self._link = link

    def send(self, line: str) -> None:
        """Send a line.

        Args:
            line: printable ASCII.

        Raises:
            OSError: if the other side is gone.
        """
        self._link.sendall(line.encode("ascii") + b"\n")

    def lines(self, every: float | None = None) -> Iterator[str]:
        """Lines as they arrive, until the other side is gone.

        Args:
            every: yield an empty line where none arrived for so long (s); None: wait.

        Yields:
            A line without its end.
        """
        rest = b""
        while True:
            try:
                self._link.settimeout(every)
                got = self._link.recv(4096)
            except TimeoutError:
                yield ""
                continue
            except OSError:
                return
            if not got:
                return
            *lines, rest = (rest + got).split(b"\n")
            yield from (line.decode("ascii", "replace") for line in lines)

    def close(self) -> None:
        """Close this end, which also ends ``lines`` in another thread. Idempotent."""
        _close(self._link)


def _close(link: socket.socket) -> None:
    with contextlib.suppress(OSError):
        link.shutdown(socket.SHUT_RDWR)
    link.close()
