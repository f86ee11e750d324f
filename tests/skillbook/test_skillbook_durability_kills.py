"""What was acknowledged is there: writers of one book killed with SIGKILL at random points, and many at the same time.

Real SQLite and FAISS. A writer says what it was told had been stored; what it said is compared with what is there.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import random
import signal
import sqlite3
import time
from collections import Counter
from multiprocessing.sharedctypes import Synchronized
from multiprocessing.synchronize import Event
from pathlib import Path

import attrs
import faiss  # noqa: F401  # before the fork, or each of 200 writers would load it
import pytest
from memo_vectorstore.faiss_store import FaissStore
from memo_vectorstore.settings import FaissSettings

from memo_core.skillbook import consolidating, history, stats
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.condensing import ClusterChanged
from memo_core.skillbook.consolidation.rules import Condensed, Merged
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.testing.fake_embedder import FakeEmbedder

pytestmark = pytest.mark.process

KILLS = 200
AT_ONCE = 3  # writers
KEYS = ("OPEN(box)", "OPEN(jar)", "LIFT(box)")
fork = multiprocessing.get_context("fork")


def open_book(path: str) -> Skillbook:
    store = FaissStore(FaissSettings(path + ".faiss"))
    return Skillbook(path, FakeEmbedder(), store, RetrievalSettings())


def letters(number: int) -> str:
    """A number without digits: amounts are something that clustering must keep."""
    return "".join(chr(ord("a") + int(digit)) for digit in str(number))


def condense_something(book: Skillbook, rng: random.Random) -> int | None:
    """Make one entry of two of some key's; the revision."""
    clusters = [one for one in consolidating.clusters(book, unchanged=True) if len(one.members) > 1]
    if not clusters:
        return None
    cluster = rng.choice(clusters)
    first, second = sorted(rng.sample(range(len(cluster.members)), 2))
    others = [n for n in range(len(cluster.members)) if n not in (first, second)]
    kept = [Merged(cluster.members[n].text, (n + 1,)) for n in others]
    shorter = min(cluster.members[first].text, cluster.members[second].text, key=len)
    proposal = Condensed((Merged(shorter, (first + 1, second + 1)), *kept))
    with contextlib.suppress(ClusterChanged):
        return consolidating.condense(book, cluster, proposal, "test").revision
    return None


def _write_on(path: str, writer: int, seed: int, acknowledged: int) -> None:
    """Write for ever; each acknowledgement goes down the pipe after the call returned."""
    rng = random.Random(seed)

    def say(what: str, number: int, text: str = "") -> None:
        os.write(acknowledged, f"{what} {number} {text}\n".encode())

    with open_book(path) as book:
        for number in range(100_000):
            name = f"{letters(writer)} {letters(number)}"
            feedback = book.record_feedback(f"says {name}", f"writer {writer}", subtask=KEYS[number % 3])
            say("feedback", feedback, f"says {name}")
            entries = book.add_lessons(feedback, KEYS[number % 3], [f"lesson {name}"], [f"general {name}"])
            for entry in entries:
                say("entry", entry.id, entry.text)
            book.note_use([entries[0].id], True)
            say("use", entries[0].id)
            if number % 4 == 3:
                assert book.retrieve(KEYS[number % 3]).corrections
            if rng.random() < 0.2 and (revision := condense_something(book, rng)):
                say("revision", revision)


@attrs.define
class Writer:
    """A process and the pipe that it acknowledges through."""

    process: multiprocessing.process.BaseProcess
    pipe: int

    @classmethod
    def start(cls, path: str, number: int) -> Writer:
        reading, writing = os.pipe()
        process = fork.Process(target=_write_on, args=(path, number, number, writing))
        process.start()
        os.close(writing)
        return cls(process, reading)

    def kill(self, delay: float, opening: bool) -> list[list[str]]:
        """What it had said, when it is dead: ``delay`` s after its first word, or while it may still be opening."""
        first = b"" if opening else os.read(self.pipe, 1)
        time.sleep(delay)
        assert self.process.pid is not None
        os.kill(self.process.pid, signal.SIGKILL)
        self.process.join()
        assert self.process.exitcode == -signal.SIGKILL, "it ended by itself"
        said = first + b"".join(iter(lambda: os.read(self.pipe, 65536), b""))
        os.close(self.pipe)
        return [line.rstrip("\n").split(" ", 2) for line in said.decode().splitlines(keepends=True) if line[-1] == "\n"]


