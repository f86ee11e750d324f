"""Conformance of embedders: ``check_embedder(make)`` runs every rule, each can be run alone as a test."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import numpy as np

from memo_core.interfaces.embedder import Embedder
from memo_core.testing.rules import Rules

MakeEmbedder = Callable[[], Embedder]
Rule = Callable[[MakeEmbedder], None]

RULES: Rules[Rule] = Rules()
rule = RULES.rule


TEXTS = (
    "open",
    "to open an object with a robot arm",
    "Pull the handle along an arc about the hinge.",
    "Stack the red cube on the green cube.",
    "Öffne die Tür, 開ける",
    "def pull(name):\n    return name",
    "",
    "word " * 2000,
)


def _opened(make: MakeEmbedder) -> Embedder:
    embedder = make()
    embedder.open()
    return embedder


@rule
def returns_unit_vectors(make: MakeEmbedder) -> None:
    """float32, shape (texts, dimension), length 1, finite: also for an empty and a very long text."""
    embedder = _opened(make)
    vectors = embedder.embed(TEXTS)
    assert vectors.dtype == np.float32, f"dtype {vectors.dtype}"
    assert vectors.shape == (len(TEXTS), embedder.dimension), f"shape {vectors.shape}, dimension {embedder.dimension}"
    lengths = np.linalg.norm(vectors, axis=1)
    assert bool(np.all(np.abs(lengths - 1) < 1e-4)), f"lengths {lengths}"
    embedder.close()


@rule
def same_text_same_vector(make: MakeEmbedder) -> None:
    """Whatever is embedded beside it, before it or after it, and by another instance."""
    embedder = _opened(make)
    alone = np.concatenate([embedder.embed([text]) for text in TEXTS])
    together = embedder.embed(TEXTS)
    reversed_order = embedder.embed(TEXTS[::-1])[::-1]
    embedder.close()
    other = _opened(make)
    again = other.embed(TEXTS)
    other.close()
    for name, vectors in (
        ("in a batch", together),
        ("in another order", reversed_order),
        ("by another instance", again),
    ):
        worst = float(np.abs(vectors - alone).max())
        assert worst < 1e-5, f"a text has another vector {name}: {worst:.2g}"


@rule
def different_texts_differ(make: MakeEmbedder) -> None:
    """Vectors vary with their text."""
    embedder = _opened(make)
    vectors = embedder.embed(TEXTS)
    products = vectors @ vectors.T - 2 * np.eye(len(TEXTS))
    assert float(products.max()) < 0.999, "two different texts have one vector"
    embedder.close()


@rule
def similar_texts_are_closer(make: MakeEmbedder) -> None:
    """A small change of a sentence stays closer to it than another subject."""
    embedder = _opened(make)
    a, b, c = embedder.embed(
        ["Pull the handle along an arc.", "Pull the handle along a wide arc.", "The invoice is due on Monday morning."]
    )
    assert float(a @ b) > float(a @ c) + 0.1, f"{float(a @ b):.2f} against {float(a @ c):.2f}"
    embedder.close()


@rule
def embeds_nothing(make: MakeEmbedder) -> None:
    """No texts give an array of shape (0, dimension)."""
    embedder = _opened(make)
    shape = embedder.embed([]).shape
    assert shape == (0, embedder.dimension), shape
    embedder.close()


@rule
def has_a_name_before_open(make: MakeEmbedder) -> None:
    """The name is known before ``open``, the same for two instances, and short enough to be kept."""
    first, second = make().name, make().name
    assert isinstance(first, str) and first.strip() and len(first) <= 200, f"name {first!r}"
    assert first == second, f"two instances are called {first!r} and {second!r}"


@rule
def opens_and_closes_twice(make: MakeEmbedder) -> None:
    """``open`` and ``close`` are idempotent; closing before opening is no error; it can be opened again."""
    embedder = make()
    embedder.close()
    embedder.open()
    embedder.open()
    embedder.close()
    embedder.close()
    embedder.open()
    assert embedder.embed(["open"]).shape == (1, embedder.dimension)
    embedder.close()


@rule
def returns_its_own_array(make: MakeEmbedder) -> None:
    """Changing what was returned changes no later answer."""
    embedder = _opened(make)
    first = embedder.embed(["open"])
    kept = first.copy()
    with contextlib.suppress(ValueError):  # read-only is fine too
        first[:] = 0
    assert bool(np.allclose(embedder.embed(["open"]), kept)), "a returned array is shared"
    embedder.close()


def check_embedder(make: MakeEmbedder) -> None:
    """Run all rules. Raises ``AssertionError`` naming the first that is broken."""
    for name, check in RULES.items():
        try:
            check(make)
        except Exception as error:
            raise AssertionError(f"{name}: {check.__doc__} Broken: {error}") from error
