"""Draws damaged inputs, has them read in a process that can be killed, and keeps those that found something."""

from __future__ import annotations

import contextlib
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from memo_benchmarks.fuzz.child import SECRET, faults_of
from memo_benchmarks.fuzz.kind import Command
from memo_core.runlog.whole_files import write_whole

WALL_S = 180.0  # by the clock, for the commands of one input
CPU_S = 10.0  # of the process that reads it; killed at twice that
GROWTH_MIB = 400.0  # of its memory over one input
START_S = 180.0
EACH_PROCESS = 1_000  # inputs, then a new one
REAL_EVERY = 500  # one input of so many is read once more by real processes, with nothing stood in
PLACE = b"@PLACE@"  # stands for the folder of an input in the files that are kept of it
CASE = "case.json"


class Child:
    """A process of ``fuzz.child`` with a folder for its inputs. Use as a context manager."""

    def __init__(self, kind: str = "", seed: int = 0) -> None:
        """``kind`` empty: for commands on files that are there, nothing is drawn."""
        self._kind, self._seed = kind, seed
        shared = Path("/dev/shm")
        self._root = Path(tempfile.mkdtemp(prefix="memo-fuzz-", dir=shared if shared.is_dir() else None))
        self.place = self._root / "a" / "b" / "place"  # deep: what names its parents stays inside
        self._process: subprocess.Popen[bytes] | None = None
        self._answers = -1
        self._unread = b""
        self._served = 0

    def __enter__(self) -> Child:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.kill()
        shutil.rmtree(self._root, ignore_errors=True)

    def kill(self) -> None:
        """End the process. Idempotent."""
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        assert process.stdin is not None
        with contextlib.suppress(OSError):
            process.stdin.close()
        os.close(self._answers)

    def draw(self, number: int) -> list[Command]:
        """Write an input to the place; the commands that read it."""
        if self._process is None or self._served >= EACH_PROCESS:
            self._start()
        answer = self._ask({"draw": number})
        if answer is None:
            raise RuntimeError(f"{self._kind} {number}: the input could not be drawn ({self._said()})")
        commands: list[Command] = answer["commands"]
        return commands

    def run(self, commands: Sequence[Command]) -> dict[str, Any]:
        """What came of commands on what stands in the place: ``codes``, ``faults`` and what they took."""
        if self._process is None:
            self._start()
        self._served += 1
        found = self._ask({"run": commands})
        if found is None:
            assert self._process is not None
            code = self._process.poll()
            fault = (
                f"hang: over {WALL_S:g} s, or {2 * CPU_S:g} s of the processor"
                if code is None
                else f"died: exit {code}, {self._said()}"
            )
            self.kill()
            return {"faults": [fault], "codes": []}
        if found["cpu_s"] > CPU_S:
            found["faults"].append(f"hang: {found['cpu_s']:.1f} s of the processor")
        if found["grown_mib"] > GROWTH_MIB:
            found["faults"].append(f"memory: {found['grown_mib']:.0f} MiB more")
        return found

    def _ask(self, asked: dict[str, Any]) -> dict[str, Any] | None:
        assert self._process is not None and self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(asked).encode() + b"\n")
            self._process.stdin.flush()
        return self._line(WALL_S)

    def _said(self) -> str:
        with contextlib.suppress(OSError):
            return (self._root / "said").read_text(errors="replace")[-500:]
        return ""

    def _start(self) -> None:
        self.kill()
        self._answers, theirs = os.pipe()
        command = [sys.executable, "-X", "faulthandler", "-m", "memo_benchmarks.fuzz.child"]
        with (self._root / "said").open("wb") as said:
            self._process = subprocess.Popen(
                [*command, self._kind, str(self._seed), str(self.place), str(theirs)],
                stdin=subprocess.PIPE,
                stdout=said,
                stderr=said,
                pass_fds=(theirs,),
                env=environment(),
                start_new_session=True,
            )
        os.close(theirs)
        self._unread, self._served = b"", 0
        if self._line(START_S) is None:
            raise RuntimeError(f"the process for {self._kind} did not start: {self._said()}")

    def _cpu(self) -> float:
        """Seconds of the processor that the process took; 0 where the system does not tell."""
        assert self._process is not None
        with contextlib.suppress(OSError):
            fields = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
            return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        return 0.0

    def _line(self, seconds: float) -> dict[str, Any] | None:
        """The next answer; None when the process ended or took longer."""
        deadline, cpu = time.monotonic() + seconds, self._cpu() + max(2 * CPU_S, seconds / 5)
        while b"\n" not in self._unread:
            if not select.select([self._answers], [], [], 0.5)[0]:
                if time.monotonic() > deadline or self._cpu() > cpu:
                    return None
                continue
            piece = os.read(self._answers, 1 << 16)
            if not piece:
                assert self._process is not None
                self._process.wait()
                return None
            self._unread += piece
        line, _, self._unread = self._unread.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        return answer


