"""FAISS above its exact size: inverted lists keep every rule of vector stores, and find nearly all that is near."""

from __future__ import annotations

import gc
from pathlib import Path

import numpy as np
import pytest
from memo_vectorstore.faiss_store import FaissStore
from memo_vectorstore.settings import FaissSettings

from memo_core.errors import InvalidArgument

COUNT, DIMENSION = 3000, 32


def grouped(count: int = COUNT) -> np.ndarray:
    """Unit vectors around 40 directions."""
    rng = np.random.default_rng(1)
    centres = rng.standard_normal((40, DIMENSION))
    made = centres[rng.integers(40, size=count)] + 0.5 * rng.standard_normal((count, DIMENSION))
    return (made / np.linalg.norm(made, axis=1, keepdims=True)).astype(np.float32)


def filled(settings: FaissSettings, vectors: np.ndarray) -> FaissStore:
    store = FaissStore(settings)
    store.open()
    store.reset(DIMENSION)
    store.add(range(len(vectors)), vectors)
    return store


def test_lists_find_nearly_all_that_is_nearest_and_more_probes_find_more() -> None:
    vectors = grouped()
    found = {}
    for probes in (1, 16):
        store = filled(FaissSettings(flat_up_to=100, probes=probes), vectors)
        hits = 0
        for question in vectors[:60]:
            exact = set(np.argsort(-(vectors @ question))[:10].tolist())
            ids, products = store.search(question, 10)
            hits += len(exact & set(ids.tolist()))
            assert np.all(np.diff(products) <= 1e-6) and np.allclose(products, vectors[ids] @ question, atol=0.02)
        found[probes] = hits / 600
        store.close()
    assert found[16] > 0.95 and found[16] > found[1]


def test_lists_forget_what_is_removed_and_take_what_is_added() -> None:
    vectors = grouped()
    store = filled(FaissSettings(flat_up_to=100), vectors)
    assert store.search(vectors[7], 1)[0].tolist() == [7]
    store.remove([7, 99_999])
    assert 7 not in store.search(vectors[7], 5)[0] and len(store) == COUNT - 1
    store.add([50_000], vectors[7:8])
    assert store.search(vectors[7], 1)[0].tolist() == [50_000] and 50_000 in store.ids()
    store.close()


def test_lists_survive_the_process_and_a_removed_vector_leaves_the_file_at_once(tmp_path: Path) -> None:
    vectors, settings = grouped(), FaissSettings(str(tmp_path / "texts.faiss"), flat_up_to=100)

    def reopened() -> FaissStore:
        store = FaissStore(settings)
        store.open()
        return store

    store = filled(settings, vectors)
    store.set_generation(1)
    store.add([COUNT], vectors[:1])
    store.set_generation(2)  # one in three thousand is new: the file is as it was
    store.close()
    store = reopened()
    assert (len(store), store.generation()) == (COUNT, 1) and set(store.ids().tolist()) == set(range(COUNT))
    assert store.search(vectors[5], 1)[0].tolist() == [5]
    store.remove([5])
    store.set_generation(3)
    store.close()
    store = reopened()
    assert (len(store), store.generation()) == (COUNT - 1, 3) and 5 not in store.ids()
    store.close()
    damaged = bytearray((tmp_path / "texts.faiss").read_bytes())
    damaged[-50] ^= 1
    (tmp_path / "texts.faiss").write_bytes(damaged)
    store = reopened()
    assert len(store) == 0 and store.generation() is None
    store.close()


@pytest.mark.parametrize("wrong", [{"flat_up_to": 5}, {"probes": 0}, {"probes": True}])
def test_settings_that_cannot_be_are_refused(wrong: dict[str, int]) -> None:
    with pytest.raises(InvalidArgument, match="vectorstore"):
        FaissSettings(**wrong)


def test_the_garbage_collector_does_not_walk_through_the_ids() -> None:
    few, many = (filled(FaissSettings(flat_up_to=100), grouped(count)) for count in (10, COUNT))
    try:
        walked = [sum(len(gc.get_referents(one)) for one in vars(store).values()) for store in (few, many)]
        assert walked[0] == walked[1]
    finally:
        few.close()
        many.close()
