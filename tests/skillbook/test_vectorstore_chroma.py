"""Chroma keeps every rule of vector stores, in memory, in a folder and on a real server, and misses next to nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("chromadb", reason="the extra `chroma` is not installed: pip install chromadb")

from memo_vectorstore import chroma_store
from memo_vectorstore.chroma_store import ChromaStore
from memo_vectorstore.faiss_store import FaissStore
from memo_vectorstore.plugin import memo_vector_stores
from memo_vectorstore.settings import ChromaSettings, FaissSettings

from memo_core.errors import BackendUnavailable, InvalidArgument
from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.vectorstore import RULES
from tests.support.chroma_server import chroma_server

PLACES = ("memory", "folder", "server")
Make = Callable[[], ChromaStore]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    with chroma_server(tmp_path_factory.mktemp("chroma")) as url:
        yield url


@pytest.fixture(params=PLACES)
def make(request: pytest.FixtureRequest, tmp_path: Path) -> Make:
    if request.param == "memory":
        return lambda: ChromaStore(ChromaSettings())
    if request.param == "folder":
        return lambda: ChromaStore(ChromaSettings(folder=str(tmp_path / "keys")))
    name = f"test-{uuid.uuid4().hex}"
    url = request.getfixturevalue("address")
    return lambda: ChromaStore(ChromaSettings(server=url, collection=name))


@pytest.mark.process
@pytest.mark.parametrize("rule", RULES)
def test_chroma_keeps_the_rule(rule: str, make: Make) -> None:
    RULES[rule](make)


def test_the_plugin_offers_it() -> None:
    [backend] = [b for b in memo_vector_stores() if b.name == "chroma"]
    store = backend.factory(backend.config(folder="anywhere"))
    assert isinstance(store, ChromaStore) and not Path("anywhere").exists() and not backend.default


@pytest.mark.wire
@pytest.mark.parametrize("place", ["memory", "server"])
def test_recall_at_20_of_exact_search_is_at_least_0_99(place: str, request: pytest.FixtureRequest) -> None:
    """Random directions are the hardest case there is for a graph of neighbours."""
    settings = ChromaSettings() if place == "memory" else ChromaSettings(server=request.getfixturevalue("address"))
    rng = np.random.default_rng(3)
    vectors = rng.normal(size=(1200, 384)).astype(np.float32)
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    exact, store = FaissStore(FaissSettings()), ChromaStore(settings)
    for one in (exact, store):
        one.open()
        one.reset(384)
        one.add(range(1200), vectors)
    queries = rng.normal(size=(60, 384)).astype(np.float32)
    hits = 0
    for query in queries:
        wanted, products = exact.search(query, 20)
        got, scores = store.search(query, 20)
        hits += len({*wanted.tolist()} & {*got.tolist()})
        there = {int(i): float(p) for i, p in zip(wanted, products, strict=True)}
        assert all(abs(there[int(i)] - s) < 1e-3 for i, s in zip(got, scores, strict=True) if int(i) in there)
    exact.close(), store.close()
    assert hits / (20 * len(queries)) >= 0.99


def _taught(path: Path, store: VectorStore) -> Skillbook:
    book = Skillbook(str(path), FakeEmbedder(), store, RetrievalSettings()).open()
    for number in range(60):
        key = f"{['OPEN', 'CLOSE', 'LIFT', 'WIPE'][number % 4]}(thing {number % 30}, place {number % 7})"
        book.add_lessons(book.record_feedback("words", "ana"), key, [f"lesson {number}"], [f"general {number}"])
    return book


@pytest.mark.wire
def test_a_book_serves_the_same_with_the_same_scores_as_with_faiss(make: Make, tmp_path: Path) -> None:
    """Core scores what a store returns, so the scores are equal to the last bit where the same is found."""
    exact, other = _taught(tmp_path / "a.db", FaissStore(FaissSettings())), _taught(tmp_path / "b.db", make())
    with exact, other:
        for query in ("OPEN(thing 4, place 4)", "LIFT(thing 11)", "SHUT(a thing 3, place 1)"):
            one, two = exact.retrieve(query), other.retrieve(query)
            assert [(s.key, s.text, s.score) for s in one.served] == [(s.key, s.text, s.score) for s in two.served]
            assert one.corrections


# -- what outlives a process -------------------------------------------------------------------------------------------
@pytest.fixture(params=["folder", "server"])
def lasting(request: pytest.FixtureRequest, tmp_path: Path) -> ChromaSettings:
    if request.param == "folder":
        return ChromaSettings(folder=str(tmp_path / "keys"))
    return ChromaSettings(server=request.getfixturevalue("address"), collection=f"test-{uuid.uuid4().hex}")


@pytest.mark.wire
def test_an_index_survives_the_process_with_its_generation(lasting: ChromaSettings) -> None:
    vectors = np.eye(3, dtype=np.float32)
    store = ChromaStore(lasting)
    store.open()
    store.reset(3)
    store.add([1, 2, 2**60], vectors)
    store.set_generation(2**61 + 1)
    store.close()
    again = ChromaStore(lasting)
    again.open()
    assert (len(again), again.generation()) == (3, 2**61 + 1)
    assert [int(i) for i in again.search(vectors[2], 1)[0]] == [2**60]
    again.close()


@pytest.mark.wire
def test_an_index_that_was_not_finished_is_not_taken_for_one(lasting: ChromaSettings) -> None:
    killed = ChromaStore(lasting)
    killed.open()
    killed.reset(3)
    killed.add([1], np.eye(1, 3, dtype=np.float32))
    again = ChromaStore(lasting)
    again.open()
    assert (len(again), again.generation()) == (0, None)
    killed.close(), again.close()


@pytest.mark.wire
def test_an_index_that_was_not_changed_to_the_end_is_not_taken_for_one(lasting: ChromaSettings) -> None:
    killed = ChromaStore(lasting)
    killed.open()
    killed.reset(3)
    killed.add([1, 2], np.eye(2, 3, dtype=np.float32))
    for change in (lambda: killed.add([3], np.eye(1, 3, dtype=np.float32)), lambda: killed.remove([1])):
        killed.set_generation(4)
        change()
        again = ChromaStore(lasting)
        again.open()
        assert (len(again), again.generation()) == (0, None)
        again.close()
    killed.close()


@pytest.mark.wire
def test_new_keys_are_added_to_the_index_and_keys_that_went_are_removed(
    lasting: ChromaSettings, tmp_path: Path
) -> None:
    def asked(other: Skillbook) -> list[tuple[str, str, float]]:
        return [(one.key, one.text, one.score) for one in other.retrieve("LIFT(new thing)").served]

    with _taught(tmp_path / "book.db", ChromaStore(lasting)) as book:
        book.retrieve("LIFT(new thing)")
        store = book._store
        [made] = store._collections()  # type: ignore[union-attr]
        book.add_lessons(book.record_feedback("words", "bob"), "LIFT(new thing)", ["gently"])
        assert asked(book)[0][1] == "gently"
        with _taught(tmp_path / "other.db", FaissStore(FaissSettings())) as exact:
            exact.add_lessons(exact.record_feedback("words", "bob"), "LIFT(new thing)", ["gently"])
            assert asked(book) == asked(exact)
        with Skillbook(book.url, FakeEmbedder(), again := ChromaStore(lasting), book.settings) as late:
            assert asked(late) == asked(book)
            assert [c.name for c in again._collections()] == [made.name], "it was filled anew"
        book.forget("bob")
        assert "gently" not in {text for _, text, _ in asked(book)}
        assert [c.name for c in store._collections()] == [made.name]  # type: ignore[union-attr]
        assert made.count() == len(store) == len(book.entries())  # type: ignore[arg-type]


@pytest.mark.wire
def test_two_that_fill_it_at_the_same_time_do_not_mix(lasting: ChromaSettings) -> None:
    one, other = ChromaStore(lasting), ChromaStore(lasting)
    for store, sign in ((one, 1), (other, -1)):
        store.open()
        store.reset(2)
        store.add([sign + 2], sign * np.eye(1, 2, dtype=np.float32))
    for store, sign in ((one, 1), (other, -1)):
        store.add([5], np.eye(1, 2, dtype=np.float32) / 2)
        store.set_generation(7 + sign)
    for store, best in ((one, [3, 5]), (other, [5, 1])):
        assert [int(i) for i in store.search(np.array([1, 0], dtype=np.float32), 9)[0]] == best
    one.close(), other.close()


@pytest.mark.wire
def test_what_others_left_is_cleared_away_when_it_is_old(
    lasting: ChromaSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    left, new = ChromaStore(lasting), ChromaStore(lasting)
    for store in (left, new):
        store.open()
        store.reset(2)
        store.add([1], np.eye(1, 2, dtype=np.float32))
    new.set_generation(1)
    assert len(new._collections()) == 2
    monkeypatch.setattr(chroma_store, "_STALE_S", -1.0)
    new.set_generation(2)
    assert len(new._collections()) == 1 and len(new.search(np.ones(2, dtype=np.float32), 1)[0]) == 1
    left.close(), new.close()


@pytest.mark.wire
def test_a_book_whose_index_was_deleted_under_it_makes_it_anew(lasting: ChromaSettings, tmp_path: Path) -> None:
    with _taught(tmp_path / "book.db", ChromaStore(lasting)) as book:
        before = [s.text for s in book.retrieve("OPEN(thing 4)").served]
        thief = ChromaStore(lasting)
        thief.open()
        for collection in thief._collections():
            thief._delete(collection.name)
        assert [s.text for s in book.retrieve("OPEN(thing 4)").served] == before and before
        thief.close()


# -- what cannot work --------------------------------------------------------------------------------------------------
@pytest.mark.wire
def test_no_server_there_says_how_to_start_one() -> None:
    with pytest.raises(BackendUnavailable, match=r"no Chroma server answers at http://127.0.0.1:9.*chroma run"):
        ChromaStore(ChromaSettings(server="http://127.0.0.1:9")).open()


def test_chroma_not_installed_says_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "chromadb", None)
    with pytest.raises(BackendUnavailable, match="pip install chromadb"):
        ChromaStore(ChromaSettings()).open()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"server": "localhost:8000"}, "http://localhost:8000"),
        ({"server": "http://me:secret@host"}, "no server's address"),
        ({"folder": "a", "server": "http://b"}, "one of them"),
        ({"collection": "a b"}, "3 to 41"),
        ({"candidates": 0}, "whole number"),
    ],
)
def test_wrong_settings_are_named(settings: dict[str, object], said: str) -> None:
    with pytest.raises(InvalidArgument, match=said):
        ChromaSettings(**settings)  # type: ignore[arg-type]


CALLS_HOME = """
import json, sys
calls = []
def listen(event, given):
    if event in ("socket.connect", "socket.getaddrinfo"):
        calls.append(str(given[1:]))
