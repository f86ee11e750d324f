"""``memo bench vectorstore``: what a vector store finds of the best there is, and how long it takes."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from memo_core.interfaces.vectorstore import VectorStore

_DIMENSION = 384  # of the default sentence model; a key's vector has three of them
_BEST = 20


def bench_vectorstore(
    make: Callable[[], VectorStore], keys: int, queries: int, progress: Callable[[float], None]
) -> dict[str, Any]:
    """Recall@20 of exact search, seconds to fill and milliseconds a search, on keys and on random directions."""
    rng = np.random.default_rng(0)
    cases = {"keys": _keys(rng, keys, queries), "random": _directions(rng, keys, queries)}
    measured: dict[str, Any] = {"vectors": keys, "queries": queries, "dimension": 3 * _DIMENSION}
    for number, (case, (vectors, questions)) in enumerate(cases.items()):
        measured |= {f"{case}_{what}": round(n, 4) for what, n in _measure(make(), vectors, questions).items()}
        progress((number + 1) / len(cases))
    return measured


def _measure(store: VectorStore, vectors: np.ndarray, questions: np.ndarray) -> dict[str, float]:
    store.open()
    try:
        started = time.perf_counter()
        store.reset(vectors.shape[1])
        store.add(range(len(vectors)), vectors)
        filled = time.perf_counter() - started
        found, times = 0, []
        best = min(_BEST, len(vectors))
        for question in questions:
            started = time.perf_counter()
            ids, _ = store.search(question, best)
            times.append(time.perf_counter() - started)
            products = vectors @ question
            # equally good is good: many keys share a verb and an object
            found += int((products[ids] >= np.partition(products, -best)[-best] - 1e-5).sum())
        return {
            "recall_at_20": found / (best * len(questions)),
            "fill_s": filled,
            "search_p50_ms": 1e3 * float(np.median(times)),
            "search_p99_ms": 1e3 * float(np.quantile(times, 0.99)),
        }
    finally:
        store.reset(vectors.shape[1])  # a lasting store is left empty, so that nobody takes this for an index
        store.close()


def _keys(rng: np.random.Generator, count: int, queries: int) -> tuple[np.ndarray, np.ndarray]:
    """Verbs and objects made at random, shared as keys share them: [v_act ; v_moved ; v_place], objects of length 1."""
    verbs = _unit(rng, 40)
    nouns = 0.6 * _unit(rng, 200) + 0.8 * _unit(rng, 1)  # phrases around nouns have much in common
    nouns /= np.linalg.norm(nouns, axis=1, keepdims=True)
    places = nouns[rng.integers(200, size=count)] * rng.integers(0, 2, size=(count, 1))
    objects = np.concatenate([nouns[rng.integers(200, size=count)], places], axis=1)
    objects /= np.linalg.norm(objects, axis=1, keepdims=True)
    vectors = np.concatenate([verbs[rng.integers(40, size=count)], objects], axis=1)
    asked = [0.75 * verbs[rng.integers(40, size=queries)], 0.25 * objects[rng.integers(count, size=queries)]]
    return vectors.astype(np.float32), np.concatenate(asked, axis=1).astype(np.float32)


def _directions(rng: np.random.Generator, count: int, queries: int) -> tuple[np.ndarray, np.ndarray]:
    """The hardest there are for a graph of neighbours: nothing is near anything."""
    return _unit(rng, count, 3 * _DIMENSION), _unit(rng, queries, 3 * _DIMENSION)


def _unit(rng: np.random.Generator, count: int, dimension: int = _DIMENSION) -> np.ndarray:
    vectors = rng.normal(size=(count, dimension)).astype(np.float32)
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
