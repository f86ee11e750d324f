"""A book on a real PostgreSQL keeps the same promises: what was acknowledged is there, whoever else writes."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import time
import uuid
import warnings
from collections.abc import Iterator

import pytest
from test_skillbook_durability_kills import KEYS, condense_something, letters
from test_skillbook_import import content, exported

from memo_core.errors import InvalidArgument
from memo_core.skillbook import consolidating, exchange, history, stats
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.consolidation.rules import Condensed, Merged
from memo_core.skillbook.store.database import ReadOnlyBook, SkillbookError
from memo_core.skillbook.vectors.reembedding import reembed
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore
from tests.support import postgres_server
from tests.support.cluster_books import approve, new_book, teach, teach_general

WHY_NOT = postgres_server.missing()
if WHY_NOT:
    warnings.warn(f"a book on PostgreSQL was NOT TESTED: {WHY_NOT}", stacklevel=1)
pytestmark = [pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT), pytest.mark.process]
fork = multiprocessing.get_context("fork")


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with postgres_server.postgres_server() as folder:
        yield folder


@pytest.fixture
def url(server: str) -> str:
    return postgres_server.url_of(server, f"book_{uuid.uuid4().hex[:12]}")


def test_everything_that_a_book_does(url: str) -> None:
    """The same acts on both databases leave the same content: every statement of the room runs on PostgreSQL."""
    books = [new_book(url), new_book()]
    for book in books:
        first = teach(book, "OPEN(jar)", "turn it", "turn it round", "hold the glass", who="ana")
        teach_general(book, "be gentle — 慢慢来 🙂", who="bob")
        teach(book, "PUT(cup, shelf)", "level", who="bob")
        approve(book, "OPEN(jar)", "def one(): ...", who="bob")
        approve(book, "OPEN(jar)", "def two(): ...", who="ana")
        book.note_use([first[0]], True, "OPEN(jar)")
        book.note_use([e.id for e in book.entries("template")], False, "OPEN(jar)")
        [cluster] = [one for one in consolidating.clusters(book) if len(one.members) == 3]
        clustered = consolidating.condense(
            book, cluster, Condensed((Merged("turn it", (1, 2)), Merged("hold the glass", (3,)))), "test"
        )
        assert clustered.revision is not None
        history.roll_back(book, clustered.revision)
        consolidating.add_alias(book, "PLACE(cup, shelf)", "PUT(cup, shelf)")
        (
            consolidating.near_keys(book),
            history.versions(book, "OPEN(jar)"),
            history.difference(book, 1, clustered.revision),
        )
        book.park(book.record_feedback("mumble", "ana"), "no JSON")
        assert book.pending_feedback(parked=True) and book.search("turn", 2)
    one, other = books
    for query in ("OPEN(jar)", "PLACE(cup, shelf)", "CLOSE(jar)"):
        served = [[(s.text, round(s.score, 6)) for s in book.retrieve(query).served] for book in books]
        assert served[0] == served[1]
    assert content(one) == content(other)
    assert [(r.reason, r.count("superseded")) for r in history.revisions(one)] == [
        (r.reason, r.count("superseded")) for r in history.revisions(other)
    ]
    counts = [stats.stats_of(book) for book in books]
    assert (counts[0].characters, counts[0].generation) == (counts[1].characters, counts[1].generation)
    for book in books:
        forgotten = book.forget("ana")
        assert (forgotten.feedback, book.people()) == (5, ["bob"])
    assert content(one) == content(other)
    one.close(), other.close()


def test_books_merge_across_databases(url: str) -> None:
    with new_book(url) as one, new_book() as other:
        teach(one, "OPEN(jar)", "of one", who="ana")
        teach(other, "OPEN(jar)", "of other", who="bob")
        exchange.merge(one, exported(other), "other"), exchange.merge(other, exported(one), "one")
        assert content(one) == content(other) and not exchange.merge(one, exported(other), "other").changed
        other.forget("bob")
        assert exchange.merge(one, exported(other), "other").withdrawn == 1 and one.people() == ["ana"]


def test_read_only_and_another_embedder(url: str) -> None:
    with new_book(url) as book:
        teach(book, "OPEN(jar)", "turn it")
        book.retrieve("OPEN(jar)")
    with Skillbook(url, FakeEmbedder(), FakeStore(), read_only=True) as book:
        assert book.retrieve("OPEN(jar)").corrections
        with pytest.raises(ReadOnlyBook):
            book.record_feedback("words", "ana")
    with pytest.raises(SkillbookError, match="reembed"):
        Skillbook(url, FakeEmbedder(name="another"), FakeStore()).open()
    assert reembed(url, FakeEmbedder(name="another")) == 1
    with Skillbook(url, FakeEmbedder(name="another"), FakeStore()) as book:
        assert book.retrieve("OPEN(jar)").corrections


def _write_some(url: str, writer: int, count: int, start: float) -> None:
    time.sleep(max(0.0, start - time.time()))
    with new_book(url) as book:
        for number in range(count):
            name = f"{letters(writer)} {letters(number)}"
            feedback = book.record_feedback(f"says {name}", f"writer {writer}", subtask="OPEN(box)")
            book.add_lessons(feedback, KEYS[number % 3], [f"lesson {name}"])
            if number % 5 == 0:
                book.retrieve("OPEN(box)")


def _condense_on(url: str, stop: object, done: object) -> None:
    rng = random.Random(1)
    with new_book(url) as book:
        while not stop.is_set():  # type: ignore[attr-defined]
            if condense_something(book, rng) is not None:
                done.value += 1  # type: ignore[attr-defined]


def test_eight_processes_write_while_one_clusters(url: str) -> None:
    count, start = 10, time.time() + 0.2  # all at once on a database without tables
    stop, done = fork.Event(), fork.Value("i", 0)
    clusterer = fork.Process(target=_condense_on, args=(url, stop, done))
    processes = [fork.Process(target=_write_some, args=(url, w, count, start)) for w in range(8)]
    for process in [*processes, clusterer]:
        process.start()
    for process in processes:
        process.join()
    stop.set()
    clusterer.join()
    assert [process.exitcode for process in [*processes, clusterer]] == [0] * 9
    with new_book(url) as book:
        said = sorted(entry.text for entry in book.entries(superseded=True) if entry.feedback is not None)
        assert said == sorted(f"lesson {letters(w)} {letters(n)}" for w in range(8) for n in range(count))
        assert stats.stats_of(book).feedback == 8 * count and stats.stats_of(book).keys == 3
        assert done.value > 0 and book.generation() == 8 * count + done.value
        assert len(book.sources(entry.id for entry in book.entries())) == 8 * count


def _write_on(url: str, writer: int, acknowledged: int) -> None:
    with new_book(url) as book:
        for number in range(100_000):
            feedback = book.record_feedback(f"says {writer} {number}", f"writer {writer}")
            os.write(acknowledged, f"{feedback} says {writer} {number}\n".encode())


def test_kill_9_loses_nothing_that_was_acknowledged(url: str) -> None:
    rng, said = random.Random(3), {}
    for writer in range(20):
        reading, writing = os.pipe()
        process = fork.Process(target=_write_on, args=(url, writer, writing))
        process.start()
        os.close(writing)
        first = os.read(reading, 1)
        time.sleep(rng.uniform(0, 0.04))
        assert process.pid is not None
        os.kill(process.pid, signal.SIGKILL)
        process.join()
        lines = (first + b"".join(iter(lambda r=reading: os.read(r, 65536), b""))).decode().splitlines(keepends=True)  # type: ignore[misc]
        os.close(reading)
        for line in lines:
            if line.endswith("\n"):
                number, words = line.rstrip("\n").split(" ", 1)
                said[int(number)] = words
    with new_book(url) as book:
        there = {feedback.id: feedback.words for feedback in book.pending_feedback()}
    assert said.items() <= there.items() and len(there) - len(said) <= 20 <= len(said)


def test_a_commit_is_on_disk_and_a_reader_sees_one_state(url: str) -> None:
    with new_book(url) as book, new_book(url) as other:
        database = book.database
        with database.write() as connection:
            assert connection.exec_driver_sql("SHOW synchronous_commit").scalar() == "on"
            assert connection.exec_driver_sql("SHOW transaction_isolation").scalar() == "read committed"
        with database.read() as connection:
            before = database.meta(connection)["generation"]
            teach(other, "OPEN(jar)", "turn it")
            assert database.meta(connection)["generation"] == before
        assert book.generation() == int(before) + 1


# -- from the shell, and what cannot work ------------------------------------------------------------------------------
def memo(*arguments: str, code: int = 0, **environment: str) -> str:
    command = [sys.executable, "-m", "memo_core.cli.main", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, env=os.environ | environment)
    assert done.returncode == code and "Traceback" not in done.stderr, done.stderr
    return done.stdout if code == 0 else done.stderr


def test_the_shell_takes_its_url(url: str) -> None:
    with new_book(url) as book:
        teach(book, "OPEN(jar)", "turn it")
    assert json.loads(memo("skillbook", "list", "--json", "--book", url))["entries"][0]["text"] == "turn it"
    assert json.loads(memo("skillbook", "stats", "--json", "--book", url))["corrections"] == 1


def test_a_password_is_never_said(server: str, url: str) -> None:
    said = memo("skillbook", "stats", "--book", url.replace("?", "_not_there?"), code=1, PGPASSWORD="hunter2")
    assert "does not exist" in said and "hunter2" not in said and len(said.splitlines()) <= 3
    for hidden in (
        f"postgresql://memo:hunter2@/x?host={server}",
        f"postgresql://memo@/x?host={server}&password=hunter2",
    ):
        with pytest.raises(InvalidArgument, match="PGPASSWORD") as caught:
            Skillbook(hidden)
        assert "hunter2" not in str(caught.value)


def test_no_server_and_no_driver_say_what_to_do(url: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SkillbookError, match="cannot be opened"):
        Skillbook("postgresql://memo@/x?host=/nowhere").open()
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(SkillbookError, match=r"psycopg.*not installed.*pip install 'psycopg\[binary\]'"):
        Skillbook(url).open()
