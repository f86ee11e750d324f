"""Many lessons at once, and books of older versions."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import attrs
import pytest
import sqlalchemy as sa
from memo_benchmarks.generated_book import WordVectors

from memo_core.errors import InvalidArgument
from memo_core.skillbook import exchange, stats as book_stats
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.store.database import ReadOnlyBook
from memo_core.skillbook.writing.bulk_adding import Lesson
from memo_core.testing.fake_store import FakeStore


def test_many_lessons_are_stored_all_or_none(tmp_path: Path) -> None:
    key = Key.parse("OPEN(microwave)")
    good = Lesson("no", "ana", key, ("Slowly.", "Gently."), ("Mind hot things.",), "def f(): pass", scene="kitchen")
    with Skillbook(str(tmp_path / "b.db")) as book:
        assert exchange.add_many(book, [good, good]) == 8
        stats = book_stats.stats_of(book)
        counts = (stats.corrections, stats.general, stats.templates, stats.superseded)
        assert counts == (4, 2, 1, 1), "one version is valid"
        assert book.pending_feedback() == [] and {e.scene for e in book.entries()} == {"kitchen"}
        assert book.sources([book.entries()[0].id]) == [1]
        with pytest.raises(sa.exc.SQLAlchemyError):
            exchange.add_many(book, [good, attrs.evolve(good, scene=object())])  # a value no database takes
        assert book_stats.stats_of(book) == stats
        assert book.generation() == 1
    with Skillbook(str(tmp_path / "b.db"), read_only=True) as book, pytest.raises(ReadOnlyBook):
        exchange.add_many(book, [good])
    with pytest.raises(InvalidArgument, match="corrections"):
        Lesson("no", "ana", key, ("  ",))


def test_a_book_of_an_older_version_gets_the_indexes_and_loses_the_former_caches(tmp_path: Path) -> None:
    with Skillbook(str(tmp_path / "b.db"), WordVectors(), FakeStore()) as book:
        exchange.add_many(book, [Lesson("no", "ana", Key.parse("OPEN(box)"), tuple(f"part {n}" for n in range(60)))])
    raw = sqlite3.connect(tmp_path / "b.db")
    raw.executescript(
        "CREATE TABLE sheets (key, kind, entries, sketches); CREATE TABLE sketches (key, entry, sketch);"
        "DROP INDEX ix_entries_valid; DROP INDEX ix_entries_retired;"
        "CREATE INDEX ix_entries_superseded_by ON entries (superseded_by);"
        "UPDATE meta SET value = '3' WHERE name = 'schema_version'"
    )
    raw.close()
    with Skillbook(str(tmp_path / "b.db"), WordVectors(), FakeStore(), read_only=True) as book:
        assert book.retrieve("OPEN(box)").corrections
    with Skillbook(str(tmp_path / "b.db"), WordVectors(), FakeStore()) as book:
        assert book.retrieve("OPEN(box)").corrections
    raw = sqlite3.connect(tmp_path / "b.db")
    names = {name for (name,) in raw.execute("SELECT name FROM sqlite_master")}
    assert {"ix_entries_valid", "ix_entries_retired"} <= names
    assert not names & {"ix_entries_superseded_by", "sketches", "sheets"}
