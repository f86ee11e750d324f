"""A large book: rounded vectors find what exact ones would, memory is bounded, nothing is read in vain."""

from __future__ import annotations

import contextlib
import random
import sqlite3
from collections import Counter
from pathlib import Path

import attrs
import numpy as np
import pytest
import sqlalchemy as sa
from hypothesis import given, settings
from hypothesis import strategies as st
from memo_benchmarks.generated_book import BookSize, fill, keys_of, lessons_of
from memo_benchmarks.skillbook import Source, WordVectors, bench_skillbook

from memo_core.errors import InvalidArgument
from memo_core.skillbook import queries, tables, text_index
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.bulk_adding import Lesson
from memo_core.skillbook.database import Database, ReadOnlyBook
from memo_core.skillbook.history import CannotRollBack
from memo_core.skillbook.keys import Key
from memo_core.skillbook.retrieval import RetrievalSettings
from memo_core.testing.fake_store import FakeStore

SIZE = BookSize(900, 6, general=0.1)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("scale") / "book.db"
    with Skillbook(str(made), WordVectors(), FakeStore()) as book:
        assert fill(book, SIZE) == SIZE.entries
        book.prepare()
    return made


def test_a_generated_book_has_the_size_it_was_asked_for(path: Path) -> None:
    with Skillbook(str(path)) as book:
        stats = book.stats()
    assert (stats.keys, stats.general, stats.templates) == (6, 90, 4)
    assert stats.corrections + stats.general + stats.templates == SIZE.entries
    assert [*lessons_of(SIZE)] == [*lessons_of(SIZE)] and [*lessons_of(SIZE)] != [*lessons_of(BookSize(900, 6, seed=1))]
    sizes = Counter(lesson.key for lesson in lessons_of(BookSize(9000, 60)) for _ in lesson.corrections)
    assert max(sizes.values()) > 4 * np.median([*sizes.values()]), "some are taught far more often than others"
    texts = Counter(text for lesson in lessons_of(SIZE) for text in lesson.corrections)
    assert len(texts) > 0.98 * texts.total()


@pytest.mark.parametrize(("entries", "keys"), [(10, 300), (1000, 1), (1_000_000, 100_000)])
def test_sizes_that_cannot_be_made_are_refused(entries: int, keys: int) -> None:
    with pytest.raises(InvalidArgument):
        BookSize(entries, keys)


def test_retrieval_serves_what_comparing_every_vector_would(path: Path) -> None:
    embedder = WordVectors()
    chosen = RetrievalSettings(corrections=7, general=5, general_floor=-1.0, ranking="key", newest=False)
    with Skillbook(str(path), embedder, FakeStore(), chosen, read_only=True) as book:
        every = book.entries()
        for key in keys_of(SIZE):
            found = book.retrieve(key)
            meant = embedder.embed([" ".join((key.action, *key.objects))])[0]
            for served, kind in ((found.corrections, "correction"), (found.general, "general")):
                mine = [e for e in every if e.kind == kind and (kind == "general" or e.key == key)]
                similar = dict(zip([e.id for e in mine], embedder.embed([e.text for e in mine]) @ meant, strict=True))
                least = sorted(similar.values(), reverse=True)[len(served) - 1]
                assert len(served) == {"correction": 7, "general": 5}[kind]
                for one in served:
                    assert similar[one.entry.id] >= least - 1e-5
                    assert one.text_similarity == pytest.approx(similar[one.entry.id], abs=1e-5)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 30), st.sampled_from([3, 96, 384]))
def test_a_rounded_vector_is_off_by_less_than_a_ten_thousandth(seed: int, count: int, dimension: int) -> None:
    vectors = np.random.default_rng(seed).standard_normal((count, dimension)).astype(np.float32)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    sketches = text_index.write_sketches(vectors)
    again = text_index.read_sketches(sketches)
    assert again.shape == vectors.shape and again.dtype == np.float32
    assert np.linalg.norm(again - vectors, axis=1).max() < 1e-4
    assert np.array_equal(sketches, text_index.write_sketches(vectors.copy()))
    ids = np.arange(count)
    similar = text_index.Group(ids, sketches).similar(vectors[0])
    assert similar == pytest.approx(text_index.Group(ids, vectors).similar(vectors[0]), abs=1e-4)
    assert similar == pytest.approx(again @ vectors[0], abs=1e-6)


