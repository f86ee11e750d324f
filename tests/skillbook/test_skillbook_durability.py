"""What the book promises about disks, processes and kill -9: what was acknowledged is there."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sqlite3
from pathlib import Path

import pytest

from memo_core.errors import InvalidArgument, UnknownName
from memo_core.skillbook import consolidating, stats
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.store import connecting
from memo_core.skillbook.store.connecting import filesystem_of
from memo_core.skillbook.store.database import ReadOnlyBook, SkillbookError
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore

fork = multiprocessing.get_context("fork")

WORDS = 'No!  You pulled  it straight.\n\tGo \'round "the" hinge — langsam, 慢慢来 🙂;  -- DROP TABLE feedback\n'


def words_of(writer: int, number: int) -> str:
    return f"writer {writer} says {number}: {WORDS}"


def _say_and_die(path: str) -> None:
    book = Skillbook(path).open()
    book.record_feedback(WORDS, "ana", task="warm the food", subtask="OPEN(microwave)", scene="kitchen", code="go()")
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.process
def test_feedback_is_on_disk_verbatim_when_the_call_returns(tmp_path: Path) -> None:
    path = str(tmp_path / "book.db")
    process = fork.Process(target=_say_and_die, args=(path,))
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL
    with Skillbook(path) as book:
        (kept,) = book.pending_feedback()
        assert kept.words == WORDS and (kept.who, kept.task, kept.subtask) == (
            "ana",
            "warm the food",
            "OPEN(microwave)",
        )
        assert (kept.scene, kept.code, kept.status) == ("kitchen", "go()", "pending") and kept.time > 1e9
        book.add_lessons(kept.id, kept.subtask, ["Pull along an arc."])
        assert book.pending_feedback() == [] and book.feedback(kept.id).status == "processed"


def test_adding_twice_changes_nothing(tmp_path: Path) -> None:
    with Skillbook(str(tmp_path / "book.db")) as book:
        feedback = book.record_feedback("words", "ana", subtask="OPEN(jar)")
        first = book.add_lessons(feedback, "OPEN(jar)", ["Turn it.", "Hold the glass."], ["Be gentle."], "kitchen")
        before = (stats.stats_of(book), book.generation())
        assert book.add_lessons(feedback, "OPEN(jar)", ["Said in other words."], [], "kitchen") == first
        approval = book.record_feedback("", "ana", kind="approval")
        template = book.add_template(approval, "OPEN(jar)", "def turn(): ...")
        assert book.add_template(approval, "OPEN(jar)", "def other(): ...") == template
        assert [e.text for e in first] == ["Turn it.", "Hold the glass.", "Be gentle."]
        assert (stats.stats_of(book).corrections, stats.stats_of(book).general) == (
            before[0].corrections,
            before[0].general,
        )
        assert book.generation() == before[1] + 1


def test_an_addition_that_fails_leaves_nothing_behind(tmp_path: Path) -> None:
    with Skillbook(str(tmp_path / "book.db")) as book:
        feedback = book.record_feedback("words", "ana", subtask="OPEN(jar)")
        before = stats.stats_of(book)
        with pytest.raises(InvalidArgument):
            book.add_lessons(feedback, "OPEN(jar)", ["fine", "  "])
        with pytest.raises(UnknownName):
            book.add_template(feedback, "OPEN(jar)", "def f(): ...", derived_from=[999])
        with pytest.raises(UnknownName):
            book.add_lessons(999, "OPEN(jar)", ["fine"])
        assert stats.stats_of(book) == before and book.pending_feedback()[0].id == feedback


def test_feedback_that_cannot_be_processed_is_parked_with_the_reason(tmp_path: Path) -> None:
    path = str(tmp_path / "book.db")
    with Skillbook(path) as book:
        feedback = book.record_feedback("mumble", "ana")
        book.park(feedback, "the answer was no JSON, three times")
    with Skillbook(path) as book:
        assert book.pending_feedback() == []
        (parked,) = book.pending_feedback(parked=True)
        assert parked.words == "mumble" and parked.reason == "the answer was no JSON, three times"
        assert stats.stats_of(book).parked == 1


@pytest.mark.parametrize(("words", "who"), [("", "ana"), ("  \n", "ana"), ("words", " ")])
def test_feedback_needs_words_and_a_person(tmp_path: Path, words: str, who: str) -> None:
    with Skillbook(str(tmp_path / "book.db")) as book, pytest.raises(InvalidArgument):
        book.record_feedback(words, who)


# -- opening -----------------------------------------------------------------------------------------------------------
def test_a_book_opened_read_only_is_not_changed_by_a_single_byte(tmp_path: Path) -> None:
    path = tmp_path / "book.db"
    with Skillbook(str(path), FakeEmbedder(), FakeStore()) as book:
        feedback = book.record_feedback("words", "ana")
        book.add_lessons(feedback, "OPEN(jar)", ["Turn it."])
    before = path.read_bytes()
    with Skillbook(str(path), FakeEmbedder(), FakeStore(), read_only=True) as book:
        assert [s.text for s in book.retrieve("OPEN(jar)").corrections] == ["Turn it."]
        book.search("turn"), stats.stats_of(book), book.entries()
        for write in (
            lambda: book.record_feedback("words", "ana"),
            lambda: book.add_lessons(feedback, "OPEN(lid)", ["x"]),
            lambda: book.add_template(feedback, "OPEN(lid)", "x"),
            lambda: book.note_use([1], True),
            lambda: book.park(feedback, "x"),
            lambda: book.forget("ana"),
            lambda: consolidating.add_alias(book, "OPEN(a)", "OPEN(jar)"),
        ):
            with pytest.raises(ReadOnlyBook, match="read-only"):
                write()
    assert path.read_bytes() == before


def test_reading_only_a_book_that_is_not_there_makes_none(tmp_path: Path) -> None:
    with pytest.raises(SkillbookError, match="there is no file"):
        Skillbook(str(tmp_path / "typo.db"), read_only=True).open()
    assert list(tmp_path.iterdir()) == []


def test_a_newer_schema_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "book.db"
    Skillbook(str(path)).open().close()
    raw = sqlite3.connect(path)
    raw.execute("UPDATE meta SET value = '99' WHERE name = 'schema_version'")
    raw.commit()
    raw.close()
    before = path.read_bytes()
    for read_only in (False, True):
        with pytest.raises(SkillbookError, match=r"schema version 99.*update memo-core"):
            Skillbook(str(path), read_only=read_only).open()
    assert path.read_bytes() == before


@pytest.mark.parametrize("content", [b"not a database, but long enough to look at" * 50, b"x"])
def test_a_file_that_is_no_book_is_refused_and_kept(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "letter.txt"
    path.write_bytes(content)
    with pytest.raises(SkillbookError, match=r"letter\.txt"):
        Skillbook(str(path)).open()
    assert path.read_bytes() == content


def test_somebody_else_s_database_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "music.db"
    raw = sqlite3.connect(path)
    raw.execute("CREATE TABLE songs (title TEXT)")
    raw.commit()
    raw.close()
    with pytest.raises(SkillbookError, match="no skillbook"):
        Skillbook(str(path)).open()


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("mysql://localhost/x", "not supported"),
        ("postgresql://me:hunter2@host/x", "PGPASSWORD"),
        ("://", "no database URL"),
    ],
)
def test_urls_that_cannot_be_used_are_named(url: str, said: str) -> None:
    with pytest.raises(InvalidArgument, match=said) as caught:
        Skillbook(url)
    assert "hunter2" not in str(caught.value)


MOUNTS = """\
22 1 8:1 / / rw,relatime shared:1 - ext4 /dev/sda1 rw
40 22 0:40 / /home rw shared:2 - nfs4 server:/home rw
41 40 8:2 / /home/local rw - xfs /dev/sdb rw
42 22 0:41 / /mnt/my\\040share rw - cifs //server/share rw
"""


def test_a_network_file_system_is_refused_with_a_pointer_to_postgres(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mounts = tmp_path / "mountinfo"
    mounts.write_text(MOUNTS)
    kinds = {p: filesystem_of(Path(p), mounts) for p in ("/etc/b.db", "/home/ana/b.db", "/home/local/b.db", "/homes/b")}
    assert kinds == {"/etc/b.db": "ext4", "/home/ana/b.db": "nfs4", "/home/local/b.db": "xfs", "/homes/b": "ext4"}
    assert filesystem_of(Path("/mnt/my share/b.db"), mounts) == "cifs"
    assert filesystem_of(Path("/etc/b.db"), tmp_path / "nothing") == ""
    monkeypatch.setattr(connecting, "filesystem_of", lambda path: "nfs4")
    with pytest.raises(SkillbookError, match=r"network file system \(nfs4\).*postgresql://"):
        Skillbook(str(tmp_path / "book.db")).open()
    assert not (tmp_path / "book.db").exists()


def test_sqlite_is_set_to_survive_power_loss_too(tmp_path: Path) -> None:
    book = Skillbook(str(tmp_path / "book.db")).open()
    with book.database.write() as connection:
        journal = connection.exec_driver_sql("PRAGMA journal_mode").scalar()
        synchronous = connection.exec_driver_sql("PRAGMA synchronous").scalar()
    book.close()
    book.close()
    assert (journal, synchronous) == ("wal", 2)
