"""Signals at random moments of real runs, each in a process of its own (``memo bench signals``).

After each: the exit code is one of those documented, nothing aborted, stderr holds no traceback and no bug, no
process is left, the temporary directory is empty, and a run that had begun has its summary. Linux only: processes that
lost their parent come to this one, which counts them.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import attrs

from memo_core.errors import InvalidArgument

KINDS = ("SIGINT once", "SIGINT twice", "SIGTERM", "SIGHUP", "closed pipe")
DOCUMENTED = (0, 1, 130)  # of memo run: the task is done, it is not, a person ended the run
TASK = "put-the-cube-away"
_SPAN_S = 6.0  # after the start of the process, within which a signal falls when it does not follow an event
_SHORTLY_S = 0.1  # after an attempt's beginning: the moment that aborted runs, when motion is first planned
_LONGEST_S = 120.0  # a process that takes longer after its signal hangs
_GONE_S = 3.0  # a process without parent may take so long to notice
_SET_CHILD_SUBREAPER = 36
_NOT_OURS = {".ses"}  # a file of onnxruntime's, one a machine
_BAD = ("terminate called", "Traceback", "Fatal Python error", "(a bug;", "Aborted", "Exception ignored")


@attrs.frozen
class Trial:
    """One run and what was wrong with its end; ``faults`` is empty when nothing was."""

    kind: str
    exit_code: int
    began: bool  # whether the run had begun, so that it has a summary
    faults: tuple[str, ...]


def bench_signals(
    signals: int, seed: int = 0, task: str = TASK, progress: Callable[[float], None] | None = None
) -> dict[str, Any]:
    """Run ``signals`` trials, the kinds in turn. ``kept`` says that none had a fault. Raises ``InvalidArgument`` where
    the system has no ``/proc``."""
    if not Path("/proc/self/task").exists():
        raise InvalidArgument("bench signals", "processes cannot be counted here", "Linux")
    ctypes.CDLL(None).prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    rng = random.Random(seed)
    trials = []
    for number in range(signals):
        trials.append(_trial(KINDS[number % len(KINDS)], task, rng))
        if progress is not None:
            progress((number + 1) / signals)
    kinds = [_summed(kind, [trial for trial in trials if trial.kind == kind]) for kind in KINDS]
    faults = [f"{trial.kind}: {fault}" for trial in trials for fault in trial.faults]
    return {"kinds": kinds, "signals": len(trials), "faults": faults, "kept": len(trials) == signals and not faults}


def _summed(kind: str, trials: list[Trial]) -> dict[str, Any]:
    codes = [trial.exit_code for trial in trials]
    return {
        "kind": kind,
        "signals": len(trials),
        "runs begun": sum(trial.began for trial in trials),
        "exit codes": {code: codes.count(code) for code in sorted(set(codes))},
        "with faults": sum(bool(trial.faults) for trial in trials),
    }


def _trial(kind: str, task: str, rng: random.Random) -> Trial:
    with tempfile.TemporaryDirectory(prefix="memo-bench-") as place:
        scratch, runs, said = Path(place) / "tmp", Path(place) / "runs", Path(place) / "stderr"
        scratch.mkdir()
        command = [sys.executable, "-m", "memo_core.cli.main", "run", "--task", task, "--teacher", "silent"]
        command += ["--set", "run.video=off"]
        command += ["--book", f"{place}/book.db", "--out", str(runs)]
        pipe = subprocess.PIPE if kind == "closed pipe" else subprocess.DEVNULL
        with said.open("w") as stderr:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=pipe,
                stderr=pipe if kind == "closed pipe" else stderr,
                env={**os.environ, "TMPDIR": str(scratch)},
                start_new_session=True,
            )
            began = _strike(process, kind, runs, rng)
            try:
                code = process.wait(_LONGEST_S)
            except subprocess.TimeoutExpired:
                process.kill()
                code = process.wait()
        left = _adopted(process.pid)
        words = said.read_text(errors="replace")
        if not began and not words and -code in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            code = 128 - code  # Python itself was still starting, and nothing of ours ran
            faults = [*_faults(130, words, scratch, runs, left)]
        else:
            faults = [*_faults(code, words, scratch, runs, left)]
        return Trial(kind, code, began, tuple(faults))


def _strike(process: subprocess.Popen[bytes], kind: str, runs: Path, rng: random.Random) -> bool:
    """Wait for the moment and send the signal; whether a run had begun by then."""
    deadline = time.monotonic() + 60.0
    if rng.random() < 0.5:  # shortly after an attempt's beginning
        while process.poll() is None and time.monotonic() < deadline and not _attempted(runs):
            time.sleep(0.005)
        time.sleep(rng.uniform(0.0, _SHORTLY_S))
    else:
        time.sleep(rng.uniform(0.3, _SPAN_S))
    began = any(runs.glob("*"))
    if kind == "closed pipe":
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()
        return began
    number = {"SIGTERM": signal.SIGTERM, "SIGHUP": signal.SIGHUP}.get(kind, signal.SIGINT)
    process.send_signal(number)
    if kind == "SIGINT twice":
        time.sleep(rng.uniform(0.02, 0.5))
        process.send_signal(number)
    return began


def _attempted(runs: Path) -> bool:
    return any("CodeWritten" in file.read_text(errors="replace") for file in runs.glob("*/*.jsonl"))


def _faults(code: int, said: str, scratch: Path, runs: Path, left: list[str]) -> Iterator[str]:
    if code not in DOCUMENTED:
        yield f"exit code {code}"
    for sign in _BAD:
        if sign in said:
            yield f"stderr: {' '.join(said[said.index(sign) :].split())[:200]}"
            break
    if left:
        yield f"left running: {', '.join(left)}"
    if names := sorted(set(os.listdir(scratch)) - _NOT_OURS):
        yield f"left in the temporary directory: {', '.join(names)}"
    for run in runs.glob("*"):
        try:
            json.loads((run / "summary.json").read_text())
        except (OSError, ValueError) as error:
            yield f"no summary: {type(error).__name__}"


def _adopted(but: int) -> list[str]:
    """Commands of processes that came to this one when their parent ended, and did not end by themselves. Killed."""
    deadline = time.monotonic() + _GONE_S
    while True:
        pids = [pid for pid in _children() if pid != but]
        for pid in pids:
            with contextlib.suppress(ChildProcessError):
                os.waitpid(pid, os.WNOHANG)
        alive = [pid for pid in pids if pid in _children()]
        if not alive:
            return []
        if time.monotonic() > deadline:
            break
        time.sleep(0.05)
    names = []
    for pid in alive:
        names.append(Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ")[:80])
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
    return names


def _children() -> list[int]:
    found = []
    for file in Path("/proc/self/task").glob("*/children"):
        found += [int(pid) for pid in file.read_text().split()]
    return found
