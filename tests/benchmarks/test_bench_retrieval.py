"""``memo bench retrieval`` measures what it says."""

from __future__ import annotations

import pytest
from memo_benchmarks.retrieval import bench_retrieval

from memo_core.errors import InvalidArgument
from memo_core.testing.fake_embedder import FakeEmbedder
from memo_core.testing.fake_store import FakeStore


def test_both_sides_are_measured_on_one_book() -> None:
    found = bench_retrieval(FakeEmbedder, FakeStore, entries=400, keys=20, questions=40)
    assert (found["entries"], found["keys"], found["questions"], found["store"]) == (400, 20, 40, "FakeStore")
    assert found["dimension"] == 2 * FakeEmbedder().dimension
    assert found["ratio"] == pytest.approx(found["by_key_ms"] / found["flat_ms"])
    assert found["flat_search_ms"] > 0 and 0 < found["row_fetch_ms"] < found["flat_ms"]


@pytest.mark.parametrize(("entries", "keys"), [(10, 300), (1000, 1), (1000, 9999)])
def test_sizes_that_cannot_be_measured_are_refused(entries: int, keys: int) -> None:
    with pytest.raises(InvalidArgument):
        bench_retrieval(FakeEmbedder, FakeStore, entries, keys)
