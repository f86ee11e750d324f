"""A table by id finds what a dict finds, whatever the ids are."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from memo_core.skillbook import id_table
from memo_core.skillbook.id_table import IdTable

IDS = st.one_of(st.integers(0, 3000), st.integers(-(2**63), 2**63 - 1))


@settings(deadline=None)
@given(st.lists(st.dictionaries(IDS, st.integers(0, 10**6)), max_size=3), st.lists(IDS))
def test_the_last_number_put_is_found(several: list[dict[int, int]], asked: list[int]) -> None:
    table, known = IdTable(), {}
    for some in several:
        table.put(np.array([*some], np.int64), np.array([*some.values()], np.int64))
        known |= some
        every = [*known, *asked]
        assert table.get(np.array(every, np.int64)).tolist() == [known.get(one, -1) for one in every]


def test_an_id_that_no_book_has_takes_no_room() -> None:
    table = IdTable()
    table.put(np.array([5, 2**40]), np.array([1, 2]))
    assert table.get(np.array([5, 2**40, 6])).tolist() == [1, 2, -1]
    assert table.nbytes < 10_000


@pytest.mark.parametrize("far", [1, 100])
def test_where_the_table_ends_makes_no_difference(monkeypatch: pytest.MonkeyPatch, far: int) -> None:
    monkeypatch.setattr(id_table, "_FAR", far)
    table = IdTable()
    table.put(np.arange(50, 200, 3), np.arange(50))
    assert table.get(np.arange(50, 200, 3)).tolist() == list(range(50))
    assert (table.get(np.array([0, 51, 198, 200, 10**9])) == -1).all()
