"""Similarity r(q, v) of a subtask to every key of a skillbook: all keys, exactly."""

from __future__ import annotations

from functools import cached_property

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.skillbook.model.action_relations import Actions
from memo_core.skillbook.model.entries import GLOBAL_KEY
from memo_core.skillbook.model.keys import Key, as_text
from memo_core.skillbook.retrieval.score import TIE, key_score
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.store.trials import all_failing
from memo_core.skillbook.vectors.key_vectors import KeyVectors
from memo_core.skillbook.vectors.text_vectors import TextVectors


@attrs.frozen(eq=False)
class KeyScores:
    """The terms of r(q, v) of every key, by its row in ``BookKeys``; float64, shape (n,)."""

    scores: np.ndarray
    action_cosines: np.ndarray
    objects_cosines: np.ndarray
    moved_cosines: np.ndarray  # cosine of the moved objects alone, without the destination
    exchanged: np.ndarray  # x(q, v) in [0, 1]: the part of the objects' agreement that holds in exchanged roles only

    @property
    def best_first(self) -> np.ndarray:
        """Rows by descending r, int64 (n,)."""
        return np.argsort(-self.scores, kind="stable")


@attrs.frozen(eq=False)
class BookKeys:
    """The keys with active entries in one generation of the book, by ascending id. Arrays have one row a key."""

    generation: int
    book: str  # identity of the book and of its embedding
    ids: np.ndarray  # int64 (n,)
    keys: list[Key]
    sizes: dict[str, np.ndarray]  # by kind, number of active entries, int64 (n,)
    total: int  # active entries, general statements included
    global_id: int | None  # id of the global key, if it has entries
    aliases: dict[str, Key]
    several: bool  # whether an active note has several keys
    failing: frozenset[int]  # templates that fail when they are run again in a simulator
    actions: np.ndarray  # unit vectors, float32 (n, d)
    objects: np.ndarray  # unit vectors: moved objects, then destination, float32 (n, 2 d)
    vectors: np.ndarray  # unit vectors of the keys' words, float32 (n, d)

    @cached_property
    def row_of(self) -> dict[int, int]:
        """Row by id."""
        return {key: row for row, key in enumerate(self.ids.tolist())}

    def of(self, number: int) -> Key:
        """The key with this id."""
        return self.keys[self.row_of[number]]

    def opposite(self, action: str, relations: Actions) -> np.ndarray:
        """Whether each key's action undoes ``action``, bool (n,)."""
        against = {verb: relations.opposite(action, verb) for verb in {key.action for key in self.keys}}
        return np.array([against[key.action] for key in self.keys], bool)

    def score(self, action: np.ndarray, objects: np.ndarray, weights: tuple[float, float]) -> KeyScores:
        """r(q, v) and its terms for every key.

        Args:
            action: unit vector of the subtask's action, shape (d,).
            objects: unit vector of its moved objects and destination, shape (2 d,).
            weights: λ1 (action) and λ2 (objects).
        """
        d = len(action)
        moved, destination = objects[:d], objects[d:]
        by_action = np.vecdot(self.actions, action).astype(np.float64)
        by_objects = np.vecdot(self.objects, objects).astype(np.float64)
        length = np.linalg.norm(self.objects[:, :d], axis=1) * (float(np.linalg.norm(moved)) or 1.0)
        by_moved = np.vecdot(self.objects[:, :d], moved).astype(np.float64) / length
        crossed = np.vecdot(self.objects, np.concatenate([destination, moved])).astype(np.float64)
        both_have_a_destination = destination.any() & self.objects[:, d:].any(axis=1)
        exchanged = np.clip((crossed - by_objects) / np.maximum(1 - by_objects, TIE), 0.0, 1.0)
        scores = key_score(by_action, by_objects, *weights)
        return KeyScores(scores, by_action, by_objects, by_moved, np.where(both_have_a_destination, exchanged, 0.0))


