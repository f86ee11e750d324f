"""Conformance of vector stores: ``check_vector_store(make)`` runs every rule, each can be run alone as a test.

@pytest.mark.parametrize("rule", RULES)
def test_my_store(rule):
    RULES[rule](MyStore)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from memo_core.interfaces.vectorstore import VectorStore
from memo_core.testing.rules import Rules

MakeStore = Callable[[], VectorStore]
Rule = Callable[[MakeStore], None]

RULES: Rules[Rule] = Rules()
rule = RULES.rule


def _random(count: int, dimension: int, seed: int) -> np.ndarray:
    vectors = np.random.default_rng(seed).normal(size=(count, dimension)).astype(np.float32)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _filled(make: MakeStore, ids: list[int], vectors: np.ndarray) -> VectorStore:
    store = make()
    store.open()
    store.reset(vectors.shape[1])
    store.add(ids, vectors)
    return store


@rule
def finds_the_largest_inner_product(make: MakeStore) -> None:
    """The best of a search is the true best, and every score is the inner product, larger is more alike."""
    vectors = _random(200, 12, 1)
    ids = [7 * i + 3 for i in range(200)]
    store = _filled(make, ids, vectors)
    for row in (0, 50, 199):
        found, products = store.search(vectors[row], 5)
        assert int(found[0]) == ids[row], f"the vector itself was not found first: {found}"
        wanted = [float(vectors[ids.index(int(i))] @ vectors[row]) for i in found]
        assert np.allclose(products, wanted, atol=1e-4), f"scores {products} are not the inner products {wanted}"
    store.close()


@rule
def orders_largest_first(make: MakeStore) -> None:
    """Scores never grow along the answer."""
    store = _filled(make, list(range(100)), _random(100, 8, 2))
    for query in _random(5, 8, 3):
        _, products = store.search(query, 20)
        assert len(products) == 20 and bool(np.all(np.diff(products) <= 1e-6)), f"not largest first: {products}"
    store.close()


@rule
def does_not_normalise(make: MakeStore) -> None:
    """Longer vectors have larger inner products; a store of cosines would lose the weights λ1 and λ2."""
    vectors = np.array([[1.0, 0.0], [3.0, 0.0], [0.0, 1.0]], dtype=np.float32)
    store = _filled(make, [1, 2, 3], vectors)
    found, products = store.search(np.array([2.0, 0.0], dtype=np.float32), 2)
    assert [int(i) for i in found] == [2, 1] and np.allclose(products, [6.0, 2.0], atol=1e-4), (found, products)
    store.close()


@rule
def keeps_ids(make: MakeStore) -> None:
    """Any 63-bit id comes back as it was given."""
    ids = [0, 5, 2**40 + 1, 2**62]
    store = _filled(make, ids, _random(4, 6, 4))
    found, _ = store.search(_random(1, 6, 5)[0], 10)
    assert found.dtype == np.int64 and sorted(int(i) for i in found) == ids, found
    store.close()


@rule
def answers_at_most_count(make: MakeStore) -> None:
    """As many as asked for, or all there are; none from an empty store and no padding."""
    store = _filled(make, [1, 2, 3], _random(3, 4, 6))
    query = _random(1, 4, 7)[0]
    sizes = [len(store.search(query, count)[0]) for count in (0, 1, 2, 3, 50)]
    assert sizes == [0, 1, 2, 3, 3], sizes
    store.reset(4)
    found, products = store.search(query, 5)
    assert len(found) == len(products) == len(store) == 0, "an empty store answered"
    store.close()


@rule
def adding_replaces(make: MakeStore) -> None:
    """An id that is added again has the new vector only."""
    store = _filled(make, [1, 2], np.array([[1, 0], [0, 1]], dtype=np.float32))
    store.add([1], np.array([[0, 2]], dtype=np.float32))
    found, products = store.search(np.array([0, 1], dtype=np.float32), 5)
    assert len(store) == 2 and [int(i) for i in found] == [1, 2] and np.allclose(products, [2, 1], atol=1e-4), (
        found,
        products,
    )
    store.close()


@rule
def removes(make: MakeStore) -> None:
    """What was removed is not found; unknown ids are ignored."""
    vectors = _random(10, 5, 8)
    store = _filled(make, list(range(10)), vectors)
    store.remove([3, 99])
    found, _ = store.search(vectors[3], 10)
    assert len(store) == 9 and 3 not in {int(i) for i in found}, found
    store.close()


@rule
def reset_forgets(make: MakeStore) -> None:
    """After reset nothing is left, the dimension is the new one and no generation is claimed."""
    store = _filled(make, [1, 2], _random(2, 4, 9))
    store.set_generation(5)
    store.reset(3)
    assert len(store) == 0 and store.generation() is None, f"{len(store)} left, generation {store.generation()}"
    store.add([9], _random(1, 3, 10))
    assert [int(i) for i in store.search(_random(1, 3, 11)[0], 4)[0]] == [9]
    store.close()


@rule
def refuses_a_wrong_dimension(make: MakeStore) -> None:
    """Vectors of another dimension raise, and leave the store as it was."""
    store = _filled(make, [1], _random(1, 4, 12))
    try:
        store.add([2], _random(1, 5, 13))
    except Exception:
        assert len(store) == 1
    else:
        raise AssertionError("a vector of another dimension was taken")
    store.close()


@rule
def keeps_a_copy(make: MakeStore) -> None:
    """Changing an array after it was added changes nothing."""
    vectors = _random(3, 4, 14)
    kept = vectors.copy()
    store = _filled(make, [0, 1, 2], vectors)
    vectors[:] = 0
    _, products = store.search(kept[1], 1)
    assert np.allclose(products, [1.0], atol=1e-4), products
    store.close()


@rule
def remembers_its_generation_or_none(make: MakeStore) -> None:
    """``generation`` is None before ``set_generation`` and afterwards that number or still None."""
    store = _filled(make, [1], _random(1, 4, 15))
    assert store.generation() is None, "a generation was claimed that nobody set"
    store.set_generation(12345678901)
    assert store.generation() in (None, 12345678901), store.generation()
    store.close()


@rule
def opens_and_closes_twice(make: MakeStore) -> None:
    """``open`` and ``close`` are idempotent; closing before opening is no error; it can be opened again."""
    store = make()
    store.close()
    store.open()
    store.open()
    store.close()
    store.close()
    store.open()
    store.reset(3)
    store.add([1], _random(1, 3, 16))
    assert len(store) == 1
    store.close()


def check_vector_store(make: MakeStore) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken."""
    for name, check in RULES.items():
        try:
            check(make)
        except Exception as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error
