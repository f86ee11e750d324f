"""A client of openpi's websocket protocol: one frame with facts about the policy, then an answer for each observation.

The server's own ping is not answered while it computes, and its public client pins an old NumPy; hence our own.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self, TypeVar

import attrs
import numpy as np

from memo_core.plugin import Array, BackendLost, BackendUnavailable, StopSwitch, abandonable
from memo_vla.settings import VlaSettings
from memo_vla.wire import WireError, pack, unpack

_MOST_BYTES = 64 << 20  # of one frame
_SAID = 300  # characters of a server's own words that are repeated
_T = TypeVar("_T")


@attrs.frozen(eq=False)
class Chunk:
    """Actions (H, D) as the server sent them, and the seconds from the question to the answer."""

    actions: Array
    took_s: float


class PolicyClient:
    """A connection to a policy server, for one run. Use as a context manager; a stop abandons every wait at once."""

    def __init__(self, settings: VlaSettings, stop: StopSwitch) -> None:
        """Prepare a client; nothing is connected.

        Args:
            settings: address, key and patience.
            stop: switch that ends every wait with ``Stopped``.
        """
        self._settings = settings
        self._stop = stop
        self._socket: Any = None
        self.facts: dict[Any, Any] = {}  # what the server said of its policy

    def __enter__(self) -> Self:
        """Connect. Raises ``BackendUnavailable`` where nothing answers, ``BackendLost``, ``Stopped``."""
        self._socket = self._wait("connecting to the policy server", self._connected)
        try:
            facts = self._received("its first message")
            if not isinstance(facts, dict):
                raise self._error("its first message is no map of facts about the policy", "is it a policy server?")
        except BaseException:
            _drop(self._socket)
            raise
        self.facts = facts
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        socket, self._socket = self._socket, None
        if socket is not None and error is None:
            socket.close()
        elif socket is not None:
            _drop(socket)

    def ask(self, observation: dict[str, Any], least: int, width: int) -> Chunk:
        """The policy's next actions.

        Args:
            observation: pictures, state and instruction by the policy's keys.
            least: number of actions that are wanted at least.
            width: values of an action.

        Returns:
            The actions, all finite.

        Raises:
            BackendLost: for a server that stalls, leaves, reports an error, or answers anything else.
            Stopped: if the stop is pressed meanwhile.
        """
        frame, started = pack(observation), time.monotonic()
        answer = self._received("an answer", frame)
        took_s = time.monotonic() - started
        actions = answer.get("actions") if isinstance(answer, dict) else None
        if not isinstance(actions, np.ndarray):
            raise self._error("its answer has no array 'actions'", "is it a policy server?")
        if actions.ndim != 2 or len(actions) < least or actions.shape[1] != width:
            wanted = f"at least {least} actions of {width} values"
            raise self._error(
                f"it sent actions of shape {actions.shape}, not {wanted}", "method.horizon, method.preset"
            )
        if not np.isfinite(actions).all():
            raise self._error("it sent actions that are not finite", "look at the policy and its normalisation")
        return Chunk(actions.astype(float), took_s)

    # -- the connection ------------------------------------------------------------------------------------------------
    def _connected(self) -> Any:
        from websockets.exceptions import WebSocketException
        from websockets.sync.client import connect

        settings = self._settings
        key = os.environ.get(settings.api_key_env, "") if settings.api_key_env else ""
        try:
            return connect(
                settings.url,
                additional_headers={"Authorization": f"Api-Key {key}"} if key else None,
                open_timeout=settings.timeout_s,
                ping_interval=None,  # a policy that computes answers no ping; the wait for its answer is limited
                close_timeout=1.0,
                compression=None,
                max_size=_MOST_BYTES,
                proxy=None,
            )
        except (OSError, TimeoutError, WebSocketException) as error:
            remedy = "start the policy server (memo policy-server DATASET, or openpi's), or set method.url"
            raise BackendUnavailable("policy server", settings.url, _line(error), remedy) from None

    def _received(self, what: str, frame: bytes | None = None) -> Any:
        """The next message of the server, after ``frame`` was sent."""
        from websockets.exceptions import ConnectionClosed

        socket, patience = self._socket, self._settings.timeout_s

        def exchange() -> str | bytes:
            if frame is not None:
                socket.send(frame)
            return socket.recv(timeout=patience)

        try:
            answer = self._wait("waiting for the policy server", exchange)
        except TimeoutError:
            problem = f"did not send {what} within {patience:g} s"
            raise self._error(problem, "method.timeout_s, or a faster server") from None
        except (ConnectionClosed, OSError) as error:
            raise self._error(f"closed the connection ({_line(error)})", "see the server's own output") from None
        if isinstance(answer, str):
            raise self._error(f"reports an error: {_last_line(answer)}", "see the server's own output")
        try:
            return unpack(answer)
        except WireError as error:
            raise self._error(f"sent {error}", "is it a policy server?") from None

    def _wait(self, where: str, work: Callable[[], _T]) -> _T:
        return abandonable(self._stop, where, work, self._late)

    def _late(self, result: Any) -> None:
        """Drop the connection that a stop left behind."""
        if hasattr(result, "close_socket"):
            _drop(result)

    def _error(self, problem: str, remedy: str) -> BackendLost:
        return BackendLost("policy server", self._settings.url, problem, remedy)


def _drop(socket: Any) -> None:
    """Close a connection at once: a server that computes, or has stalled, does not answer the closing handshake."""
    socket.close_socket()


def _line(error: BaseException) -> str:
    return (" ".join(str(error).split()) or type(error).__name__)[:_SAID]


def _last_line(text: str) -> str:
    """The last line of a traceback, which names the error; control characters are left out."""
    lines = [line.strip() for line in text.splitlines() if line.strip()] or ["nothing more"]
    return "".join(one for one in lines[-1] if one.isprintable())[:_SAID]
