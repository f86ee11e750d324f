"""Books whose writers are killed (``kill -9``) at random moments (``memo bench kills``).

Four kinds of work in turn: people's words and what is made of them are written, clusters are condensed, another book is
imported, a book of an older schema is migrated. Everything acknowledged before the kill must be in the book, which must
open without manual repair and contain no incomplete operation.
"""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import sqlite3
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import attrs

from memo_benchmarks.disturbed_runs import Disturbed, server
from memo_benchmarks.kept_rows import measured_rows
from memo_core.errors import MemoError
from memo_core.skillbook import consolidating, exchange, history, stats
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.condensing import ClusterChanged
from memo_core.skillbook.consolidation.rules import Condensed, Merged
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

KINDS = ("writing", "clustering", "importing", "migrating")
_COUNTED = ("kills", "acknowledged", "lost")
_KILLS_A_BOOK = 40
_LONGEST_S = 0.12  # after the first acknowledgement, within which the kill falls
_PATIENCE_S = 120.0
_KEYS = ("OPEN(box)", "OPEN(jar)", "LIFT(box)", "PUSH(door)")
_IMPORTED = 30  # entries of the book that is imported
_LATER_TABLES = ("read_backs", "run_effects", "places")  # that a book of an older schema lacks


def bench_kills(
    kills: int, seed: int = 0, progress: Callable[[float], None] | None = None, out: Path | None = None
) -> dict[str, Any]:
    """Kill ``kills`` writers, ``_KILLS_A_BOOK`` of each book; books that the folder ``out`` holds are not used again.
    ``kept`` says that nothing acknowledged was lost and that no book needed a hand."""

    def measure(number: int) -> dict[str, Any]:
        first = number * _KILLS_A_BOOK
        return _book(range(first, min(first + _KILLS_A_BOOK, kills)), random.Random(f"{seed} {number}"))

    books = measured_rows(out, f"kills-{kills}", seed, -(-kills // _KILLS_A_BOOK), measure, progress)
    rows = [
        {"kind": kind} | {what: sum(book["kinds"][kind][what] for book in books) for what in _COUNTED} for kind in KINDS
    ]
    done, lost = (sum(row[what] for row in rows) for what in ("kills", "lost"))
    faults = [fault for book in books for fault in book["faults"]]
    return {"kinds": rows, "kills": done, "lost": lost, "faults": faults, "kept": not lost and not faults}


def _book(numbers: range, rng: random.Random) -> dict[str, Any]:
    """Kill the writers with these numbers, all of one book: counts of each kind, and faults."""
    kinds, faults = {kind: dict.fromkeys(_COUNTED, 0) for kind in KINDS}, list[str]()
    with tempfile.TemporaryDirectory(prefix="memo-bench-") as place:
        book = _Book(Path(place), rng)
        for number in numbers:
            kind = KINDS[number % len(KINDS)]
            faults += book.killed(kind, number)
            kinds[kind]["kills"] += 1
        faults += book.checked(kinds)
    return {"kinds": kinds, "faults": faults}


@attrs.define
class _Book:
    """One book whose writers are killed one after the other, and what they acknowledged (kind -> lines)."""

    folder: Path
    _rng: random.Random
    _said: dict[str, list[list[Any]]] = attrs.field(factory=lambda: {kind: [] for kind in KINDS})

    def killed(self, kind: str, number: int) -> Iterator[str]:
        """Start a writer and kill it; faults, where it ended by itself."""
        self.folder.mkdir(parents=True, exist_ok=True)
        folder = self.folder / f"{number}-{kind}"
        acknowledged = folder / "acknowledged"
        process = Disturbed.start(server(), folder, _WORK[kind], self.folder / "book.db", acknowledged, number)
        deadline = time.monotonic() + _PATIENCE_S
        opening = self._rng.random() < 0.25  # perhaps even before it has opened the book
        while not opening and process.process.exitcode is None and time.monotonic() < deadline:
            if acknowledged.exists() and acknowledged.stat().st_size:
                break
            time.sleep(0.001)
        time.sleep(self._rng.uniform(0.0, _LONGEST_S))
        if not process.kill():
            yield f"{kind}: it ended by itself: {process.said[-500:]}"
        if acknowledged.exists():
            lines = acknowledged.read_text().split("\n")[:-1]
            self._said[kind] += [json.loads(line) for line in lines]
        if kind == "migrating":
            yield from _migrated(folder)
        shutil.rmtree(folder)

    def checked(self, totals: dict[str, dict[str, int]]) -> Iterator[str]:
        """Faults of the book, and what is lost added to ``totals``."""
        path = self.folder / "book.db"
        for kind, lines in self._said.items():
            totals[kind]["acknowledged"] += len(lines)
        if not path.exists():
            return
        try:
            with _open(path) as book:
                yield from book.problems()
                there = _kept(path)
                revisions = {one.id for one in history.revisions(book)}
        except MemoError as error:
            yield f"the book needs a hand: {error}"
            for kind in KINDS:
                totals[kind]["lost"] += len(self._said[kind])
            return
        for what, number, text in self._said["writing"]:
            totals["writing"]["lost"] += there[what].get(number) != text
        totals["clustering"]["lost"] += sum(number not in revisions for _, number, _ in self._said["clustering"])
        for _, _, name in self._said["importing"]:
            totals["importing"]["lost"] += not there["imported"].get(name)
        for name, count in there["imported"].items():
            if count != _IMPORTED:
                yield f"{count} of {_IMPORTED} entries of {name} were imported"
        halves = sum(count != 2 for count in there["of feedback"].values())
        if halves:
            yield f"{halves} additions are there by half"


def _open(path: Path) -> Skillbook:
    return Skillbook(str(path), FakeEmbedder(), FakeStore())


def _kept(path: Path) -> dict[str, dict[Any, Any]]:
    with contextlib.closing(sqlite3.connect(path)) as book:
        entries = book.execute("SELECT id, text, feedback FROM entries WHERE feedback IS NOT NULL").fetchall()
        return {
            "feedback": dict(book.execute("SELECT id, words FROM feedback").fetchall()),
            "entry": {number: text for number, text, _ in entries},
            "imported": Counter(text.split(":")[0] for _, text, _ in entries if text.startswith("of ")),
            "of feedback": Counter(feedback for _, _, feedback in entries),
        }


def _migrated(folder: Path) -> Iterator[str]:
    """Faults of the books that the killed process was migrating, one after the other."""
    for path in sorted(folder.glob("old-*.db")):
        try:
            with _open(path) as book:
                if problems := book.problems():
                    yield f"migrating: {problems}"
                if (words := stats.stats_of(book).feedback) != 3:
                    yield f"migrating: {words} of 3 people's words are left"
        except MemoError as error:
            yield f"migrating: the book needs a hand: {error}"
        if left := list(folder.glob(f".{path.name}*")):
            yield f"migrating: {left[0].name} is left"


# -- in the processes that are killed ----------------------------------------------------------------------------------


def _acknowledge(file: Path) -> Callable[[str, int, str], None]:
    stream = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND)

    def say(what: str, number: int, text: str = "") -> None:
        os.write(stream, (json.dumps([what, number, text]) + "\n").encode())

    return say


def _letters(number: int) -> str:
    """A number without digits: amounts are something that clustering must keep."""
    return "".join(chr(ord("a") + int(digit)) for digit in str(number))


def _write(path: Path, acknowledged: Path, writer: int) -> None:
    say = _acknowledge(acknowledged)
    with _open(path) as book:
        for number in range(10_000):
            name = f"{_letters(writer)} {_letters(number)}"
            feedback = book.record_feedback(f"says {name}", f"writer {writer}", subtask=_KEYS[number % 4])
            say("feedback", feedback, f"says {name}")
            for entry in book.add_lessons(feedback, _KEYS[number % 4], [f"lesson {name}"], [f"general {name}"]):
                say("entry", entry.id, entry.text)


def _condense(path: Path, acknowledged: Path, writer: int) -> None:
    say, rng = _acknowledge(acknowledged), random.Random(writer)
    with _open(path) as book:
        while True:
            clusters = [one for one in consolidating.clusters(book, unchanged=True) if len(one.members) > 1]
            if not clusters:
                feedback = book.record_feedback("says more", "clusterer", subtask=_KEYS[0])
                book.add_lessons(
                    feedback, _KEYS[0], [f"lesson {_letters(feedback)} once", f"lesson {_letters(feedback)}"]
                )
                continue
            cluster = rng.choice(clusters)
            texts = [member.text for member in cluster.members]
            others = [Merged(text, (n + 1,)) for n, text in enumerate(texts) if n > 1]
            merged = Merged(min(texts[:2], key=len), (1, 2))
            with contextlib.suppress(ClusterChanged):
                if (
                    revision := consolidating.condense(book, cluster, Condensed((merged, *others)), "bench").revision
                ) is not None:
                    say("revision", revision, "")


def _import(path: Path, acknowledged: Path, writer: int) -> None:
    say = _acknowledge(acknowledged)
    with _open(path) as book:
        for number in range(10_000):
            name = f"of {_letters(writer)} {_letters(number)}"
            other = path.with_name(f"other-{writer}-{number}.db")
            with _open(other) as source:
                for entry in range(_IMPORTED // 2):
                    feedback = source.record_feedback(f"{name} says {_letters(entry)}", "author")
                    source.add_lessons(
                        feedback,
                        _KEYS[entry % 4],
                        [f"{name}: lesson {_letters(entry)}", f"{name}: other {_letters(entry)}"],
                    )
                records = list(exchange.export(source))
            for file in path.parent.glob(f"{other.name}*"):
                file.unlink()
            exchange.merge(book, records, name)
            say("import", number, name)


def _migrate(path: Path, acknowledged: Path, writer: int) -> None:
    say = _acknowledge(acknowledged)
    old = acknowledged.with_name("template.db")
    with _open(old) as book:
        for number in range(3):
            book.add_lessons(book.record_feedback(f"says {number}", "ana"), _KEYS[0], [f"lesson {_letters(number)}"])
    with contextlib.closing(sqlite3.connect(old)) as raw:
        raw.execute("UPDATE meta SET value = '1' WHERE name = 'schema_version'")
        for table in _LATER_TABLES:
            raw.execute(f"DROP TABLE IF EXISTS {table}")
        raw.commit()
    for number in range(10_000):
        copy = acknowledged.with_name(f"old-{number}.db")
        shutil.copyfile(old, acknowledged.with_name("copying"))
        os.replace(acknowledged.with_name("copying"), copy)
        with _open(copy):
            say("migrated", number, "")


_WORK = {"writing": _write, "clustering": _condense, "importing": _import, "migrating": _migrate}