def test_nothing_is_embedded_or_written_when_all_is_prepared(path: Path) -> None:
    class Refusing(WordVectors):
        def embed(self, texts: object) -> np.ndarray:
            raise AssertionError(f"was asked for {texts}")

    before = path.read_bytes()
    with Skillbook(str(path), Refusing(), FakeStore(), read_only=True) as book:
        book.retrieve(keys_of(SIZE)[0])
    assert path.read_bytes() == before


def test_a_new_entry_of_a_large_key_is_served_and_an_old_one_of_the_withdrawn_is_gone(tmp_path: Path) -> None:
    key = Key.parse("OPEN(microwave)")
    with Skillbook(str(tmp_path / "b.db"), WordVectors(), FakeStore()) as book:
        book.add_many(
            [Lesson("no", "ana", key, tuple(f"hold part {n} firmly" for n in range(100)), ("mind hot things",))]
        )
        book.retrieve(key)
        book.add_many([Lesson("no", "bob", key, ("open microwave",), ("open microwave",))])
        found = book.retrieve(key)
        assert found.corrections[0].text == found.general[0].text == "open microwave"
        assert book.forget("bob").entries == 2
        found = book.retrieve(key)
        assert "open microwave" not in {one.text for one in found.served} and len(found.general) == 1
        book.prepare()
        assert _on_sheets(tmp_path / "b.db") == {e.id for e in book.entries()}, "its sketch went with it"


def _on_sheets(path: Path) -> set[int]:
    raw = sqlite3.connect(path)
    return {int(i) for (ids,) in raw.execute("SELECT entries FROM sheets") for i in np.frombuffer(ids, "<i8")}


def test_a_withdrawn_text_leaves_no_sketch_even_before_its_sheet_is_made_anew(tmp_path: Path) -> None:
    key = Key.parse("OPEN(microwave)")
    with Skillbook(str(tmp_path / "b.db"), WordVectors()) as book:
        book.add_many([Lesson("no", "ana", key, ("slowly",)), Lesson("no", "bob", key, ("gently", "quickly"))])
        book.prepare()
        assert _on_sheets(tmp_path / "b.db") == {e.id for e in book.entries()} and len(book.entries()) == 3
        book.forget("bob")
        assert not _on_sheets(tmp_path / "b.db") - {e.id for e in book.entries()}


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(["teach", "many", "retire", "forget", "ask", "prepare"]), st.integers(0, 9))))
def test_sheets_serve_what_comparing_would_whatever_happened_to_the_book(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[str, int]]
) -> None:
    """One book is asked after each change, with sheets that are missing, lack entries or have too many."""
    path = tmp_path_factory.mktemp("steps") / "b.db"
    key, embedder = Key.parse("OPEN(microwave)"), WordVectors()
    meant = embedder.embed(["open microwave"])[0]
    with Skillbook(str(path), embedder, settings=RetrievalSettings(corrections=5, newest=False)) as book:
        for turn, (step, number) in enumerate(steps):
            if step in ("teach", "many"):
                texts = tuple(f"take part {turn} {n} microwave" for n in range(45 if step == "many" else number + 1))
                book.add_many([Lesson("no", f"person {number % 3}", key, texts)])
            elif step == "retire" and (taught := [r for r in book.history() if r.count("added")]):
                with contextlib.suppress(CannotRollBack):
                    book.rollback(taught[number % len(taught)].id)
            elif step == "forget" and f"person {number % 3}" in book.people():
                book.forget(f"person {number % 3}")
            elif step == "prepare":
                book.prepare()
            entries = book.entries()
            similar = embedder.embed([e.text for e in entries]) @ meant if entries else np.zeros(0)
            served = book.retrieve(key).corrections
            assert len(served) == min(5, len(entries))
            assert [s.text_similarity for s in served] == pytest.approx(sorted(similar)[::-1][:5], abs=1e-5)
            assert {s.entry.id for s in served} <= {e.id for e in entries}


def test_a_large_key_in_a_read_only_book_without_sketches_is_compared_exactly(tmp_path: Path) -> None:
    key = Key.parse("OPEN(microwave)")
    with Skillbook(str(tmp_path / "b.db"), WordVectors()) as book:
        book.add_many([Lesson("no", "ana", key, (*(f"hold part {n}" for n in range(90)), "open microwave"))])
    with Skillbook(str(tmp_path / "b.db"), WordVectors(), FakeStore(), read_only=True) as book:
        assert book.retrieve(key).corrections[0].text == "open microwave"
    with Skillbook(str(tmp_path / "b.db"), WordVectors(), FakeStore()) as book:
        assert book.retrieve(key).corrections[0].text == "open microwave"


