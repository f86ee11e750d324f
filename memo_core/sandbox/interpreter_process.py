"""The process that interprets generated code: it has no environment, cannot write files, and is killed for a stop."""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import signal
import threading
from collections.abc import Callable, Iterator

from pydantic_monty import Monty, MontySession
from pydantic_monty._binary import find_monty_binary

from memo_core.errors import BackendUnavailable
from memo_core.process.temporary_folders import scratch_folder
from memo_core.sandbox.limits import Limits

_POLL = 0.004  # s between two looks at the stop while code computes


class WorkerPool:
    """Keeps one worker ready; every session gets its own process, so one program cannot affect the next."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._pool: Monty | None = None
        self._kept = contextlib.ExitStack()  # what the starter of the workers lies in
        self._opening = threading.Lock()  # two threads that both need the first worker must not start two pools

    def open(self) -> None:
        """Start the pool. Idempotent, from any thread."""
        with self._opening:
            if self._pool is None:
                self._pool = self._started()

    def _started(self) -> Monty:
        try:
            binary = find_monty_binary()
        except FileNotFoundError as error:
            remedy = "pip install --force-reinstall pydantic-monty, or name it in the variable MONTY_BIN"
            raise BackendUnavailable("sandbox", "pydantic-monty", "its program `monty` is missing", remedy) from error
        if shutil.which("sh"):
            binary = self._confined(binary)
        pool = Monty(
            binary_path=binary,
            min_processes=2,  # a program needs one to be compiled and one to run
            max_processes=4,
            max_checkouts_per_worker=1,
            checkout_timeout=10.0,
            feed_duration_limit_grace=0.5,
            turn_duration_limit_grace=0.5,
        )
        pool.__enter__()
        return pool

    def close(self) -> None:
        """End all workers. Idempotent."""
        pool, self._pool = self._pool, None
        if pool is not None:
            pool.__exit__(None, None, None)
        self._kept.close()

    @contextlib.contextmanager
    def session(self) -> Iterator[MontySession]:
        """A new interpreter in its own process, under the limits."""
        self.open()
        assert self._pool is not None
        with self._pool.checkout(
            script_name="code",
            limits={
                "max_turn_duration_secs": self._limits.seconds_between_calls,
                "max_feed_duration_secs": self._limits.seconds_in_all,
                "max_memory": self._limits.memory,
                "max_recursion_depth": self._limits.recursion,
                "max_suspensions": 4 * self._limits.calls + 1000,
            },
            os_policy={"sleep": "call_host", "datetime": "call_host", "random_start": {"seed": 0}},
            assert_message_annotations=False,
        ) as session:
            yield session

    def _confined(self, binary: str) -> str:
        """A launcher that keeps the interpreter's final messages off the terminal and denies the process file writing,
        core dumps and all but a few file handles, in case code breaks out of the interpreter."""
        limits = "ulimit -c 0; ulimit -f 0; ulimit -n 32"
        script = f'#!/bin/sh\n{limits}\nexec {shlex.quote(binary)} "$@" 2>/dev/null\n'
        if hasattr(os, "memfd_create"):
            # A file without a name: nothing is left in the temporary directory, however this process ends.
            with open(os.memfd_create("memo-sandbox-worker"), "wb") as file:
                file.write(script.encode())
                file.flush()
                os.fchmod(file.fileno(), 0o500)
                handle = os.open(f"/proc/self/fd/{file.fileno()}", os.O_RDONLY)  # one open for writing cannot be run
            self._kept.callback(os.close, handle)
            return f"/proc/{os.getpid()}/fd/{handle}"
        starter = self._kept.enter_context(scratch_folder()) / "worker"
        starter.write_text(script)
        starter.chmod(0o700)
        return str(starter)


class Watch(threading.Thread):
    """Kills a worker within milliseconds of a stop while its code computes and no skill call checks the stop."""

    def __init__(self, pid: int, stopped: Callable[[], bool]) -> None:
        super().__init__(name="sandbox-watch", daemon=True)
        self.fired = False
        self._pid = pid
        self._stopped = stopped
        self._computing = threading.Event()
        self._ended = threading.Event()
        self._kill_lock = threading.Lock()

    def run(self) -> None:
        while True:
            self._computing.wait()
            if self._ended.is_set():
                return
            if self._stopped():
                self.fired = True
                self.kill()
                return
            self._ended.wait(_POLL)

    @contextlib.contextmanager
    def computing(self) -> Iterator[None]:
        """Watch while the code runs in the worker; otherwise the thread sleeps and does not disturb the control
        loop."""
        self._computing.set()
        try:
            yield
        finally:
            if not self._ended.is_set():
                self._computing.clear()

    def kill(self) -> None:
        """Kill the worker immediately."""
        with self._kill_lock:
            if not self._ended.is_set():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(self._pid, signal.SIGKILL)

    def end(self) -> None:
        """Call before the session is returned, since afterwards the process id may belong to another process."""
        with self._kill_lock:
            self._ended.set()
        self._computing.set()
        self.join()


@contextlib.contextmanager
def watching(session: MontySession, stopped: Callable[[], bool]) -> Iterator[Watch]:
    """A watch on the session's worker, which is also killed when the block raises."""
    if session.worker_pid is None:
        raise RuntimeError("the sandbox's worker has no process")
    watch = Watch(session.worker_pid, stopped)
    watch.start()
    try:
        yield watch
    except BaseException:
        watch.kill()
        raise
    finally:
        watch.end()
