"""A server that speaks openpi's protocol: facts about the policy, then an answer for each observation; an error is its
traceback as text, after which the connection is closed."""

from __future__ import annotations

import http
import threading
import time
import traceback
from types import TracebackType
from typing import Any, Protocol, Self

from memo_core.plugin import BackendUnavailable
from memo_vla.wire import pack, unpack

_INTERNAL_ERROR = 1011  # close code
_MOST_BYTES = 64 << 20  # of one frame


class Playing(Protocol):
    """A policy in one connection."""

    def infer(self, observation: Any) -> dict[str, Any]:
        """The answer to an observation, with ``actions``."""


class Policy(Protocol):
    """A policy that is served; ``begin`` is called for each connection."""

    def begin(self) -> Playing: ...


class PolicyServer:
    """Serves a policy on one address. Use as a context manager; it listens from the beginning of the block."""

    def __init__(self, policy: Policy, host: str = "127.0.0.1", port: int = 0) -> None:
        """Prepare a server.

        Args:
            policy: the policy.
            host: address to listen at.
            port: port to listen at; 0 for any free one.
        """
        self._policy, self._host, self._port = policy, host, port
        self._server: Any = None
        self._thread: threading.Thread | None = None

    @property
    def url(self) -> str:
        """The address that it listens at."""
        host, port = self._server.socket.getsockname()[:2]
        return f"ws://{host}:{port}"

    def __enter__(self) -> Self:
        """Listen. Raises ``BackendUnavailable`` for an address that cannot be listened at."""
        from websockets.sync.server import serve

        try:
            self._server = serve(
                self._connection,
                self._host,
                self._port,
                compression=None,
                max_size=_MOST_BYTES,
                ping_interval=None,
                process_request=_health,
            )
        except OSError as error:
            name = f"{self._host}:{self._port}"
            raise BackendUnavailable("policy server", name, error.strerror or str(error), "another --port") from None
        self._thread = threading.Thread(target=self._server.serve_forever, name="policy-server", daemon=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.shutdown()

    def serve(self) -> None:
        """Wait until the server is shut down, or a ``KeyboardInterrupt``."""
        assert self._thread is not None
        while self._thread.is_alive():
            self._thread.join(0.5)

    def _connection(self, connection: Any) -> None:
        """One client, until it leaves."""
        from websockets.exceptions import ConnectionClosed

        playing, before_s = self._policy.begin(), None
        try:
            connection.send(pack({"policy": type(self._policy).__name__}))
            while True:
                frame = connection.recv()
                started = time.monotonic()
                answer = self._answered(playing, frame)
                if before_s is not None:
                    answer["server_timing"]["prev_total_ms"] = 1000 * before_s
                connection.send(pack(answer))
                before_s = time.monotonic() - started
        except ConnectionClosed:
            return
        except Exception:
            connection.send(traceback.format_exc())
            connection.close(_INTERNAL_ERROR, "the error's traceback is in the previous frame")

    @staticmethod
    def _answered(playing: Playing, frame: str | bytes) -> dict[str, Any]:
        if isinstance(frame, str):
            raise TypeError("an observation is a binary frame, and this one is text")
        started = time.monotonic()
        answer = playing.infer(unpack(frame))
        return answer | {"server_timing": {"infer_ms": 1000 * (time.monotonic() - started)}}


def _health(connection: Any, request: Any) -> Any:
    return connection.respond(http.HTTPStatus.OK, "OK\n") if request.path == "/healthz" else None
