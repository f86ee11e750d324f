"""Damaged books are said to be, with the way to what can be read; older ones are copied before they are changed."""

from __future__ import annotations

import json
import random
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest

from memo_core.errors import InvalidArgument, MemoError
from memo_core.skillbook import exchange, history, stats
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.store import tables
from memo_core.skillbook.store.recovery import rescue
from memo_core.testing.fake_embedder import FakeEmbedder


def filled(path: Path, count: int = 200) -> Path:
    with Skillbook(str(path), FakeEmbedder()) as book:
        for number in range(count):
            said = book.record_feedback(f"words {number} " + "and more " * 20, "ana", subtask="OPEN(jar)")
            book.add_lessons(said, "OPEN(jar)", [f"Note {number}. " + "Turn it. " * 20])
    with sqlite3.connect(path) as raw:
        raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return path


def damage(path: Path, draw: random.Random) -> None:
    """A few pages of nonsense, or the end cut off; the first page stays, so that it still is a database."""
    data = bytearray(path.read_bytes())
    for _ in range(draw.randint(1, 4)):
        at = draw.randrange(1, len(data) // 4096) * 4096
        data[at : at + 4096] = draw.randbytes(4096) if draw.random() < 0.5 else bytes(4096)
    if draw.random() < 0.3:
        del data[draw.randrange(8192, len(data)) :]
    path.write_bytes(bytes(data))


def test_what_a_damaged_book_cannot_do_is_said_in_one_line(tmp_path: Path) -> None:
    whole = filled(tmp_path / "whole.db", 60).read_bytes()
    draw, damaged, path = random.Random(1), 0, tmp_path / "book.db"
    for _ in range(60):
        path.write_bytes(whole)
        damage(path, draw)
        for read_only in (True, False):
            try:
                with Skillbook(str(path), FakeEmbedder(), read_only=read_only) as book:
                    (
                        stats.stats_of(book),
                        history.revisions(book),
                        book.entries(superseded=True),
                        book.retrieve("OPEN(jar)"),
                        list(exchange.export(book)),
                    )
                    if not read_only:
                        book.record_feedback("words", "ana")
            except MemoError as error:
                damaged += 1
                assert "\n" not in str(error)
        for beside in ("-wal", "-shm"):
            Path(f"{path}{beside}").unlink(missing_ok=True)
    assert damaged > 60


@pytest.mark.process
def test_what_can_be_read_of_a_damaged_book_is_got_out(tmp_path: Path) -> None:
    path = filled(tmp_path / "book.db")
    data = bytearray(path.read_bytes())
    middle = len(data) // 2 // 4096 * 4096
    data[middle : middle + 4 * 4096] = bytes(4 * 4096)
    path.write_bytes(bytes(data))
    command = [sys.executable, "-m", "memo_core.cli.main", "skillbook", "check", "--book", str(path)]
    said = subprocess.run([*command, "--rescue", str(tmp_path / "new.db"), "--json"], capture_output=True, text=True)
    found = json.loads(said.stdout)
    assert said.returncode == 1 and found["problems"] and found["rescued"]["read"]["feedback"] > 100
    with Skillbook(str(tmp_path / "new.db"), FakeEmbedder()) as book:
        assert book.problems() == [] and len(book.entries()) > 50
        assert book.retrieve("OPEN(jar)").corrections
    with pytest.raises(InvalidArgument, match="exists already"):
        rescue(path, tmp_path / "new.db")


def test_of_a_whole_book_everything_is_got_out(tmp_path: Path) -> None:
    path = filled(tmp_path / "book.db", 20)
    assert rescue(path, tmp_path / "new.db").dangling == 0
    with Skillbook(str(path)) as one, Skillbook(str(tmp_path / "new.db")) as other:
        assert list(exchange.export(one)) == list(exchange.export(other))


def as_version_4(path: Path) -> bytes:
    """What the version before wrote."""
    with sqlite3.connect(path) as raw:
        for name in ("read_backs", "answer_sources", "answers", "trials", "places"):
            raw.execute(f"DROP TABLE {name}")
        raw.execute("UPDATE meta SET value = '4' WHERE name = 'schema_version'")
    with sqlite3.connect(path) as raw:
        raw.execute("PRAGMA wal_checkpoint(TRUNCATE)")
    return path.read_bytes()


def test_an_older_book_is_copied_before_its_schema_is_changed_and_forget_knows_of_it(tmp_path: Path) -> None:
    path = filled(tmp_path / "book.db", 5)
    as_version_4(path)
    with Skillbook(str(path), read_only=True) as book:
        assert book.read_backs() == [] and book.places() == [] and len(book.entries()) == 5
    assert not list(tmp_path.glob("*.backup"))
    with Skillbook(str(path)) as book:
        [place] = book.places()
        assert place.kind == "backup" and place.path == tmp_path / "book.db.schema-4.backup"
        with sqlite3.connect(place.path) as raw:
            assert raw.execute("SELECT count(*) FROM feedback").fetchone() == (5,)
            assert raw.execute("SELECT value FROM meta WHERE name = 'schema_version'").fetchone() == ("4",)
        assert book.forget("ana").deleted == (str(place.path),)
        assert book.places() == []
    assert b"words 3" not in b"".join(file.read_bytes() for file in tmp_path.iterdir())


def test_without_room_for_the_backup_nothing_is_changed(tmp_path: Path) -> None:
    path = filled(tmp_path / "book.db", 5)
    before = as_version_4(path)
    (tmp_path / "book.db.schema-4.backup").mkdir()
    with pytest.raises(MemoError, match="no backup could be made"):
        Skillbook(str(path)).open()
    assert path.read_bytes() == before
    with sqlite3.connect(path) as raw:
        assert raw.execute("SELECT value FROM meta WHERE name = 'schema_version'").fetchone() == ("4",)


def test_a_new_book_needs_no_backup(tmp_path: Path) -> None:
    filled(tmp_path / "book.db", 1)
    assert not list(tmp_path.glob("*.backup")) and tables.SCHEMA_VERSION == 7


@pytest.mark.parametrize("url", ["sqlite:///book.db?mode=ro", "sqlite:///what?.db"])
def test_a_url_whose_end_would_be_cut_off_is_refused(url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidArgument, match="would be taken for options"):
        Skillbook(url)
    assert list(tmp_path.iterdir()) == []
    with Skillbook("what?.db") as book:
        book.record_feedback("words", "ana")
    assert (tmp_path / "what?.db").exists()