def read_keys(database: Database, vectors: TextVectors, key_vectors: KeyVectors) -> BookKeys:
    """The keys of the book's current generation."""
    with database.read() as connection:
        meta = database.meta(connection)
        counted, known = queries.group_sizes(connection), queries.keys_by_id(connection)
        further = connection.execute(_FURTHER_SIZES).all() if database.has(connection, tables.entry_keys) else []
        aliases, failing = queries.alias_rows(connection), all_failing(database, connection)
    everywhere = next((number for number, _, _ in counted if known[number] == GLOBAL_KEY), None)
    under = [*counted, *((int(key), str(kind), int(size)) for key, kind, size in further)]
    ids = sorted({number for number, _, _ in under if number != everywhere})
    keys = [known[number] for number in ids]
    row_of = {number: row for row, number in enumerate(ids)}
    sizes = {kind: np.zeros(len(ids), np.int64) for kind in ("correction", "template")}
    for number, kind, size in under:
        if number != everywhere:
            sizes[_AS_KIND.get(kind, kind)][row_of[number]] += size
    nothing = np.zeros((0, 0), np.float32)
    actions, objects = key_vectors.get(keys) if keys else (nothing, nothing)
    words = vectors.get([as_text(key) for key in keys]) if keys else nothing
    return BookKeys(
        int(meta["generation"]),
        f"{meta['book']} {meta.get('reembedded', '')}",
        np.array(ids, np.int64),
        keys,
        sizes,
        sum(size for _, _, size in counted),
        everywhere,
        aliases,
        bool(further),
        failing,
        actions,
        objects,
        words,
    )


_E = tables.entries.c
_K = tables.entry_keys.c
_LISTED = sa.select(_E.id, _E.kind, _E.key, _E.text).where(_E.superseded_by.is_(None))
_AMONG = _LISTED.where(_E.id.in_(sa.bindparam("ids", expanding=True)))
_FURTHER = (  # the same for the further keys of notes that were said of several
    sa.select(_E.id, _E.kind, _K.key, _E.text).join(tables.entries, _K.entry == _E.id).where(_E.superseded_by.is_(None))
)
_AMONG_FURTHER = _FURTHER.where(_E.id.in_(sa.bindparam("ids", expanding=True)))
_UNDER_FURTHER = (
    _FURTHER.where(_E.kind == sa.bindparam("kind"), _K.key.in_(sa.bindparam("keys", expanding=True)))
    .order_by(_E.id.desc())
    .limit(sa.bindparam("most"))
)
_FURTHER_SIZES = (
    sa.select(_K.key, _E.kind, sa.func.count())
    .join(tables.entries, _K.entry == _E.id)
    .where(_E.superseded_by.is_(None))
    .group_by(_K.key, _E.kind)
)
_AS_KIND = {"call": "template"}  # a call is retrieved like the template that it stands in for
_UNDER = (
    _LISTED.where(_E.kind.in_(sa.bindparam("kinds", expanding=True)), _E.key.in_(sa.bindparam("keys", expanding=True)))
    .order_by(_E.id.desc())
    .limit(sa.bindparam("most"))
)


@attrs.frozen
class Row:
    """An active entry as it is compared: no more than scoring needs."""

    id: int
    kind: str
    key: int  # id of its key
    text: str

    @property
    def as_kind(self) -> str:
        """The kind that it is ranked among."""
        return _AS_KIND.get(self.kind, self.kind)


def entries_under(
    connection: sa.Connection, kind: str, keys: np.ndarray, most: int, several: bool = False
) -> list[Row]:
    """The newest ``most`` active entries of a kind, or retrieved like it, under some keys (ids, int64).

    With ``several`` also notes under a further key of theirs.
    """
    kinds = [kind, *(other for other, same in _AS_KIND.items() if same == kind)]
    rows = list(connection.execute(_UNDER, {"kinds": kinds, "keys": keys.tolist(), "most": most}))
    if several:
        rows += connection.execute(_UNDER_FURTHER, {"kind": kind, "keys": keys.tolist(), "most": most}).all()
    return [Row(*row) for row in rows]


def entries_among(connection: sa.Connection, ids: np.ndarray, several: bool = False) -> list[Row]:
    """The active ones of some entries (ids, int64); with ``several`` once for each of its keys."""
    rows = list(connection.execute(_AMONG, {"ids": ids.tolist()}))
    if several:
        rows += connection.execute(_AMONG_FURTHER, {"ids": ids.tolist()}).all()
    return [Row(*row) for row in rows]