def test_many_lessons_are_stored_all_or_none(tmp_path: Path) -> None:
    key = Key.parse("OPEN(microwave)")
    good = Lesson("no", "ana", key, ("Slowly.", "Gently."), ("Mind hot things.",), "def f(): pass", scene="kitchen")
    with Skillbook(str(tmp_path / "b.db")) as book:
        assert book.add_many([good, good]) == 8
        stats = book.stats()
        counts = (stats.corrections, stats.general, stats.templates, stats.superseded)
        assert counts == (4, 2, 1, 1), "one version is valid"
        assert book.pending_feedback() == [] and {e.scene for e in book.entries()} == {"kitchen"}
        assert book.sources([book.entries()[0].id]) == [1]
        with pytest.raises(sa.exc.SQLAlchemyError):
            book.add_many([good, attrs.evolve(good, scene=object())])  # a value no database takes
        assert book.stats() == stats
        assert book.generation() == 1
    with Skillbook(str(tmp_path / "b.db"), read_only=True) as book, pytest.raises(ReadOnlyBook):
        book.add_many([good])
    with pytest.raises(InvalidArgument, match="corrections"):
        Lesson("no", "ana", key, ("  ",))


def test_a_book_of_an_older_version_gets_the_table_and_the_indexes(tmp_path: Path) -> None:
    with Skillbook(str(tmp_path / "b.db"), WordVectors(), FakeStore()) as book:
        book.add_many([Lesson("no", "ana", Key.parse("OPEN(box)"), tuple(f"part {n}" for n in range(60)))])
    raw = sqlite3.connect(tmp_path / "b.db")
    raw.executescript(
        "DROP TABLE sheets; CREATE TABLE sketches (key, entry, sketch);"
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
    assert {"sheets", "ix_entries_valid", "ix_entries_retired"} <= names
    assert not names & {"ix_entries_superseded_by", "sketches"}
    assert len(_on_sheets(tmp_path / "b.db")) == 60


def test_no_statement_of_a_retrieval_walks_all_entries(path: Path) -> None:
    from sqlalchemy.dialects import sqlite

    raw = sqlite3.connect(path)
    for statement in (text_index._MEMBERS, text_index._TEXTS, *queries._SERVED.values()):
        compiled = statement.compile(dialect=sqlite.dialect())
        plan = raw.execute(f"EXPLAIN QUERY PLAN {compiled}", [1] * len(compiled.positiontup or ())).fetchall()
        steps = [step for *_, step in plan]
        assert not any(step.startswith("SCAN entries") or "retired" in step for step in steps), steps
        assert any("ix_entries_valid" in step or "PRIMARY KEY" in step for step in steps), steps


def test_memory_holds_a_bounded_number_of_groups(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_index, "_IN_MEMORY", 500_000)
    draw = random.Random(0)
    with Skillbook(str(path), WordVectors(), settings=RetrievalSettings(ranking="key"), read_only=True) as book:
        for _ in range(20):
            book.retrieve(draw.choice(keys_of(SIZE)))
        kept = book._retriever._likeness._groups  # type: ignore[union-attr]
        assert sum(g.nbytes for g in kept.values()) <= 500_000 + max(g.nbytes for g in kept.values())


def test_the_bench_measures_every_contender_in_a_process_of_its_own() -> None:
    shares: list[float] = []
    found = bench_skillbook(Source(), BookSize(300, 10), 12, 5.0, stores=["faiss"], progress=shares.append)
    assert [one["contender"] for one in found["contenders"]] == [
        "skillbook",
        "faiss",
        "plain loop",
    ]
    for one in found["contenders"]:
        assert 0 < one["p50_ms"] <= one["p99_ms"] and one["peak_mib"] > 20 and one["open_s"] > 0
    assert found["insert_per_s"] > 0 and found["general"] == 2
    assert shares == sorted(shares) and shares[-1] <= 1


def test_an_open_database_counts_groups_without_texts(path: Path) -> None:
    database = Database(str(path), read_only=True)
    database.open()
    with database.read() as connection:
        counted = queries.group_sizes(connection)
        wanted = connection.execute(sa.select(sa.func.count()).select_from(tables.entries)).scalar_one()
    database.close()
    assert sum(size for *_, size in counted) == wanted == SIZE.entries
