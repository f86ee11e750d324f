"""FAISS keeps every rule of vector stores, and each rule rejects a store that breaks it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from memo_vectorstore.faiss_store import FaissStore
from memo_vectorstore.plugin import memo_vector_stores
from memo_vectorstore.settings import FaissSettings

from memo_core.skillbook.retrieval.text_search import ExactStore
from memo_core.testing.fake_store import FakeStore
from memo_core.testing.vectorstore import RULES, check_vector_store


@pytest.mark.parametrize("rule", RULES)
def test_faiss_in_memory(rule: str) -> None:
    [backend] = [one for one in memo_vector_stores() if one.name == "faiss"]
    RULES[rule](lambda: backend.factory(backend.config()))


@pytest.mark.parametrize("rule", RULES)
def test_faiss_with_a_file(rule: str, tmp_path: Path) -> None:
    RULES[rule](lambda: FaissStore(FaissSettings(str(tmp_path / "sub" / "keys.faiss"))))


@pytest.mark.parametrize("rule", RULES)
def test_the_fake_store(rule: str) -> None:
    RULES[rule](FakeStore)


@pytest.mark.parametrize("rule", RULES)
def test_the_exact_store_of_a_book_without_one(rule: str) -> None:
    RULES[rule](ExactStore)


class Distances(FakeStore):
    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        ids, products = super().search(query, count)
        return ids, 1 - products


class SmallestFirst(FakeStore):
    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        ids, products = super().search(query, count)
        return ids[::-1], products[::-1]


class Cosines(FakeStore):
    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
        super().add(ids, vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


class ShortIds(FakeStore):
    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        ids, products = super().search(query, count)
        return ids.astype(np.int32).astype(np.int64), products


class Padded(FakeStore):
    def search(self, query: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
        ids, products = super().search(query, count)
        missing = max(0, count - len(ids))
        return np.append(ids, [-1] * missing).astype(np.int64), np.append(products, [-1e30] * missing)


class FirstStays(FakeStore):
    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
        new = [n for n, i in enumerate(ids) if int(i) not in self._vectors]
        super().add([ids[n] for n in new], np.asarray(vectors)[new])


class NeverRemoves(FakeStore):
    def remove(self, ids: Sequence[int]) -> None: ...


class RaisesOnUnknown(FakeStore):
    def remove(self, ids: Sequence[int]) -> None:
        for i in ids:
            del self._vectors[int(i)]


class KeepsOnReset(FakeStore):
    def reset(self, dimension: int) -> None:
        self._dimension = dimension
        self._generation = None


class KeepsGenerationOnReset(FakeStore):
    def reset(self, dimension: int) -> None:
        kept = self._generation
        super().reset(dimension)
        self._generation = kept


class TakesAnything(FakeStore):
    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
        given = np.array(vectors, dtype=np.float32)
        self._vectors.update(zip(map(int, ids), np.resize(given, (len(ids), self._dimension)), strict=True))


class SharesArrays(FakeStore):
    def add(self, ids: Sequence[int], vectors: np.ndarray) -> None:
        self._vectors.update(zip(map(int, ids), np.asarray(vectors), strict=True))


class ClaimsAGeneration(FakeStore):
    def generation(self) -> int | None:
        return self._generation or 0


class ClosesOnce(FakeStore):
    closed = False

    def close(self) -> None:
        if self.closed:
            raise RuntimeError("closed already")
        self.closed = True


WRONG = {
    Distances: "finds_the_largest_inner_product",
    SmallestFirst: "orders_largest_first",
    Cosines: "does_not_normalise",
    ShortIds: "keeps_ids",
    Padded: "answers_at_most_count",
    FirstStays: "adding_replaces",
    NeverRemoves: "removes",
    RaisesOnUnknown: "removes",
    KeepsOnReset: "reset_forgets",
    KeepsGenerationOnReset: "reset_forgets",
    TakesAnything: "refuses_a_wrong_dimension",
    SharesArrays: "keeps_a_copy",
    ClaimsAGeneration: "remembers_its_generation_or_none",
    ClosesOnce: "opens_and_closes_twice",
}


@pytest.mark.parametrize(("wrong", "rule"), WRONG.items(), ids=lambda value: getattr(value, "__name__", value))
def test_a_wrong_store_is_rejected_by_its_rule(wrong: type[FakeStore], rule: str) -> None:
    with pytest.raises((AssertionError, RuntimeError, KeyError)):
        RULES[rule](wrong)
    with pytest.raises(AssertionError, match="Broken"):
        check_vector_store(wrong)


def test_every_rule_has_a_store_that_breaks_it() -> None:
    assert set(WRONG.values()) == set(RULES)


def test_a_file_survives_the_process_with_its_generation(tmp_path: Path) -> None:
    file = str(tmp_path / "keys.faiss")
    vectors = np.eye(3, dtype=np.float32)
    store = FaissStore(FaissSettings(file))
    store.open()
    store.reset(3)
    store.add([1, 2, 3], vectors)
    store.set_generation(7)
    store.add([4], vectors[:1] * 2)  # after the generation was set: not part of it
    store.close()
    again = FaissStore(FaissSettings(file))
    again.open()
    assert (len(again), again.generation()) == (3, 7)
    assert [int(i) for i in again.search(vectors[1], 1)[0]] == [2]
    again.close()