def test_kill_9_loses_nothing_that_was_acknowledged(tmp_path: Path) -> None:
    path, rng = str(tmp_path / "book.db"), random.Random(7)
    said: dict[str, dict[int, str]] = {"feedback": {}, "entry": {}, "use": {}, "revision": {}}
    writers = [Writer.start(path, number) for number in range(AT_ONCE)]
    for kill in range(KILLS):
        for what, number, *text in writers.pop(0).kill(rng.uniform(0, 0.05), opening=kill % 4 == 0):
            said[what][int(number)] = " ".join(text)
        if kill < KILLS - AT_ONCE:
            writers.append(Writer.start(path, AT_ONCE + kill))
    with open_book(path) as book:
        there = {
            "feedback": {f.id: f.words for n in range(KILLS) for f in _said_by(book, n)},
            "entry": {entry.id: entry.text for entry in book.entries(superseded=True) if entry.feedback is not None},
            "use": {entry.id: "" for entry in book.entries(superseded=True) if entry.uses and entry.feedback},
            "revision": {one.id: "" for one in history.revisions(book) if one.reason == "cluster by test"},
        }
        print({what: (len(said[what]), len(there[what])) for what in said})
        for what, acknowledged in said.items():
            assert acknowledged.items() <= there[what].items(), f"{what}: something acknowledged is not there"
            # two lessons are one call: at most one call of each killed writer was stored and not yet acknowledged
            assert len(there[what]) - len(acknowledged) <= KILLS * (2 if what == "entry" else 1)
        assert len(said["feedback"]) > KILLS // 2 and said["revision"], "too little was written to show anything"
        halves = Counter(entry.feedback for entry in book.entries(superseded=True) if entry.feedback is not None)
        assert set(halves.values()) == {2}, "half of an addition is there"
        assert set(halves).isdisjoint(one.id for one in book.pending_feedback())
        served = book.retrieve("OPEN(box)")
        assert served.corrections and served.generation == book.generation()
        assert book.problems() == []


def _said_by(book: Skillbook, writer: int) -> list:
    return [book.feedback(i) for i in _ids(book, f"writer {writer}")]


def _ids(book: Skillbook, who: str) -> list[int]:
    raw = sqlite3.connect(book.url.removeprefix("sqlite:///"))
    try:
        return [row[0] for row in raw.execute("SELECT id FROM feedback WHERE who = ?", (who,))]
    finally:
        raw.close()


# -- at the same time --------------------------------------------------------------------------------------------------
def _write_some(path: str, writer: int, count: int, start: float) -> None:
    time.sleep(max(0.0, start - time.time()))
    with open_book(path) as book:
        for number in range(count):
            name = f"{letters(writer)} {letters(number)}"
            feedback = book.record_feedback(f"says {name}", f"writer {writer}", subtask="OPEN(box)")
            book.add_lessons(feedback, KEYS[number % 3], [f"lesson {name}"])
            if number % 5 == 0:
                book.note_use([entry.id for entry in book.entries()][:3], True)
                book.retrieve("OPEN(box)")


def _condense_on(path: str, stop: Event, done: Synchronized[int]) -> None:
    """Until ``stop`` and at least once: on a busy machine the writers may end first."""
    rng = random.Random(1)
    with open_book(path) as book:
        while not stop.is_set() or not done.value:
            if condense_something(book, rng) is not None:
                done.value += 1


@pytest.mark.parametrize(("writers", "clusters"), [(2, False), (8, False), (8, True)])
def test_processes_write_one_book_at_the_same_time(tmp_path: Path, writers: int, clusters: bool) -> None:
    path, count = str(tmp_path / "book.db"), 12
    start = time.time() + 0.2  # all at once on a book that does not exist yet
    stop, done = fork.Event(), fork.Value("i", 0)
    clusterer = fork.Process(target=_condense_on, args=(path, stop, done))
    processes = [fork.Process(target=_write_some, args=(path, w, count, start)) for w in range(writers)]
    for process in [*processes, *([clusterer] if clusters else [])]:
        process.start()
    for process in processes:
        process.join()
    stop.set()
    if clusters:
        clusterer.join(60)
        clusterer.kill()
        assert clusterer.exitcode == 0 and done.value > 0
    assert [process.exitcode for process in processes] == [0] * writers
    with open_book(path) as book:
        every = book.entries(superseded=True)
        said = sorted(entry.text for entry in every if entry.feedback is not None)
        assert said == sorted(f"lesson {letters(w)} {letters(n)}" for w in range(writers) for n in range(count))
        assert stats.stats_of(book).feedback == writers * count and stats.stats_of(book).keys == 3
        assert book.generation() == writers * count + done.value, "an update of the generation was lost"
        valid = [entry.id for entry in book.entries()]
        assert len(valid) == writers * count - done.value, "each clustering makes one of two"
        assert len(book.sources(valid)) == writers * count, "somebody's words have no entry any more"
        assert book.problems() == []
