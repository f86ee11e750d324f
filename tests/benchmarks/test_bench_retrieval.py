"""``memo bench retrieval`` measures what it says."""

from __future__ import annotations

import pytest
from memo_benchmarks.generated_book import BookSize
from memo_benchmarks.retrieval import bench_retrieval

from memo_core.errors import InvalidArgument
from memo_core.testing.fake_store import FakeStore


def test_a_retrieval_and_a_plain_search_are_measured_on_one_book() -> None:
    shares: list[float] = []
    found = bench_retrieval(FakeStore, entries=400, keys=20, questions=40, progress=shares.append)
    assert (found["entries"], found["keys"], found["questions"]) == (400, 20, 40)
    assert found["ratio"] == pytest.approx(found["p50_ms"] / found["plain_p50_ms"])
    assert 0 < found["p50_ms"] <= found["p99_ms"] and found["first_ms"] > 0
    assert shares == sorted(shares) and shares[-1] <= 1


@pytest.mark.parametrize(("entries", "keys"), [(10, 300), (1000, 1), (1_000_000, 100_000)])
def test_sizes_that_cannot_be_made_are_refused(entries: int, keys: int) -> None:
    with pytest.raises(InvalidArgument):
        BookSize(entries, keys)
