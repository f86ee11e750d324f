"""The process in which damaged inputs are read: it may hang, grow or die, and ``bench`` sees that it did.

Started as ``python -m memo_benchmarks.fuzz.child KIND SEED PLACE ANSWERS``. A line of JSON on stdin, ``{"draw":
number}`` or ``{"run": commands}``, is answered by one to the file descriptor ANSWERS.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import resource
import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from random import Random
from typing import Any

from memo_benchmarks.fuzz.kind import Command, Kind
from memo_benchmarks.fuzz.stand_ins import stood_in

SECRET = "sk-fuzz-0123456789"  # the value of FUZZ_API_KEY, which nothing may print
DOCUMENTED = (0, 1, 2, 130)
LONGEST_LINE = 20_000  # characters of an error
_CONTROL = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]|\r(?!\n)")


def kinds() -> dict[str, type[Kind]]:
    """All kinds of input by name."""
    from memo_benchmarks.fuzz.books import Books
    from memo_benchmarks.fuzz.configs import Configs
    from memo_benchmarks.fuzz.imports import Imports
    from memo_benchmarks.fuzz.programs import Programs
    from memo_benchmarks.fuzz.recordings import Recordings
    from memo_benchmarks.fuzz.run_folders import RunFolders

    return {kind.name: kind for kind in (Programs, Imports, Configs, Recordings, RunFolders, Books)}


def faults_of(code: int | None, out: str, err: str) -> Iterator[str]:
    """What is wrong with how a command ended and with what it printed."""
    if code not in DOCUMENTED:
        yield f"exit {code}: {err.strip()[-300:]}"
    if "Traceback (most recent call last)" in err or "Exception ignored" in err:
        yield f"traceback: {err.strip()[-300:]}"
    for name, text in (("stdout", out), ("stderr", err)):
        if found := _CONTROL.search(text):
            yield f"control character on {name}: {text[max(0, found.start() - 60) : found.end() + 20]!r}"
        if SECRET in text:
            yield f"secret on {name}"
    if (longest := max(map(len, err.split("\n")))) > LONGEST_LINE:
        yield f"a line of {longest} characters on stderr"


def run(command: Sequence[str]) -> tuple[int | None, str, str]:
    """``memo`` with these arguments in this process: exit code, stdout, stderr. None: it did not exit."""
    from memo_core.cli.main import main

    streams = [io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2)]
    code: int | None = None
    with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
        try:
            main(list(command))
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else 0 if ended.code is None else None
        except BaseException as error:
            print(f"Traceback (most recent call last): {type(error).__name__}: {error}", file=sys.__stderr__)
            streams[1].write(f"\nTraceback (most recent call last): escaped {type(error).__name__}: {error!r}")
    out, err = (stream.buffer.getvalue().decode("utf-8", "replace") for stream in streams)
    return code, out, err


def emptied(place: Path) -> Path:
    """The folder, empty and entered."""
    os.chdir("/")
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    os.chdir(place)
    return place


def drawn(kind: Kind, seed: int, number: int, place: Path) -> list[Command]:
    """Write one input to the place, emptied; the commands that read it. The same number gives the same damage."""
    return kind.write(emptied(place), Random(f"{kind.name} {seed} {number}"))


def examined(commands: Sequence[Command]) -> dict[str, Any]:
    """Run the commands where the process stands; their exit codes and what was wrong, CPU time (s), memory (MiB)."""
    cpu, before = time.process_time(), _reset_peak()
    codes, faults = [], []
    for command in commands:
        code, out, err = run(command)
        codes.append(code)
        faults += [f"memo {' '.join(command)}: {fault}" for fault in faults_of(code, out, err)]
    return {"codes": codes, "faults": faults, "cpu_s": time.process_time() - cpu, "grown_mib": _peak() - before}


def _reset_peak() -> float:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")
    return _peak()


def _peak() -> float:
    """Peak resident memory of this process since ``_reset_peak`` (MiB); where that is not to be had, since ever."""
    with contextlib.suppress(OSError, IndexError):
        return int(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def prepared(name: str, place: Path) -> Kind:
    """The kind with its examples, made in ``place``."""
    kind = kinds()[name]()

    def memo(command: Sequence[str]) -> str:
        code, out, err = run(command)
        if code not in (0, 1):
            raise RuntimeError(f"no example could be made: memo {' '.join(command)}: {err}")
        return out

    kind.prepare(emptied(place), memo)
    return kind


def serve(name: str, seed: int, place: Path, answers: int) -> None:
    """Answer until stdin ends. ``name`` empty: no inputs are drawn, only commands run."""
    with stood_in(), open(answers, "w") as out:
        kind = prepared(name, place) if name else None
        print(json.dumps({}), file=out, flush=True)
        for line in sys.stdin:
            asked = json.loads(line)
            if "draw" in asked:
                assert kind is not None
                answer = {"commands": drawn(kind, seed, asked["draw"], place)}
            else:
                os.chdir(place)
                answer = examined(asked["run"])
            print(json.dumps(answer), file=out, flush=True)
    os.chdir("/")


if __name__ == "__main__":
    serve(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4]))
