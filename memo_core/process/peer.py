"""A program under another Python that answers requests: for a library that cannot share MEMO's environment.

The other side is ``peer_program.py``, started with one end of a socket pair; there is no port, no file and no pickle,
and what the library prints cannot get in between. The program ends when this end is closed, so also with this process.
"""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import attrs
import numpy as np

from memo_core.errors import BackendLost, BackendUnavailable, MemoError
from memo_core.process import peer_program

_LAST = 3  # lines of what the program printed that are quoted when it ends
_GRACE_S = 3.0  # to end by itself


@attrs.define(auto_exc=True, eq=False)
class PeerError(MemoError):
    """An operation failed on the other side. ``error``: name of the exception's class there."""

    peer: str
    operation: str
    error: str
    text: str

    def __str__(self) -> str:
        return f"{self.peer}: {self.operation} failed ({self.error}: {self.text})"


class Peer:
    """One such program.

    Args:
        kind: kind of the backend that it belongs to, for errors, such as ``simulator``.
        name: name of that backend.
        python: the interpreter that runs the script.
        script: file that defines ``operations`` (``peer_program``).
        arguments: further arguments for the script.
        environment: environment variables to add; only those of a safe few are passed on otherwise.
        remedy: what to do when the program cannot be started, for errors.
        memory: what is known of its need for memory, such as ``about 1.5 GB``, for errors.
    """

    def __init__(
        self,
        kind: str,
        name: str,
        python: Path,
        script: Path,
        arguments: Sequence[str] = (),
        environment: dict[str, str] | None = None,
        remedy: str = "",
        memory: str = "",
    ) -> None:
        self._kind, self._name, self._remedy, self._memory = kind, name, remedy, memory
        self._command = [str(python), str(Path(peer_program.__file__)), "", str(script), *arguments]
        self._environment = environment or {}
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._link: socket.socket | None = None
        self._printed: IO[bytes] | None = None

    # -- life ----------------------------------------------------------------------------------------------------------
    def open(self) -> None:
        """Start the program. Idempotent. Raises ``BackendUnavailable`` if it cannot be started."""
        if self._process is not None:
            return
        here, there = socket.socketpair()
        self._printed = tempfile.TemporaryFile()  # noqa: SIM115 - open as long as the program
        self._command[2] = str(there.fileno())
        try:
            self._process = subprocess.Popen(
                self._command,
                stdin=subprocess.DEVNULL,
                stdout=self._printed,
                stderr=self._printed,
                pass_fds=(there.fileno(),),
                env=_environment() | self._environment,
                start_new_session=True,  # Ctrl-C in a terminal goes to a whole group of processes
            )
        except OSError as error:
            here.close()
            problem = f"{self._command[0]} cannot be run ({error.strerror})"
            raise BackendUnavailable(self._kind, self._name, problem, self._remedy) from None
        finally:
            there.close()
        self._link = here

    @property
    def alive(self) -> bool:
        """Whether the program runs."""
        return self._process is not None and self._process.poll() is None

    def close(self) -> None:
        """End the program; kill it if it does not end by itself. Idempotent."""
        link, process, self._link = self._link, self._process, None
        if link is not None:
            link.close()
        if process is None:
            return
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_GRACE_S)
        self._kill()
        self._process = None
        if self._printed is not None:
            self._printed.close()

    def _kill(self) -> None:
        process = self._process
        if process is not None and process.poll() is None:
            process.kill()
            process.wait()

    # -- requests ------------------------------------------------------------------------------------------------------
    def call(
        self, operation: str, arrays: Sequence[np.ndarray] = (), *, seconds: float, **fields: Any
    ) -> tuple[dict[str, Any], list[np.ndarray]]:
        """Ask for an operation and wait for its answer. May be called from any thread.

        Args:
            operation: its name.
            arrays: arrays to send along.
            seconds: longest time to wait (s); a program that takes longer is killed.
            **fields: its arguments, JSON values.

        Returns:
            JSON values and arrays of the answer. The arrays can be written to.

        Raises:
            BackendLost: if the program ended or did not answer in time; it is then no longer alive.
            PeerError: if the operation failed there.
        """
        with self._lock:
            answer, given = self._exchange(peer_program.packed({"op": operation, **fields}, arrays), seconds)
        if "error" in answer:
            raise PeerError(f"{self._kind} {self._name!r}", operation, answer["error"], answer["text"])
        return answer, given

    def _exchange(self, message: bytes, seconds: float) -> tuple[dict[str, Any], list[np.ndarray]]:
        if self._link is None:
            raise BackendUnavailable(self._kind, self._name, "it is not open", "call open() first")
        self._link.settimeout(seconds)
        try:
            self._link.sendall(message)
            return peer_program.receive(self._link)
        except TimeoutError:
            self._kill()
            problem = f"did not answer within {seconds:g} s and was killed"
            raise BackendLost(self._kind, self._name, problem, "if it was only slow, raise its time limit") from None
        except (EOFError, OSError):
            raise self._ended() from None
        except BaseException:  # such as Ctrl-C: an answer that nobody reads would be taken for the next one
            self._kill()
            raise

    def _ended(self) -> MemoError:
        assert self._process is not None
        try:
            code = self._process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            self._kill()
            code = self._process.returncode
        if code == -signal.SIGKILL:
            needs = f" (it needs {self._memory})" if self._memory else ""
            return BackendLost(
                self._kind, self._name, "its process was killed", f"the system does that when memory runs out{needs}"
            )
        how = f"by signal {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
        return BackendLost(self._kind, self._name, f"its process ended {how}{self._quoted()}")

    def _quoted(self) -> str:
        assert self._printed is not None
        self._printed.seek(0)
        lines = self._printed.read().decode(errors="replace").split("\n")
        last = [line.strip() for line in lines if line.strip()][-_LAST:]
        return f": {' / '.join(last)}" if last else ""


def _environment() -> dict[str, str]:
    """Variables that a program needs to run and to draw; no secrets."""
    passed = ("PATH", "HOME", "LANG", "LC_ALL", "TMPDIR", "LD_LIBRARY_PATH", "DISPLAY", "CUDA_VISIBLE_DEVICES")
    drawing = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "XDG_RUNTIME_DIR", "LIBGL_ALWAYS_SOFTWARE", "OMP_NUM_THREADS")
    return {name: os.environ[name] for name in (*passed, *drawing) if name in os.environ}
