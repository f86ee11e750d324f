"""Unit vectors of texts: from memory, from the book's cache, or from the embedder, in that order."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import sqlalchemy as sa

from memo_core.interfaces.embedder import Embedder
from memo_core.skillbook.store import tables
from memo_core.skillbook.store.database import Database, SkillbookError

_KEPT = 50_000  # vectors in memory
PLACES = 48  # values a prepared statement asks for: what is served of a subtask fits in
PLACE_NAMES = [f"value{n}" for n in range(PLACES)]
_V = tables.vectors.c
_BY_DIGEST = sa.select(_V.digest, _V.vector).where(
    _V.embedder == sa.bindparam("embedder"), _V.digest.in_([sa.bindparam(name) for name in PLACE_NAMES])
)


def batched(values: Iterable[Any], size: int) -> Iterator[list[Any]]:
    """Consecutive parts of at most ``size``."""
    left = iter(values)
    while part := list(itertools.islice(left, size)):
        yield part


def places(values: list[Any]) -> dict[str, Any]:
    """Parameters for ``PLACE_NAMES``: the values, filled up with the first."""
    filled = values + values[:1] * (PLACES - len(values))
    return dict(zip(PLACE_NAMES, filled, strict=True))


def digest(text: str) -> str:
    """The name under which a text's vector is stored."""
    return hashlib.sha256(text.encode()).hexdigest()


def same_embedder(one: str, other: str) -> bool:
    """Whether two names are the same embedder's. After a # stands a fingerprint of the model; then the title before it,
    such as the name of the folder that the model was read from, does not count."""
    return one == other or ("#" in one and "#" in other and one.rpartition("#")[2] == other.rpartition("#")[2] != "")


class TextVectors:
    """Unit vectors, float32. The embedder is opened only for a text that has not been embedded before."""

    def __init__(self, database: Database, embedder: Embedder) -> None:
        self._database = database
        self._embedder = embedder
        self._known: dict[str, np.ndarray] = {}
        self._name = ""

    @property
    def name(self) -> str:
        """The embedder's name, in the spelling that the book has already."""
        return self._name or self._embedder.name

    def check_embedder(self) -> None:
        """Raises ``SkillbookError`` when the book's vectors are another embedder's."""
        with self._database.read() as connection:
            stored = self._database.meta(connection).get("embedder", "")
        if same_embedder(stored, self._embedder.name):
            self._name = stored
        elif stored:
            raise SkillbookError(
                self._database.name,
                f"its keys and texts were embedded by {stored!r}, the configured embedder is {self.name!r}",
                f"configure the former, or embed it anew: memo skillbook reembed --book {self._database.name}",
            )

    def get(self, texts: Sequence[str]) -> np.ndarray:
        """Shape (len(texts), dimension). Newly embedded texts are cached in the book unless it is read-only."""
        wanted = {text: digest(text) for text in texts if text not in self._known}
        if wanted:
            if len(self._known) > _KEPT:
                self._known.clear()
                wanted = {text: digest(text) for text in texts}
            self._load(wanted)
            missing = [text for text in wanted if text not in self._known]
            if missing:
                self._embed(missing)
        return np.stack([self._known[text] for text in texts])

    def chain(self, texts: Sequence[str]) -> list[int]:
        """Indices of the texts, ordered so that each is followed by the most similar of the remaining ones."""
        vectors = self.get(texts)
        taken = np.zeros(len(texts), dtype=bool)
        order = [0]
        while len(order) < len(texts):
            taken[order[-1]] = True
            order.append(int(np.argmax(np.where(taken, -np.inf, vectors @ vectors[order[-1]]))))
        return order

    def forget(self, texts: Iterable[str]) -> None:
        for text in texts:
            self._known.pop(text, None)

    def _load(self, wanted: dict[str, str]) -> None:
        by_digest = {value: text for text, value in wanted.items()}
        for part in batched(by_digest, PLACES):
            asked = {"embedder": self.name} | places(part)
            for found, blob in self._database.fetch(_BY_DIGEST, asked):
                self._known[by_digest[found]] = np.frombuffer(blob, dtype="<f4")

    def _embed(self, texts: list[str]) -> None:
        self._embedder.open()
        vectors = np.asarray(self._embedder.embed(texts), dtype="<f4")
        self._known.update(zip(texts, vectors, strict=True))
        if self._database.read_only:
            return
        with self._database.write() as connection:
            meta = self._database.meta(connection)
            if "embedder" not in meta:
                self._database.set_meta(connection, "embedder", self.name)
                self._database.set_meta(connection, "dimension", str(vectors.shape[1]))
            elif meta["embedder"] != self.name or int(meta["dimension"]) != vectors.shape[1]:
                raise SkillbookError(
                    self._database.name,
                    f"it was embedded by {meta['embedder']!r} with {meta['dimension']} dimensions, "
                    f"this is {self.name!r} with {vectors.shape[1]}",
                    f"memo skillbook reembed --book {self._database.name}",
                )
            rows = [
                {"embedder": self.name, "digest": digest(t), "vector": v.tobytes()}
                for t, v in zip(texts, vectors, strict=True)
            ]
            connection.execute(self._database.upsert(tables.vectors), rows)
