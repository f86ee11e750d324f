"""Observing and cutting the connection of one call. litellm renames every provider's errors and reports a body that
cannot be parsed as a "500". So the server's response is read at its source: httpx reports the steps of a request to a
``trace`` callback.
"""

from __future__ import annotations

import contextlib
import socket
import threading
import time
import urllib.request
from typing import Any

_CONNECT_S = 10.0
_here = threading.local()


class Line:
    """The connections of one call. Used by the thread that calls; ``cut`` by any."""

    def __init__(self, end: float) -> None:
        """``end``: the monotonic time at which the call is over."""
        self.end = end
        self.reset()
        self._sockets: list[socket.socket] = []
        self._cut = False

    def reset(self) -> None:
        """Prepare for another request of the same call."""
        self.connected = False
        self.sent = False  # the whole question left
        self.status: int | None = None
        self.headers: dict[str, str] = {}
        self.failed: BaseException | None = None

    @property
    def retry_after(self) -> str:
        return self.headers.get("retry-after", "")

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
        if step == "connect_tcp.complete":
            self.connected = True
            sock = info["return_value"].get_extra_info("socket")
            if sock is not None:
                self._sockets.append(sock)
            if self._cut:
                self.cut()
        elif step == "send_request_body.complete":
            self.sent = True
        elif step == "receive_response_headers.complete":
            _, status, _, headers, *_ = info["return_value"]
            self.status = int(status)
            self.headers = {key.decode("latin-1").lower(): value.decode("latin-1") for key, value in headers}
        elif step.endswith(".failed"):
            self.failed = info.get("exception")


def traced_transport() -> Any:
    """An ``httpx`` transport for every connection that litellm makes: it reports to the ``Line`` of the calling thread
    and limits each step to the remaining time of the call. Connections are not reused: minutes of robot motion pass
    between two questions, and a connection that was lost in the meantime would fail the next one. Proxies are those of
    the environment (``HTTPS_PROXY``, ``NO_PROXY``), which httpx leaves to the transport when it is given one.
    """
    import httpx
    from litellm.llms.custom_httpx.http_handler import get_ssl_configuration

    limits = httpx.Limits(max_keepalive_connections=0)
    verify = get_ssl_configuration()

    class Traced(httpx.BaseTransport):
        def __init__(self) -> None:
            self._inner: dict[str, httpx.HTTPTransport] = {}
            self._lock = threading.Lock()

        def handle_request(self, request: httpx.Request) -> httpx.Response:
            line = getattr(_here, "line", None)
            if line is not None:
                request.extensions["trace"] = line.trace
                left = max(0.001, line.end - time.monotonic())
                request.extensions["timeout"] = {
                    "connect": min(_CONNECT_S, left),
                    "read": left,
                    "write": left,
                    "pool": left,
                }
            return self._towards(request.url).handle_request(request)

        def close(self) -> None:
            """Clients that litellm makes and drops share this; without kept connections there is nothing to close."""

        def _towards(self, url: httpx.URL) -> httpx.HTTPTransport:
            proxy = "" if urllib.request.proxy_bypass(url.host) else urllib.request.getproxies().get(url.scheme, "")
            with self._lock:
                if proxy not in self._inner:
                    self._inner[proxy] = httpx.HTTPTransport(verify=verify, limits=limits, proxy=proxy or None)
                return self._inner[proxy]

    return Traced()
