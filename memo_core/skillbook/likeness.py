"""Which entries of a key are most like a text, without holding every entry's vector in memory.

Of a key with many entries each has a *sketch* in the book: its vector rounded to 16 bits a component, side by side with
the key's others, so that one short read brings them all. By Cauchy–Schwarz a cosine with a rounded vector is off by at
most ‖v - v'‖, which is below 1e-4 (2e-6 is usual); equal texts have equal sketches and tie all the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import sqlalchemy as sa

from memo_core.skillbook import tables
from memo_core.skillbook.database import Database
from memo_core.skillbook.vectors import PLACE_NAMES, PLACES, TextVectors, batched, places

Nearest = tuple[np.ndarray, np.ndarray]  # ids, int64, and cosines, float32, each of shape (n,)
_Group = tuple[np.ndarray, np.ndarray]  # ids, int64 (n,), and unit vectors, float32 (n, dimension)

_FEW = 40  # entries under a key that are read as they are
_TIE = 1e-6  # float32 cosines of equal texts differ by rounding
_IN_MEMORY = 64 << 20  # bytes of groups
_CHUNK = 5000  # sketches made in one transaction

_E, _S = tables.entries.c, tables.sketches.c
_VALID = sa.and_(_E.key == sa.bindparam("key"), _E.kind == sa.bindparam("kind"), _E.superseded_by.is_(None))
_SKETCHED = (
    sa.select(_E.id, _S.sketch)
    .join_from(tables.entries, tables.sketches, sa.and_(_S.key == _E.key, _S.entry == _E.id), isouter=True)
    .where(_VALID)
    .order_by(_E.id)
)
_MEMBERS = sa.select(_E.id).where(_VALID).order_by(_E.id)
_ONE_OF = _E.key.in_([sa.bindparam(name) for name in PLACE_NAMES])
_OF_KEYS = sa.select(_E.key, _E.id, _E.text).where(_E.kind == sa.bindparam("kind"), _E.superseded_by.is_(None), _ONE_OF)
_TEXTS = sa.select(_E.id, _E.text).where(_E.id.in_([sa.bindparam(name) for name in PLACE_NAMES]))


class Likeness:
    """Nearest entries by text, by kind and key. What it keeps in memory is one generation's: ``clear`` it then."""

    def __init__(self, database: Database, vectors: TextVectors) -> None:
        self._database = database
        self._vectors = vectors
        self._groups: dict[tuple[str, int], _Group] = {}
        self._bytes = 0
        self._whole: dict[tuple[str, int], _Group] = {}  # ids and vectors, kept over generations
        self._whole_is_current: set[tuple[str, int]] = set()
        self._sketches: bool | None = None  # whether the book has the table

    def clear(self) -> None:
        self._groups.clear()
        self._whole_is_current.clear()
        self._bytes = 0

    def nearest(self, kind: str, sizes: dict[int, int], meant: np.ndarray, count: int) -> list[Nearest]:
        """Of each key (``sizes``: how many valid entries it has) the ``count`` valid entries most like ``meant``, a
        unit vector of shape (dimension,), and all that tie with the last of them, in no order."""
        few = [key for key, size in sizes.items() if size <= _FEW and (kind, key) not in self._groups]
        for part in batched(few, PLACES):
            self._read_few(kind, part)
        return [_nearest(self._group(kind, key), meant, count) for key in sizes]

    def nearest_of_all(self, kind: str, key: int, meant: np.ndarray, count: int) -> Nearest:
        """As ``nearest``, of a key that every subtask asks for: its vectors stay in memory, exact ones."""
        return _nearest(self._entire(kind, key), meant, count)

    def prepare(self, kind: str, key: int, size: int) -> None:
        """Make what is missing of a group ahead of being asked."""
        if size <= _FEW:
            self._read_few(kind, [key])
        elif self._can_sketch():
            self._sketched(kind, key)
        self.clear()

    # -- inside --------------------------------------------------------------------------------------------------------
    def _group(self, kind: str, key: int) -> _Group:
        group = self._groups.get((kind, key))
        if group is None:
            group = self._sketched(kind, key) if self._can_sketch() else self._exact(self._members(kind, key))
            self._keep((kind, key), group)
        return group

    def _keep(self, where: tuple[str, int], group: _Group) -> None:
        self._groups[where] = group
        self._bytes += group[1].nbytes
        if self._bytes <= _IN_MEMORY:
            return
        for other in [group for group in self._groups if group != where]:
            self._bytes -= self._groups.pop(other)[1].nbytes
            if self._bytes <= _IN_MEMORY // 2:
                return

    def _read_few(self, kind: str, keys: list[int]) -> None:
        """Small groups, several at once."""
        members: dict[int, list[tuple[int, str]]] = {key: [] for key in keys}
        for key, entry, text in self._database.fetch(_OF_KEYS, {"kind": kind} | places(keys)):
            members[key].append((entry, text))
        vectors = self._vectors.get([text for group in members.values() for _, text in group] or [""])
        start = 0
        for key, group in members.items():
            stop = start + len(group)
            ids = np.array([entry for entry, _ in group], dtype=np.int64)
            self._keep((kind, key), (ids, vectors[start:stop]))
            start = stop

    def _members(self, kind: str, key: int) -> np.ndarray:
        return _column(self._database.fetch(_MEMBERS, {"kind": kind, "key": key}))

    def _exact(self, ids: np.ndarray) -> _Group:
        if not len(ids):
            return ids, np.zeros((0, 0), np.float32)
        return ids, self._vectors.get(self._texts(ids))

    def _entire(self, kind: str, key: int) -> _Group:
        """All of a group; of the generation before, what is still valid is kept."""
        where = (kind, key)
        if where in self._whole_is_current:
            return self._whole[where]
        ids = self._members(kind, key)
        known, before = self._whole.get(where, (np.zeros(0, np.int64), np.zeros((0, 0), np.float32)))
        new = ids[~np.isin(ids, known)]
        _, added = self._exact(new)
        vectors = np.concatenate([part for part in (before, added) if len(part)]) if len(before) + len(added) else added
        row_of = {entry: row for row, entry in enumerate([*known.tolist(), *new.tolist()])}
        self._whole[where] = (ids, vectors[[row_of[entry] for entry in ids.tolist()]])
        self._whole_is_current.add(where)
        return self._whole[where]

    def _can_sketch(self) -> bool:
        """Not in an older book that is open read-only."""
        if self._sketches is None:
            with self._database.read() as connection:
                self._sketches = self._database.has(connection, tables.sketches)
        return self._sketches

    def _sketched(self, kind: str, key: int) -> _Group:
        found = self._database.fetch(_SKETCHED, {"kind": kind, "key": key})
        if not found:
            return self._exact(_column(found))
        missing = np.array([row[0] for row in found if row[1] is None], dtype=np.int64)
        if not len(missing):
            return _column(found), read_sketches([row[1] for row in found])
        if self._database.read_only:
            return self._exact(_column(found))
        made = {}
        for start in range(0, len(missing), _CHUNK):
            made.update(self._make(key, missing[start : start + _CHUNK]))
        blobs = [row[1] if row[1] is not None else made[row[0]] for row in found]
        return _column(found), read_sketches(blobs)

    def _make(self, key: int, ids: np.ndarray) -> dict[int, bytes]:
        sketches = dict(zip(ids.tolist(), write_sketches(self._vectors.get(self._texts(ids))), strict=True))
        with self._database.write() as connection:
            still = {i for (i,) in connection.execute(sa.select(_E.id).where(_E.id.in_(list(sketches)), _E.key == key))}
            new = [{"key": key, "entry": i, "sketch": blob} for i, blob in sketches.items() if i in still]
            if new:
                connection.execute(self._database.upsert(tables.sketches), new)
        return sketches

    def _texts(self, ids: np.ndarray) -> list[str]:
        found: dict[int, str] = {}
        for part in batched(ids.tolist(), PLACES):
            found.update((entry, text) for entry, text in self._database.fetch(_TEXTS, places(part)))
        return [found.get(i, "") for i in ids.tolist()]  # one that was deleted just now: the generation tells retrieval


