"""What happens to one book in hours of use, drawn at random (``memo bench soak``).

Runs, runs with broken answers of their model, and clusterings take place in this process; kills, stops and full disks
happen to processes of their own, whose runs are resumed afterwards. After each the invariants are checked, and this
process is measured: its memory, files, threads and children are to stay as they are.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import random
import resource
import shutil
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.util import get_temp_dir
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from memo_benchmarks.disturbed_runs import (
    MODELS,
    Disturbed,
    at_random_moment,
    begun,
    experiment_of,
    log_of,
    part,
    server,
)
from memo_benchmarks.processes import adopt_orphans, children, orphans
from memo_core.errors import MemoError
from memo_core.interfaces.llm import Answer, LanguageModel, LanguageModelError, Request
from memo_core.runs.clustering import clustering_of
from memo_core.runs.event_log import read_events
from memo_core.runs.factories import book_of
from memo_core.skillbook.book import Skillbook
from memo_core.stop_switch import StopSwitch
from memo_core.temporary_folders import PREFIX

ACTS = {"run": 4, "broken answers": 2, "kill": 3, "stop": 3, "full disk": 2, "clustering": 2, "clustering killed": 1}
_BROKEN = ("", "```python\nwhile", "\x1b[2J", "DONE DONE", '{"corrections": [', "```python\nimport os\n```", "OPEN()")
_LOG_LINES = 200  # of a run, of which some book entries are known already
_WARM_UP = 0.25  # share of the measurements that are no part of the slopes


class Broken(LanguageModel):
    """Answers one question of four with what is no answer, or not at all."""

    def __init__(self, model: LanguageModel, seed: int) -> None:
        self.name, self._model, self._rng = model.name, model, random.Random(seed)

    def open(self) -> None:
        self._model.open()

    def close(self) -> None:
        self._model.close()

    def answer(self, request: Request, on_text: Any = None, cancelled: Any = None) -> Answer:
        draw = self._rng.random()
        if draw < 0.06:
            raise LanguageModelError(self.name, "the server is busy", retryable=draw < 0.04)
        answer = self._model.answer(request, on_text, cancelled)
        return answer if draw > 0.25 else attrs.evolve(answer, text=self._rng.choice(_BROKEN))


def bench_soak(minutes: float, seed: int = 0, progress: Callable[[float], None] | None = None) -> dict[str, Any]:
    """Use one book for so long. ``kept`` says that no invariant was broken; the slopes are told beside it."""
    adopt_orphans("bench soak")
    get_temp_dir()  # of multiprocessing, which removes it at its end: not in the folder that is removed before
    started, acts, faults = time.monotonic(), Counter[str](), list[str]()
    with tempfile.TemporaryDirectory(prefix="memo-bench-") as place:
        soak = _Soak(Path(place), random.Random(seed))
        with _scratch_in(Path(place) / "tmp"):
            while not acts or time.monotonic() - started < minutes * 60:
                act = soak.draw()
                found = list(soak.act(act, acts.total()))
                acts[act] += 1
                faults += [f"act {acts.total()}, {act}: {fault}" for fault in found]
                soak.measure((time.monotonic() - started) / 3600)
                if progress is not None:
                    progress(min(1.0, (time.monotonic() - started) / 60 / minutes))
        stats: dict[str, Any] = {}
        if soak.book.exists():
            with Skillbook(str(soak.book)) as book:
                stats = attrs.asdict(book.stats())
        return {
            "minutes": round((time.monotonic() - started) / 60, 1),
            "acts": dict(acts),
            "words acknowledged": len(soak.words),
            "book": {name: stats.get(name, 0) for name in ("feedback", "corrections", "general", "templates", "keys")},
            "measured": soak.slopes(),
            "faults": faults,
            "kept": not faults,
        }


@contextmanager
def _scratch_in(folder: Path) -> Iterator[None]:
    """Temporary folders of this process are made there."""
    folder.mkdir()
    before, tempfile.tempdir = tempfile.tempdir, str(folder)
    try:
        yield
    finally:
        tempfile.tempdir = before


@attrs.define
class _Soak:
    place: Path
    rng: random.Random
    words: dict[int, str] = attrs.field(factory=dict)  # acknowledged: id in the book -> words
    samples: list[dict[str, float]] = attrs.field(factory=list)
    _server: Any = attrs.field(factory=server)
    _shared: frozenset[str] = attrs.field(factory=lambda: frozenset(_shared_memory()))
    _others: frozenset[int] = attrs.field(factory=lambda: frozenset(children()))  # that ran before

    @property
    def book(self) -> Path:
        return self.place / "book.db"

    def draw(self) -> str:
        return self.rng.choices(list(ACTS), list(ACTS.values()))[0]

    def act(self, act: str, number: int) -> Iterator[str]:
        """Do it, and check what must hold afterwards."""
        folder = self.place / f"act-{number}"
        folder.mkdir()
        seed, model = self.rng.randrange(5), self.rng.choice(MODELS)
        try:
            if act in ("run", "broken answers"):
                worse = self.rng.randrange(1000)
                spoilt = (lambda m: Broken(m, worse)) if act == "broken answers" else (lambda m: m)
                part(folder, self.place, model, seed, False, spoilt)
            elif act == "clustering":
                cluster(self.place, seed)
            elif act == "clustering killed":
                process = Disturbed.start(self._server, folder, cluster, self.place, seed)
                time.sleep(self.rng.uniform(0.0, 3.0))
                process.kill()
            else:
                yield from self._disturbed(act, folder, model, seed)
        except MemoError as error:
            yield f"it ended with: {error}"
        yield from self._checked(folder)
        shutil.rmtree(folder)

    def _disturbed(self, act: str, folder: Path, model: str, seed: int) -> Iterator[str]:
        arguments = (folder, self.place, model, seed)
        if act == "full disk":
            size = self.book.stat().st_size if self.book.exists() else 0
            process = Disturbed.start(
                self._server, folder, full_disk, *arguments, self.rng.randint(20_000, size + 200_000)
            )
            process.wait()
        else:
            process = Disturbed.start(self._server, folder, part, *arguments, False)
            at_random_moment(process, log_of(folder), _LOG_LINES, self.rng)
            if act == "kill":
                process.kill()
            else:
                yield from self._stopped(process)
        if begun(folder) and self._resumable(folder):
            if (code := Disturbed.start(self._server, folder, part, *arguments, True).wait()) != 0:
                said = (folder / "said").read_text(errors="replace")
                yield f"resumed it ended with {code}: {said[-1500:]}"
        elif not begun(folder):
            shutil.rmtree(folder / "run", ignore_errors=True)  # nothing had happened

    def _stopped(self, process: Disturbed) -> Iterator[str]:
        """Send one or two signals; a run that is stopped ends with its summary."""
        number = self.rng.choice((signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
        for _ in range(self.rng.randint(1, 2)):
            if process.process.exitcode is None and begun(process.folder) and process.process.pid is not None:
                os.kill(process.process.pid, number)
                time.sleep(self.rng.uniform(0.0, 0.5))
        if (code := process.wait()) != 0:
            yield f"stopped it ended with {code}: {process.said[-500:]}"

    @staticmethod
    def _resumable(folder: Path) -> bool:
        summary = folder / "run" / "summary.json"
        return not summary.exists() or bool(json.loads(summary.read_text())["resumable"])

    def _checked(self, folder: Path) -> Iterator[str]:
        run = folder / "run"
        for event in read_events(run) if run.exists() else ():
            if event["event"] == "FeedbackGiven" and event["feedback"]:
                self.words[event["feedback"]] = event["words"]
        if run.exists():
            yield from _accounts(run)
        if self.book.exists():
            with Skillbook(str(self.book)) as book:
                yield from book.problems()
                for number in self.rng.sample(sorted(self.words), min(100, len(self.words))):
                    if book.feedback(number).words != self.words[number]:
                        yield f"the words of feedback {number} are not those that were said"
        yield from (f"left running: {one}" for one in orphans(self._known()))
        if left := sorted(set(_shared_memory()) - self._shared):
            yield f"left in shared memory: {', '.join(left)}"
        if left := _scratch_folders(self.place):
            yield f"left in the temporary directory: {', '.join(left)}"

    def _known(self) -> set[int]:
        """What ran before, and the servers of multiprocessing."""
        from multiprocessing import forkserver

        pids = (forkserver._forkserver._forkserver_pid, resource_tracker._resource_tracker._pid)  # type: ignore[attr-defined]
        return {pid for pid in pids if pid is not None} | self._others

    def measure(self, hours: float) -> None:
        self.samples.append(
            {
                "hours": hours,
                **memory_mib(),
                "file_handles": len(os.listdir("/proc/self/fd")),
                "threads": len(os.listdir("/proc/self/task")),
                "processes": len(children()),
                "files": sum(len(names) for _, _, names in os.walk(self.place)),
            }
        )

    def slopes(self) -> list[dict[str, Any]]:
        """What was measured: first, last, and the slope an hour after the warm-up (least squares)."""
        kept = self.samples[int(len(self.samples) * _WARM_UP) :]
        hours = np.array([sample["hours"] for sample in kept])
        rows = []
        for name in [name for name in self.samples[0] if name != "hours"]:
            values = np.array([sample[name] for sample in kept])
            slope = float(np.polyfit(hours, values, 1)[0]) if len(kept) > 2 else float("nan")
            rows.append(
                {
                    "what": name,
                    "first": round(self.samples[0][name], 1),
                    "after the warm-up": round(float(values[0]), 1),
                    "last": round(float(values[-1]), 1),
                    "an hour": round(slope, 2) if len(kept) > 2 else None,
                }
            )
        return rows


class _Malloc(ctypes.Structure):
    """``struct mallinfo2`` of glibc."""

    _names = "arena ordblks smblks hblks hblkhd usmblks fsmblks uordblks fordblks keepcost"
    _fields_ = [(name, ctypes.c_size_t) for name in _names.split()]


def memory_mib() -> dict[str, float]:
    """Of this process (MiB): resident pages, which include those of mapped files that the system may take back at any
    time; the anonymous ones among them; and, with glibc, what malloc has handed out and what it keeps for later. Memory
    that something holds on to is anonymous and handed out; that which is kept for later a trim would give back."""
    rollup = Path("/proc/self/smaps_rollup").read_text().splitlines()[1:]
    kib = {line.split(":")[0]: int(line.split()[1]) for line in rollup}
    found = {"resident_mib": kib["Rss"] / 1024, "anonymous_mib": kib["Anonymous"] / 1024}
    libc = ctypes.CDLL(None)
    if hasattr(libc, "mallinfo2"):
        libc.mallinfo2.restype = _Malloc
        told = libc.mallinfo2()
        found |= {"malloc_in_use_mib": (told.uordblks + told.hblkhd) / 2**20, "malloc_free_mib": told.fordblks / 2**20}
    return found


def _accounts(run: Path) -> Iterator[str]:
    """What is wrong with the summary of a run that ended, and with what it says about tokens."""
    try:
        summary = json.loads((run / "summary.json").read_text())
    except (OSError, ValueError) as error:
        yield f"no summary: {error}"
        return
    spent = [0, 0]
    for file in (run / "calls").glob("*.json"):
        call = json.loads(file.read_text())
        usage = (call["answer"] or call)["usage"] or {}
        spent = [spent[0] + usage.get("prompt_tokens", 0), spent[1] + usage.get("completion_tokens", 0)]
    if spent != [summary["prompt_tokens"], summary["completion_tokens"]]:
        yield f"its calls spent {spent}, its summary says {summary['prompt_tokens'], summary['completion_tokens']}"


def _shared_memory() -> list[str]:
    """Of multiprocessing, and in use by no process: nobody is left who would remove it."""
    found = [str(path) for kind in ("sem.mp-*", "psm_*") for path in Path("/dev/shm").glob(kind)]
    if not found:
        return []
    used = set[str]()
    for maps in Path("/proc").glob("[0-9]*/maps"):
        with contextlib.suppress(OSError):  # it has ended, or belongs to somebody else
            used |= {line.split(maxsplit=5)[-1] for line in maps.read_text().splitlines() if "/dev/shm/" in line}
    return [name for name in found if name not in used and Path(name).exists()]


def _scratch_folders(place: Path) -> list[str]:
    """Of this process: it has them in a folder of its own."""
    return sorted(path.name for path in (place / "tmp").glob(PREFIX + "*"))


# -- work, also of processes of their own ------------------------------------------------------------------------------


def cluster(home: Path, seed: int) -> None:
    """Condense what changed in the book in ``home``."""
    _, experiment = experiment_of(home, seed)
    with book_of(experiment) as book, clustering_of(experiment, book, lambda event: None, StopSwitch()) as clustering:
        for near in clustering.near_keys():
            clustering.join(near)
        for _ in clustering.condense_all():
            pass


def full_disk(folder: Path, home: Path, model: str, seed: int, size: int) -> None:
    """A run's first part, in which no file can become larger than ``size`` bytes."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    part(folder, home, model, seed, False)