def environment() -> dict[str, str]:
    """Of the processes that read damaged inputs: with a secret that nothing may print."""
    kept = {name: value for name, value in os.environ.items() if name != "MEMO_DEBUG"}
    return kept | {"FUZZ_API_KEY": SECRET, "PYTHONHASHSEED": "0"}


def bench_fuzz(
    kind: str, count: int, seed: int, out: Path, progress: Callable[[int], None] = lambda done: None
) -> dict[str, Any]:
    """Read ``count`` inputs of a kind. What is done already according to ``out`` is not done again; inputs that found
    something are kept there, a folder each."""
    state_file = out / f"{kind}-{seed}.json"
    state: dict[str, Any] = {"done": 0, "codes": {}, "real": 0, "slowest_cpu_s": 0.0, "most_mib": 0.0, "finds": []}
    if state_file.exists():
        state = json.loads(state_file.read_text())
    codes = Counter[str](state["codes"])
    with Child(kind, seed) as child:
        while state["done"] < count:
            number = state["done"]
            commands = child.draw(number)
            found = child.run(commands)
            faults = list(found["faults"])
            if faults:
                _keep(child, number, commands, out / f"{kind}-{seed}-{number}", again=bool(found["codes"]))
            if number % REAL_EVERY == REAL_EVERY - 1:
                state["real"] += 1
                faults += _real(child, number)
            codes.update(map(str, found["codes"]))
            state["slowest_cpu_s"] = round(max(state["slowest_cpu_s"], found.get("cpu_s", 0.0)), 2)
            state["most_mib"] = round(max(state["most_mib"], found.get("grown_mib", 0.0)))
            if faults:
                state["finds"].append({"input": number, "faults": faults})
            state |= {"done": number + 1, "codes": dict(codes)}
            if faults or state["done"] % 100 == 0 or state["done"] == count:
                write_whole(state_file, json.dumps(state, indent=1))
            progress(state["done"])
    return {"kind": kind, "seed": seed, "inputs": state["done"], **state}


def _real(child: Child, number: int) -> list[str]:
    """The same input, drawn anew and read by processes of its own."""
    commands = child.draw(number)
    faults = []
    for command in commands:
        try:
            ended = subprocess.run(
                [sys.executable, "-m", "memo_core.cli.main", *command],
                cwd=child.place,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                env=environment(),
                timeout=2 * WALL_S,
                text=True,
                errors="surrogateescape",
            )
        except subprocess.TimeoutExpired:
            faults.append(f"memo {' '.join(command)}: hang: over {2 * WALL_S:g} s in a process of its own")
            continue
        faults += [f"memo {' '.join(command)}: {f}" for f in faults_of(ended.returncode, ended.stdout, ended.stderr)]
    return faults


def _keep(child: Child, number: int, commands: Sequence[Command], folder: Path, again: bool) -> None:
    """The files of an input: drawn ``again``, as they were before it was read, or as a process that was killed left
    them."""
    if again:
        child.draw(number)
    shutil.rmtree(folder, ignore_errors=True)
    for file in sorted(child.place.rglob("*")):
        if file.is_file():
            kept = folder / file.relative_to(child.place)
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.write_bytes(file.read_bytes().replace(bytes(child.place), PLACE))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / CASE).write_text(json.dumps({"commands": commands}, indent=1) + "\n")


def replay(child: Child, folder: Path) -> list[str]:
    """What is wrong now with an input that was kept."""
    shutil.rmtree(child.place, ignore_errors=True)
    shutil.copytree(folder, child.place)
    for file in child.place.rglob("*"):
        if file.is_file() and PLACE in (data := file.read_bytes()):
            file.write_bytes(data.replace(PLACE, bytes(child.place)))
    faults: list[str] = child.run(json.loads((folder / CASE).read_text())["commands"])["faults"]
    return faults
