"""Disks that are full, folders that cannot be written, and indexes that are damaged: clear errors, nothing lost."""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from memo_vectorstore.faiss_store import FaissStore
from memo_vectorstore.settings import FaissSettings

from memo_core.errors import InvalidArgument
from memo_core.skillbook import stats
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.skillbook.store import connecting
from memo_core.skillbook.store.database import SkillbookError
from memo_core.testing.fake_embedder import FakeEmbedder

NOBODY = 65534


def open_book(path: Path, read_only: bool = False, index: Path | None = None) -> Skillbook:
    store = FaissStore(FaissSettings(str(index or path.with_suffix(".faiss"))))
    return Skillbook(str(path), FakeEmbedder(), store, RetrievalSettings(), read_only)


@pytest.fixture
def folder() -> Iterator[Path]:
    """One that anybody can reach: pytest's own is its user's alone."""
    made = Path(tempfile.mkdtemp(prefix="memo-disk-"))
    made.chmod(0o777)
    yield made
    for path in (made, *made.iterdir()):
        path.chmod(0o777)
    shutil.rmtree(made)


def in_a_child(act: Callable[[], Any], unprivileged: bool = False) -> Any:
    """What ``act`` returns, run in a process of its own; an exception as its type's name and its text."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            if unprivileged and os.getuid() == 0:
                os.setgroups([])
                os.setgid(NOBODY)
                os.setuid(NOBODY)
            said = json.dumps(act())
        except BaseException as error:
            said = json.dumps([type(error).__name__, str(error)])
        os.write(writing, said.encode())
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as stream:
        said = stream.read().decode()
    os.waitpid(child, 0)
    return json.loads(said)


@pytest.mark.process
@pytest.mark.parametrize(("allowed", "size"), [(500_000, 300), (655_555, 300), (900_000, 300), (9_000_000, 20_000)])
def test_a_full_disk_is_said_and_loses_nothing(folder: Path, allowed: int, size: int) -> None:
    """A limit on the size of files makes the system refuse to write, as a full disk does, whichever write it is."""
    path = folder / "book.db"

    def fill() -> list[Any]:
        resource.setrlimit(resource.RLIMIT_FSIZE, (allowed, allowed))
        said: list[Any] = []
        try:
            with open_book(path) as book:
                for number in range(10_000):
                    feedback = book.record_feedback(f"{number} " + "words " * size, "ana")
                    said.append([feedback, f"{number} "])
                    book.add_lessons(feedback, f"OPEN(box {number})", [f"lesson {number}"])
                    said[-1].append(f"lesson {number}")
                    if number % 10 == 0:
                        assert book.retrieve(f"OPEN(box {number})").corrections
        except SkillbookError as error:
            said.append(str(error))
        return said

    *said, error = in_a_child(fill)
    assert isinstance(error, str) and "could not be written" in error and "make room" in error, error
    assert len(said) > 2
    with open_book(path) as book:
        assert book.problems() == []
        words = {f: book.feedback(f).words.split("words")[0] for f, *_ in said}
        assert words == {f: text for f, text, *_ in said}
        lessons = [entry.text for entry in book.entries()]
        acknowledged = [rest[0] for _, _, *rest in said if rest]
        assert lessons[: len(acknowledged)] == acknowledged and len(lessons) - len(acknowledged) <= 1
        assert stats.stats_of(book).feedback - len(said) <= 1
        feedback = book.record_feedback("there is room again", "ana")
        book.add_lessons(feedback, "OPEN(box 1)", ["Slowly."])
        assert "Slowly." in [served.text for served in book.retrieve("OPEN(box 1)").corrections]


@pytest.mark.process
def test_a_read_only_folder_is_read_and_named_when_it_is_to_be_written(folder: Path) -> None:
    path = folder / "book.db"
    with open_book(path) as book:
        book.add_lessons(book.record_feedback("turn it", "ana"), "OPEN(jar)", ["Turn it."])
        book.retrieve("OPEN(jar)")
    for file in folder.iterdir():
        file.chmod(0o444)
    folder.chmod(0o555)
    before = {file.name: file.read_bytes() for file in folder.iterdir()}

    def look() -> list[str]:
        with open_book(path, read_only=True) as book:
            return [served.text for served in book.retrieve("OPEN(jar)").corrections]

    def say() -> int:
        with open_book(path) as book:
            return book.record_feedback("words", "ana")

    def make() -> int:
        with open_book(folder / "new.db") as book:
            return book.generation()

    def make_beneath() -> int:
        with open_book(folder / "new" / "book.db") as book:
            return book.generation()

    assert in_a_child(look, unprivileged=True) == ["Turn it."]
    for write in (say, make, make_beneath):
        kind, text = in_a_child(write, unprivileged=True)
        assert kind == "SkillbookError" and str(folder) in text, text
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before


@pytest.mark.process
def test_a_read_only_file_is_named_with_the_way_on(folder: Path) -> None:
    path = folder / "book.db"
    with open_book(path) as book:
        book.record_feedback("turn it", "ana")
    path.chmod(0o444)

    def say() -> None:
        with open_book(path) as book:
            book.record_feedback("words", "ana")

    kind, text = in_a_child(say, unprivileged=True)
    assert kind == "SkillbookError" and f"{path} is read-only" in text and "skillbook.read_only=true" in text, text


@pytest.mark.process
@pytest.mark.parametrize("unmerged", [False, True])
def test_a_read_only_folder_with_a_log_is_read_or_says_to_copy_it(folder: Path, unmerged: bool) -> None:
    """A copy of a book that was open has a log; SQLite cannot read a log in a folder where its index cannot be made."""
    path, made = folder / "book.db", folder / "made.db"
    with open_book(made) as book:
        book.record_feedback("turn it", "ana")
        path.write_bytes(made.read_bytes())
        log = made.with_name("made.db-wal").read_bytes()
    path.with_name("book.db-wal").write_bytes(log if unmerged else b"")
    if not unmerged:
        path.write_bytes(made.read_bytes())
    for file in folder.iterdir():
        file.chmod(0o444)
    folder.chmod(0o555)

    def look() -> int:
        with open_book(path, read_only=True) as book:
            return stats.stats_of(book).feedback

    said = in_a_child(look, unprivileged=True)
    if unmerged:
        assert said[0] == "SkillbookError" and f"copy {path}* to another folder" in said[1], said
    else:
        assert said == 1


def test_a_locked_book_is_named_in_one_line(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = folder / "book.db"
    with open_book(path) as book:
        book.record_feedback("turn it", "ana")
        holder = sqlite3.connect(path)
        holder.execute("BEGIN IMMEDIATE")
        book.database.engine.dispose()
        monkeypatch.setattr(connecting, "BUSY_TIMEOUT_MS", 10)
        with pytest.raises(SkillbookError, match=r"could not be written.*locked.*end the program that holds"):
            book.record_feedback("words", "ana")
        holder.close()


@pytest.mark.parametrize(
    ("url", "named"),
    [
        ("sqlite://book.db", "sqlite:///book.db"),
        ("sqlite:book.db", "no database URL"),
        ("file:book.db", "no database URL"),
        ("postgresql:/host/book", "no database URL"),
        ("sqlit:///book.db", "did you mean 'sqlite'"),
        ("postgres://ana@host/book", "did you mean 'postgresql'"),
        ("", "names no book"),
        (" ", "names no book"),
    ],
)
def test_a_mistyped_url_is_refused_with_the_right_form(url: str, named: str) -> None:
    with pytest.raises(InvalidArgument, match=re.escape(named)):
        Skillbook(url)


def test_a_server_that_does_not_answer_is_one_line() -> None:
    with pytest.raises(SkillbookError, match="see whether its server runs") as caught:
        Skillbook("postgresql://memo@/x?host=/nowhere").open()
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.process
@pytest.mark.parametrize("damage", ["gone", "empty", "cut", "changed", "other", "a folder", "unwritable"])
def test_an_index_that_is_damaged_is_made_anew(folder: Path, damage: str) -> None:
    path, index = folder / "book.db", folder / "book.faiss"
    with open_book(path) as book:
        for number in range(5):
            book.add_lessons(book.record_feedback("words", "ana"), f"OPEN(box {number})", [f"lesson {number}"])
        wanted = [(s.text, s.score) for s in book.retrieve("OPEN(box 3)").corrections]
    whole = index.read_bytes()
    with open_book(folder / "other.db") as other:
        other.add_lessons(other.record_feedback("words", "ana"), "OPEN(door)", ["of another book"])
        other.retrieve("OPEN(door)")
    index.unlink()
    if damage == "a folder":
        index.mkdir()
    elif damage == "unwritable":
        folder.chmod(0o555)
    elif damage != "gone":
        different = bytes([whole[-1] ^ 1])
        changed = {"empty": b"", "cut": whole[:-40], "changed": whole[:-1] + different}
        index.write_bytes(changed.get(damage) if damage in changed else (folder / "other.faiss").read_bytes())  # type: ignore[arg-type]

    def look() -> list[Any]:
        with open_book(path, read_only=True) as book:
            return [[s.text, s.score] for s in book.retrieve("OPEN(box 3)").corrections]

    assert [tuple(one) for one in in_a_child(look, unprivileged=damage == "unwritable")] == wanted


def test_a_book_whose_pages_are_damaged_is_found_out(folder: Path) -> None:
    path = folder / "book.db"
    with open_book(path) as book:
        for number in range(40):
            book.record_feedback(f"{number} " + "words " * 400, "ana")
        assert book.problems() == []
    raw = sqlite3.connect(path)
    raw.execute("PRAGMA foreign_keys=OFF")
    raw.execute("INSERT INTO sources (entry, feedback) VALUES (77, 1)")
    raw.commit()
    raw.close()
    with open_book(path) as book:
        assert any("entries" in problem for problem in book.problems())
    content = bytearray(path.read_bytes())
    content[4096 * 20 : 4096 * 20 + 2000] = b"\xff" * 2000
    path.write_bytes(content)
    with open_book(path, read_only=True) as book:
        assert book.problems()