def _nearest(group: _Group, meant: np.ndarray, count: int) -> Nearest:
    ids, vectors = group
    if not len(ids):
        return ids, np.zeros(0, dtype=np.float32)
    similar = vectors @ meant
    if len(ids) <= count:
        return ids, similar
    chosen = np.flatnonzero(similar >= np.partition(similar, len(ids) - count)[len(ids) - count] - _TIE)
    return ids[chosen], similar[chosen]


def _column(rows: Iterable[Sequence[Any]]) -> np.ndarray:
    return np.array([row[0] for row in rows], dtype=np.int64)


def write_sketches(vectors: np.ndarray) -> list[bytes]:
    """Each row as a scale (float32) and its components as multiples of that (int16), little endian."""
    scale = np.maximum(np.abs(vectors).max(axis=1, keepdims=True), 1e-12) / 32767.0
    heads, bodies = scale.astype("<f4"), np.rint(vectors / scale).astype("<i2")
    return [head.tobytes() + body.tobytes() for head, body in zip(heads, bodies, strict=True)]


def read_sketches(blobs: list[bytes]) -> np.ndarray:
    """Rounded vectors, float32, shape (len(blobs), dimension)."""
    raw = np.frombuffer(b"".join(blobs), dtype=np.uint8).reshape(len(blobs), -1)
    vectors = np.ascontiguousarray(raw[:, 4:]).view("<i2").astype(np.float32)
    vectors *= np.ascontiguousarray(raw[:, :4]).view("<f4")
    return vectors