sys.addaudithook(listen)
import numpy as np
from memo_vectorstore.chroma_store import ChromaStore
from memo_vectorstore.settings import ChromaSettings
store = ChromaStore(ChromaSettings())
store.open(); store.reset(2); store.add([1], np.ones((1, 2), np.float32)); store.search(np.ones(2, np.float32), 1)
settings = store._client.get_settings()
store.close()
heavy = [name for name in ("torch", "onnxruntime") if name in sys.modules]
print(json.dumps([calls, settings.anonymized_telemetry, heavy]))
"""


@pytest.mark.process
def test_it_tells_nobody_and_loads_no_model(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if "TELEMETRY" not in name.upper()}
    done = subprocess.run(
        [sys.executable, "-c", CALLS_HOME], capture_output=True, text=True, cwd=tmp_path, env=environment, check=True
    )
    assert json.loads(done.stdout) == [[], False, []]


LOOK = """
import sys
from pathlib import Path
from memo_vectorstore.chroma_store import ChromaStore
from memo_vectorstore.settings import ChromaSettings
from memo_core.errors import BackendUnavailable
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.exchange import add_many
from memo_core.skillbook.stats import stats_of
from memo_core.skillbook.writing.bulk_adding import Lesson
from memo_core.skillbook.model.keys import Key
from memo_core.testing.fake_embedder import FakeEmbedder

