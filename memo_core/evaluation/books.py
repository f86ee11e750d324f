"""The book that a method would have after so many hours of teaching, rebuilt from the raw log of a history.

books/history-0/memo-h2.db      and memo-h2.json: what is in it
books/history-0/memo-h10-nonsense.db   for an ablation
books/lessons.db                of what the suite says is to be known of its training tasks
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import attrs

from memo_core.config import Experiment
from memo_core.errors import InvalidArgument
from memo_core.evaluation.grid import Trial, memory_of
from memo_core.evaluation.lesions import LESIONS, lesioned_copy
from memo_core.evaluation.lesson_book import make_lesson_book
from memo_core.evaluation.settings import EMPTY, LESSONS, NO_READ_BACK, BooksSettings
from memo_core.maintenance.rebuild_book import rebuild_book
from memo_core.process.stop_switch import StopSwitch
from memo_core.runlog.whole_files import write_whole
from memo_core.runs.factories import book_of
from memo_core.runs.folder import json_text
from memo_core.skillbook import raw_log
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.entries import KINDS
from memo_core.study.history import BOOK
from memo_core.study.journal import Journal
from memo_core.text.parsing import parse_json

LESSON_BOOK = "lessons.db"  # in the folder ``books`` of the experiment


@attrs.frozen(order=True)
class BookKey:
    """Which book: of a method, after so many hours of a history; ``ablation`` changes it."""

    history: int
    hours: float
    method: str
    ablation: str = ""

    @property
    def file(self) -> str:
        """In the folder ``books`` of the experiment."""
        change = f"-{self.ablation}" if self.ablation else ""
        return f"history-{self.history}/{self.method}-h{self.hours:g}{change}.db"


def book_key(trial: Trial) -> BookKey | None:
    """The book that a trial needs; None where it has none, or was given one."""
    if trial.history is None or trial.hours is None:
        return None
    changed = trial.ablation in LESIONS or trial.ablation == NO_READ_BACK
    return BookKey(trial.history, trial.hours, trial.method, trial.ablation if changed else "")


def make_books(
    experiment: Experiment,
    journals: list[Journal],
    folder: Path,
    trials: Iterable[Trial],
    stop: StopSwitch,
    report: Callable[[str], None] = lambda line: None,
) -> None:
    """Make the books that are missing in ``folder``, and those anew that were made before a study came as far as their
    hour. Raises ``MemoError``, ``Stopped``."""
    trials = tuple(trials)
    if any(trial.given == LESSONS for trial in trials) and not _mark_of(folder / LESSON_BOOK).exists():
        report(f"book {LESSON_BOOK}")
        make_lesson_book(experiment, folder / LESSON_BOOK)
        with book_of(experiment, str(folder / LESSON_BOOK), read_only=True) as made:
            write_whole(_mark_of(folder / LESSON_BOOK), json_text({"digest": digest_of(made)}))
    keys = {key for trial in trials if (key := book_key(trial)) is not None}
    # A damaged copy needs its original; in order, "" is before the name of an ablation.
    plain = {attrs.evolve(key, ablation="") for key in keys if key.ablation in LESIONS}
    for key in sorted(keys | plain):
        told = told_of(folder, key)
        if told is None or told["feedback"] != journals[key.history].feedback_until(key.hours):
            report(f"book {key.file}")
            _make(experiment, journals[key.history], folder, key, stop)


def note_evaluation(experiment: Experiment, journals: list[Journal], trials: Iterable[Trial], folder: Path) -> None:
    """Tell every book whose words come into the trials in ``folder``, which are read-only runs, so that ``memo
    skillbook forget`` covers them: the histories' books, and given ones that may be written to."""
    files = [str(journal.folder / BOOK) for journal in journals]
    given = dict.fromkeys(trial.given for trial in trials if trial.given not in ("", EMPTY, LESSONS))
    for url in (*files, *(one for one in given if os.access(one, os.W_OK))):
        with book_of(experiment, url, read_only=False) as book:
            book.note_place("run", folder)


def told_of(folder: Path, key: BookKey) -> dict[str, Any] | None:
    """What is in a book; None for one that is not made yet."""
    return _told_in(folder / key.file)


def lesson_digest(folder: Path) -> str:
    """Of the book of the suite's lessons; empty before it is made."""
    told = _told_in(folder / LESSON_BOOK)
    return str(told["digest"]) if told is not None else ""


def _mark_of(book: Path) -> Path:
    """What is written when a book is whole."""
    return book.with_suffix(".json")


def _told_in(book: Path) -> dict[str, Any] | None:
    file = _mark_of(book)
    return dict(parse_json(file.read_text(encoding="utf-8"))) if file.exists() else None


def contents(folder: Path) -> list[dict[str, Any]]:
    """What is in each book that was made."""
    return [parse_json(file.read_text(encoding="utf-8")) for file in sorted(folder.glob("history-*/*.json"))]


def _make(experiment: Experiment, journal: Journal, folder: Path, key: BookKey, stop: StopSwitch) -> None:
    out = folder / key.file
    out.parent.mkdir(parents=True, exist_ok=True)
    for left in out.parent.glob(out.name + "*"):
        left.unlink()  # of a process that was killed while it made this book
    until = journal.feedback_until(key.hours)
    settings: BooksSettings = experiment.section("books")
    memory = memory_of(experiment, key.method)
    source_file = journal.folder / BOOK
    if not source_file.exists():
        raise InvalidArgument("--out", f"{source_file} is missing: nobody taught yet", "memo study run FILE first")
    if key.ablation in LESIONS:
        original = folder / attrs.evolve(key, ablation="").file
        with book_of(experiment, str(original), False) as book, book_of(experiment, str(out), False) as copy:
            lesioned_copy(book, copy, key.ablation, experiment.seed)
            book.note_place("book", out)
    else:
        hourly = settings.clustering == "every-hour"
        marks = [journal.feedback_until(float(hour)) for hour in range(1, int(key.hours) + 1)] if hourly else []
        with book_of(experiment, str(source_file), read_only=False) as source:
            rebuild_book(
                experiment,
                source,
                out,
                key.method,
                memory,
                until,
                stop,
                key.ablation != NO_READ_BACK,
                frozenset(marks),
            )
    with book_of(experiment, str(out), read_only=True) as made:
        told = _told(made, key, until, journal)
    write_whole(_mark_of(out), json_text(told | {"clustering": settings.clustering if memory.clusters else "never"}))


def _told(book: Skillbook, key: BookKey, until: int, journal: Journal) -> dict[str, Any]:
    entries = book.entries()
    kinds = {kind: sum(entry.kind == kind for entry in entries) for kind in KINDS}
    return {
        "file": key.file,
        "history": key.history,
        "hours": key.hours,
        "taught_hours": round(min(key.hours, journal.active_s / 3600), 3),
        "method": key.method,
        "ablation": key.ablation,
        "feedback": until,
        "entries": len(entries),
        "characters": sum(len(entry.text) for entry in entries),
        "digest": digest_of(book),
    } | kinds


def digest_of(book: Skillbook) -> str:
    """Of what a book can serve: two books with one digest answer alike."""
    said = {one.id: (one.who, one.time) for one in raw_log.raw_log(book).feedback}
    rows = [
        (entry.kind, str(entry.key), entry.text, entry.scene, [said.get(one) for one in book.sources([entry.id])])
        for entry in book.entries()
    ]
    return hashlib.sha256(repr(sorted(rows, key=repr)).encode()).hexdigest()[:16]
