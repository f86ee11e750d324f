"""A participant can withdraw: their words and what derives only from them are gone, and nothing else."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import pytest

from memo_core.errors import UnknownName
from memo_core.skillbook import exchange
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.store import database as database_module
from memo_core.skillbook.store.database import SkillbookError
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore


def _book(path: Path) -> Skillbook:
    return Skillbook(str(path), FakeEmbedder(), FakeStore())


def _bytes(path: Path) -> bytes:
    return b"".join(file.read_bytes() for file in path.parent.glob(path.name + "*"))


def test_words_and_what_derives_only_from_them_are_gone(tmp_path: Path) -> None:
    path = tmp_path / "book.db"
    with _book(path) as book:
        ana = book.record_feedback("zebrawords of ana", "ana", subtask="OPEN(jar)", scene_graph="zebragraph")
        bob = book.record_feedback("bob's words", "bob", subtask="OPEN(jar)")
        unprocessed = book.record_feedback("zebrapending", "ana", subtask="OPEN(zebrajar)")
        book.add_lessons(ana, "OPEN(zebrajar)", ["zebralesson"], ["zebrageneral"])
        kept = book.add_lessons(bob, "OPEN(jar)", ["Turn it."])
        approval = book.record_feedback("", "ana", kind="approval")
        shared = book.add_template(approval, "OPEN(jar)", "def turn(): ...", derived_from=[bob])
        alone = book.add_template(book.record_feedback("", "ana", kind="approval"), "OPEN(jar)", "def zebra(): ...")
        book.retrieve("OPEN(jar)"), book.search("zebralesson")
        assert b"zebra" in _bytes(path)

        forgotten = book.forget("ana")
        assert (forgotten.who, forgotten.feedback, forgotten.entries, forgotten.keys) == ("ana", 4, 3, 1)
        assert [entry.id for entry in book.entries()] == [kept[0].id, shared.id]
        assert book.people() == ["bob"] and book.pending_feedback() == []
        served = book.retrieve("OPEN(zebrajar)")
        assert {s.text for s in served.served} == {"Turn it.", "def turn(): ..."}
        with pytest.raises(UnknownName):
            book.feedback(unprocessed)
        with pytest.raises(UnknownName):
            book.entry(alone.id)
        on_disk = _bytes(path)
    assert b"zebra" not in on_disk, "the words are still in the file's free pages or its log"
    assert b"zebra" not in _bytes(path)
    assert b"Turn it." in _bytes(path)


def test_a_text_somebody_else_said_too_stays(tmp_path: Path) -> None:
    with _book(tmp_path / "book.db") as book:
        for who in ("ana", "bob"):
            book.add_lessons(book.record_feedback("turn it", who), "OPEN(jar)", ["Turn it."])
        book.retrieve("OPEN(jar)")
        book.forget("ana")
        assert [s.text for s in book.retrieve("OPEN(jar)").corrections] == ["Turn it."]


def test_somebody_unknown_is_named_with_who_is_known(tmp_path: Path) -> None:
    with _book(tmp_path / "book.db") as book:
        book.record_feedback("words", "annabel")
        with pytest.raises(UnknownName, match="did you mean 'annabel'"):
            book.forget("anabel")


def test_listing_by_person_kind_and_key(tmp_path: Path) -> None:
    with _book(tmp_path / "book.db") as book:
        book.add_lessons(book.record_feedback("a", "ana"), "OPEN(jar)", ["one"], ["two"])
        book.add_lessons(book.record_feedback("b", "bob"), "CLOSE(jar)", ["three"])
        assert [e.text for e in book.entries(who="ana")] == ["one", "two"]
        assert [e.text for e in book.entries(kind="correction")] == ["one", "three"]
        assert [e.text for e in book.entries(key="close(the jar)")] == ["three"]
        assert book.search("three", 1)[0][0].text == "three"
        records = list(exchange.export(book))
    kinds = [record["record"] for record in records]
    assert kinds[0] == "book" and kinds.count("feedback") == 2 and kinds.count("entry") == 3
    by_text = {record["text"]: record for record in records if record["record"] == "entry"}
    assert by_text["three"]["action"] == "close" and by_text["three"]["objects"] == ["jar"]
    assert by_text["two"]["objects"] == [] and by_text["one"]["sources"] == [1]


def test_forgetting_says_so_when_a_reader_keeps_the_words_in_the_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(database_module, "_ERASE_TIMEOUT_S", 0.2)
    path = tmp_path / "book.db"
    with _book(path) as book:
        book.record_feedback("zebrawords", "ana")
        reader = sqlite3.connect(path, isolation_level=None)
        reader.execute("BEGIN")
        reader.execute("SELECT count(*) FROM feedback").fetchone()
        with pytest.raises(SkillbookError, match="somebody else is reading"):
            book.forget("ana")
        reader.close()
        assert book.people() == []
    assert b"zebra" not in _bytes(path)


def test_forgetting_names_persons_who_are_spelt_alike(tmp_path: Path) -> None:
    """ana, Ana and "ANA " may be one person: nothing of theirs may stay unnoticed."""
    with _book(tmp_path / "book.db") as book:
        for who in ("Ana", "ANA ", "ana", "anna"):
            book.record_feedback("turn it", who)
        with pytest.raises(UnknownName, match="did you mean 'anna'"):
            book.forget("annna")
        alike = book.forget("ana").unreached
        assert [name for name in ("'Ana'", "'ANA '", "'anna'") if any(name in line for line in alike)] == [
            "'Ana'",
            "'ANA '",
        ]
        assert book.people() == ["ANA ", "Ana", "anna"]
