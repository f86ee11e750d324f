"""Observing and cutting the connection of one call. litellm renames every provider's errors, drops their words from
some, and reports a body that cannot be parsed as a "500". So the server's response is read at its source: httpx reports
the steps of a request to a ``trace`` callback, and the body is recorded as it passes.
"""

from __future__ import annotations

import contextlib
import socket
import threading
import time
import urllib.request
from collections.abc import Iterator
from typing import Any

_CONNECT_S = 10.0
_RECORDED = 16 << 10  # bytes of a body's beginning and of its end: more than an error takes
_here = threading.local()


class Line:
    """The connections of one call. Used by the thread that calls; ``cut`` by any."""

    def __init__(self, end: float) -> None:
        """``end``: the monotonic time at which the call is over."""
        self.end = end
        self.reset()
        self._sockets: list[socket.socket] = []
        self._cut = False
        self._tunnel = False

    def reset(self) -> None:
        """Prepare for another request of the same call."""
        self.connected = False
        self.sent = False  # the whole question left
        self.status: int | None = None
        self.headers: dict[str, str] = {}
        self.begins = self.ends = b""  # the beginning and the end of the response's body
        self.failed: BaseException | None = None

    @property
    def retry_after(self) -> str:
        return self.headers.get("retry-after", "")

    @property
    def done(self) -> bool:
        """Whether a stream of OpenAI's protocol has come to its end mark."""
        return b"[DONE]" in self.ends[-32:]

    def receive(self, piece: bytes) -> None:
        """Record a piece of the response's body."""
        self.begins += piece[: _RECORDED - len(self.begins)]
        self.ends = (self.ends + piece)[-_RECORDED:]

    def cut(self) -> None:
        """Close the connections, so that a thread that waits for bytes wakes with an error and the server notices."""
        self._cut = True
        for sock in tuple(self._sockets):
            with contextlib.suppress(OSError):
                sock.shutdown(socket.SHUT_RDWR)

    def __enter__(self) -> Line:
        _here.line = self
        return self

    def __exit__(self, *_: object) -> None:
        _here.line = None

    def trace(self, name: str, info: dict[str, Any]) -> None:
        step = name.partition(".")[2]
        if step == "send_request_headers.started":
            self._tunnel = info["request"].method == b"CONNECT"  # asked of a proxy; the server is behind it
        elif self._tunnel and step == "receive_response_headers.complete":
            self._tunnel_answered(info["return_value"][1])
        elif step == "connect_tcp.complete":
            self.connected = True
            sock = info["return_value"].get_extra_info("socket")
            if sock is not None:
                self._sockets.append(sock)
            if self._cut:
                self.cut()
        elif step == "start_tls.started":
            self.connected = False  # whatever listens there has yet to prove that it is the server
        elif step == "start_tls.complete":
            self.connected = True
        elif step == "send_request_body.complete":
            self.sent = not self._tunnel
        elif step == "receive_response_headers.complete":
            _, status, _, headers, *_ = info["return_value"]
            self.status, self.begins, self.ends = int(status), b"", b""
            self.headers = {key.decode("latin-1").lower(): value.decode("latin-1") for key, value in headers}
        elif step.endswith(".failed") and not isinstance(info.get("exception"), GeneratorExit):  # closed on this side
            self.failed = info.get("exception")

    def _tunnel_answered(self, status: int) -> None:
        if status >= 300:
            self.connected, self.failed = False, ConnectionError(f"the proxy refuses to connect to it ({status})")


def traced_transport() -> Any:
    """An ``httpx`` transport for every connection that litellm makes: it reports to the ``Line`` of the calling thread
    and limits each step to the remaining time of the call. Connections are not reused: minutes of robot motion pass
    between two questions, and a connection that was lost in the meantime would fail the next one. Each request has a
    pool of its own: Python may collect a dropped stream while another request holds its pool's lock, and closing the
    stream takes the lock of the stream's pool. Proxies are those of the environment (``HTTPS_PROXY``, ``NO_PROXY``),
    which httpx leaves to the transport when it is given one.
    """
    import httpx
    from litellm.llms.custom_httpx.http_handler import get_ssl_configuration

    limits = httpx.Limits(max_keepalive_connections=0)
    verify = get_ssl_configuration()

    class Recorded(httpx.SyncByteStream):
        """A response's body that its ``Line`` sees as well."""

        def __init__(self, stream: Any, line: Line) -> None:
            self._stream = stream
            self._line = line

        def __iter__(self) -> Iterator[bytes]:
            for piece in self._stream:
                self._line.receive(piece)
                yield piece

        def close(self) -> None:
            self._stream.close()

    class Traced(httpx.BaseTransport):
        def handle_request(self, request: httpx.Request) -> httpx.Response:
            line: Line | None = getattr(_here, "line", None)
            if line is None:
                return self._towards(request.url).handle_request(request)
            request.extensions["trace"] = line.trace
            left = max(0.001, line.end - time.monotonic())
            request.extensions["timeout"] = {
                "connect": min(_CONNECT_S, left),
                "read": left,
                "write": left,
                "pool": left,
            }
            request.headers["Accept-Encoding"] = "identity"  # the body is recorded as it comes
            response = self._towards(request.url).handle_request(request)
            response.stream = Recorded(response.stream, line)
            return response

        def close(self) -> None:
            """Clients that litellm makes and drops share this; without kept connections there is nothing to close."""

        def _towards(self, url: httpx.URL) -> httpx.HTTPTransport:
            proxy = "" if urllib.request.proxy_bypass(url.host) else urllib.request.getproxies().get(url.scheme, "")
            return httpx.HTTPTransport(verify=verify, limits=limits, proxy=proxy or None)

    return Traced()
