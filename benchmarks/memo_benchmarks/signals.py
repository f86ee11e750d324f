"""Signals at random moments of real commands, each in a process of its own (``memo bench signals``).

``memo run``, ``memo exec``, ``memo cluster`` and a benchmark in turn get each kind of signal. After each: the exit code
is one of those documented, nothing aborted, stderr holds no traceback and no bug, no process is left, the temporary
directory is empty, and a run that had begun has its summary. Linux only.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import attrs

from memo_benchmarks.kept_rows import measured_rows
from memo_benchmarks.processes import adopt_orphans, children, orphans
from memo_core.skillbook.book import Skillbook

KINDS = ("SIGINT once", "SIGINT twice", "SIGTERM", "SIGHUP", "closed pipe")
COMMANDS = (
    "run",
    "run",
    "exec",
    "run",
    "cluster",
    "run",
    "bench",
)  # as often as that; seven, so that each meets each kind
DOCUMENTED = (0, 1, 130)  # done, not done, ended by a person
TASK = "put-the-cube-away"
_SPAN_S = {"run": 6.0, "exec": 5.0, "cluster": 2.5, "bench": 3.0}  # after its start, within which the signal falls
_SHORTLY_S = 0.1  # after an attempt's beginning: the moment that aborted runs, when motion is first planned
_LONGEST_S = 600.0  # a process that takes longer after its signal hangs; a run that one SIGINT stops goes on to its end
_NOT_OURS = {".ses"}  # a file of onnxruntime's, one a machine
_BAD = ("terminate called", "Traceback", "Fatal Python error", "(a bug;", "Aborted", "Exception ignored")
_MOVING = """
while True:
    for y in [-0.2, 0.2]:
        print("to", y)
        move_to([0.45, y, 0.3], top_orientation())
"""


@attrs.frozen
class Trial:
    """One command and what was wrong with its end; ``faults`` is empty when nothing was. ``taken_over``: whether the
    command had taken over the signals; before that Python, which is still starting, has its own way with them.
    ``seconds``: from the command's start until everything was checked."""

    command: str
    kind: str
    exit_code: int
    taken_over: bool
    faults: tuple[str, ...]
    seconds: float


def bench_signals(
    signals: int, seed: int = 0, progress: Callable[[float], None] | None = None, out: Path | None = None
) -> dict[str, Any]:
    """Run ``signals`` trials, commands and kinds in turn; those that the folder ``out`` holds are not run again.
    ``kept`` says that none had a fault. Raises ``InvalidArgument`` where the system has no ``/proc``."""
    adopt_orphans("bench signals")

    def measure(number: int) -> dict[str, Any]:
        rng = random.Random(f"{seed} {number}")
        return attrs.asdict(_trial(COMMANDS[number % len(COMMANDS)], KINDS[number % len(KINDS)], rng))

    trials = [Trial(**row) for row in measured_rows(out, "signals", seed, signals, measure, progress)]
    kinds = [_summed("kind", kind, [trial for trial in trials if trial.kind == kind]) for kind in KINDS]
    by_command = dict.fromkeys(COMMANDS)
    commands = [_summed("command", name, [trial for trial in trials if trial.command == name]) for name in by_command]
    faults = [f"{trial.command}, {trial.kind}: {fault}" for trial in trials for fault in trial.faults]
    summary = {"kinds": kinds, "commands": commands, "signals": len(trials)}
    return summary | {"faults": faults, "kept": len(trials) == signals and not faults}


def _summed(of: str, name: str, trials: list[Trial]) -> dict[str, Any]:
    codes = [trial.exit_code for trial in trials]
    return {
        of: name,
        "signals": len(trials),
        "after the signals were taken over": sum(trial.taken_over for trial in trials),
        "exit codes": {code: codes.count(code) for code in sorted(set(codes))},
        "with faults": sum(bool(trial.faults) for trial in trials),
        "seconds": round(sum(trial.seconds for trial in trials)),
    }