folder = Path(sys.argv[1])
store = ChromaStore(ChromaSettings(folder=str(folder / "keys")))
with Skillbook(str(folder / "book.db"), FakeEmbedder(), store) as book:
    if not stats_of(book).feedback:
        key = Key.parse("OPEN(box)")
        add_many(book, [Lesson("words", "ana", key, (f"lesson {number}",)) for number in range(1200)])
    try:
        print(book.retrieve("OPEN(box)").served[0].text, len(store))
    except BackendUnavailable as error:
        print(error)
"""


@pytest.mark.process
def test_a_damaged_folder_is_filled_again_or_named_and_ends_no_process(tmp_path: Path) -> None:
    """Chroma's native code crashes on a damaged graph, so each look is in a process of its own."""

    def look() -> str:
        done = subprocess.run([sys.executable, "-c", LOOK, str(tmp_path)], capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, (done.returncode, done.stderr)
        return done.stdout

    whole = look()
    graph = next((tmp_path / "keys").glob("*/data_level0.bin"))
    graph.write_bytes(b"\xff" * graph.stat().st_size)
    assert look() == whole
    header = next((tmp_path / "keys").glob("*/header.bin"))
    header.write_bytes(header.read_bytes()[:50])
    assert look() == whole == look()
    database = tmp_path / "keys" / "chroma.sqlite3"
    content = database.read_bytes()
    for damaged in (b"\xff" * len(content), content[: len(content) // 3] + b"\xff" * (2 * len(content) // 3)):
        database.write_bytes(damaged)
        assert f"delete {tmp_path / 'keys'}" in look()
