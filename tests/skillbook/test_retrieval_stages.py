"""Retrieval from a large book: the two stages find what scoring every entry would, or nearly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from memo_benchmarks.generated_book import BookSize, WordVectors, fill, keys_of

from memo_core.skillbook import exchange
from memo_core.skillbook.book import Skillbook
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.retriever import RetrievalSettings
from memo_core.skillbook.writing.bulk_adding import Lesson
from memo_core.testing.fake_store import FakeStore

SIZE = BookSize(3000, 60, general=0.05)
BY_SCORE = RetrievalSettings(newest=False, built_weight=0.0)


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("large") / "book.db"
    with Skillbook(str(made), WordVectors(), FakeStore()) as book:
        assert fill(book, SIZE) == SIZE.entries
        book.prepare()
    return made


def test_the_candidates_hold_what_scoring_every_entry_would_retrieve(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def retrieved() -> list[set[int]]:
        with Skillbook(str(path), WordVectors(), FakeStore(), BY_SCORE, read_only=True) as book:
            return [set(book.retrieve(key).entry_ids) for key in keys_of(SIZE)]

    found = retrieved()
    for name in ("UNDER_KEYS", "BY_TEXT"):
        monkeypatch.setattr(f"memo_core.skillbook.retrieval.retriever.{name}", SIZE.entries)
    every = retrieved()
    recall = [len(one & other) / len(other) for one, other in zip(found, every, strict=True)]
    assert np.mean(recall) > 0.95 and min(recall) > 0.7


def test_nothing_is_embedded_or_written_when_all_is_prepared(path: Path) -> None:
    class Refusing(WordVectors):
        def embed(self, texts: object) -> np.ndarray:
            raise AssertionError(f"was asked for {texts}")

    before = path.read_bytes()
    with Skillbook(str(path), Refusing(), FakeStore(), read_only=True) as book:
        book.retrieve(keys_of(SIZE)[0])
    assert path.read_bytes() == before


def test_a_new_entry_of_a_large_key_is_retrieved_and_a_withdrawn_one_is_gone(tmp_path: Path) -> None:
    key = Key.parse("OPEN(microwave)")
    with Skillbook(str(tmp_path / "b.db"), WordVectors(), FakeStore()) as book:
        parts = tuple(f"hold part {n} firmly" for n in range(500))
        exchange.add_many(book, [Lesson("no", "ana", key, parts, ("mind hot things",))])
        book.retrieve(key)
        exchange.add_many(book, [Lesson("no", "bob", key, ("open microwave",), ("open microwave",))])
        found = book.retrieve(key)
        assert found.corrections[0].text == found.general[0].text == "open microwave"
        assert book.forget("bob").entries == 2
        found = book.retrieve(key)
        assert "open microwave" not in {one.text for one in found.served} and len(found.general) == 1


def test_an_old_entry_of_a_large_key_is_found_by_its_text(tmp_path: Path) -> None:
    key = Key.parse("OPEN(microwave)")
    texts = ("open microwave", *(f"hold part {n} firmly" for n in range(500)))
    with Skillbook(str(tmp_path / "b.db"), WordVectors()) as book:
        exchange.add_many(book, [Lesson("no", "ana", key, texts)])
    with Skillbook(str(tmp_path / "b.db"), WordVectors(), FakeStore(), BY_SCORE, read_only=True) as book:
        assert book.retrieve(key).corrections[0].text == "open microwave"


def test_what_was_forgotten_leaves_the_store(tmp_path: Path) -> None:
    store, key = FakeStore(), Key.parse("OPEN(microwave)")
    with Skillbook(str(tmp_path / "b.db"), WordVectors(), store, RetrievalSettings(corrections=1)) as book:
        exchange.add_many(book, [Lesson("no", who, key, (f"{who} pulls it",)) for who in ("ana", "bob", "cid")])
        assert len(book.retrieve(key).corrections) == len(store) == 3
        book.forget("ana")
        assert len(book.retrieve(key).corrections) == len(store) == 2