def _trial(command: str, kind: str, rng: random.Random) -> Trial:
    with tempfile.TemporaryDirectory(prefix="memo-bench-") as folder:
        place, started = Path(folder), time.monotonic()
        scratch, said = place / "tmp", place / "stderr"
        scratch.mkdir()
        ours = set(children())
        pipe = subprocess.PIPE if kind == "closed pipe" else subprocess.DEVNULL
        with said.open("w") as stderr:
            process = subprocess.Popen(
                [sys.executable, "-m", "memo_core.cli.main", *_arguments(command, place)],
                stdin=subprocess.DEVNULL,
                stdout=pipe,
                stderr=pipe if kind == "closed pipe" else stderr,
                cwd=place,
                env={**os.environ, "TMPDIR": str(scratch)},
                start_new_session=True,
            )
            taken_over = _strike(process, command, kind, place / "runs", rng)
            try:
                code = process.wait(_LONGEST_S)
            except subprocess.TimeoutExpired:
                code = _given_up(process, kind == "closed pipe")
        left = orphans(ours | {process.pid})
        faults = _faults(code, said.read_text(errors="replace"), scratch, place / "runs", left, taken_over)
        return Trial(command, kind, code, taken_over, tuple(faults), round(time.monotonic() - started, 1))


def _given_up(process: subprocess.Popen[bytes], endless: bool) -> int:
    """End a process that goes on; one whose reader went away may, since nothing else tells it to end."""
    if endless:
        process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.wait(_LONGEST_S)
    process.kill()
    return process.wait()


def _arguments(command: str, place: Path) -> list[str]:
    if command == "run":
        found = ["run", "--task", TASK, "--teacher", "silent", "--set", "run.video=off"]
        found += ["--set", "run.subtasks=1"]  # no signal falls later
        return [*found, "--book", f"{place}/book.db", "--out", f"{place}/runs"]
    if command == "exec":
        (place / "moving.py").write_text(_MOVING)
        return ["exec", str(place / "moving.py"), "--task", TASK]
    if command == "cluster":
        with Skillbook(str(place / "book.db")) as book:
            for number in range(16):
                key = f"OPEN({('door', 'drawer', 'jar', 'box')[number % 4]})"
                said = book.record_feedback(f"pull it slowly {number}", "ana", subtask=key)
                book.add_lessons(said, key, [f"Pull the handle slowly, for the {number}th time.", "Pull slowly."])
        return ["cluster", "--book", f"{place}/book.db"]
    return ["bench", "startup", "--runs", "2"]


def _strike(process: subprocess.Popen[bytes], command: str, kind: str, runs: Path, rng: random.Random) -> bool:
    """Wait for the moment and send the signal; whether the command had taken over the signals by then."""
    deadline = time.monotonic() + 60.0
    if command == "run" and rng.random() < 0.5:  # shortly after an attempt's beginning
        while process.poll() is None and time.monotonic() < deadline and not _attempted(runs):
            time.sleep(0.005)
        time.sleep(rng.uniform(0.0, _SHORTLY_S))
    else:
        time.sleep(rng.uniform(0.3, _SPAN_S[command]))
    taken_over = _catches_hangups(process.pid)
    if kind == "closed pipe":
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()
        if command == "exec":  # its program never ends
            time.sleep(0.5)
            process.send_signal(signal.SIGTERM)
        return taken_over
    number = {"SIGTERM": signal.SIGTERM, "SIGHUP": signal.SIGHUP}.get(kind, signal.SIGINT)
    process.send_signal(number)
    if kind == "SIGINT twice":
        time.sleep(rng.uniform(0.02, 0.5))
        process.send_signal(number)
    return taken_over


def _catches_hangups(pid: int) -> bool:
    """Whether a process has a handler for SIGHUP, which Python does not install by itself; True where it has ended."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return True
    caught = re.search(r"^SigCgt:\s*([0-9a-f]+)$", status, re.MULTILINE)
    return caught is None or bool(int(caught.group(1), 16) >> (signal.SIGHUP - 1) & 1)


def _attempted(runs: Path) -> bool:
    return any("CodeWritten" in file.read_text(errors="replace") for file in runs.glob("*/*.jsonl"))


def _faults(code: int, said: str, scratch: Path, runs: Path, left: list[str], taken_over: bool) -> Iterator[str]:
    if taken_over:
        if code not in DOCUMENTED:
            yield f"exit code {code}: {' '.join(said.split())[-200:]}"
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
