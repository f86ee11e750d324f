"""The entries of a key that are most similar to a text, without holding every entry's vector in memory. For a key with
many entries, the book has a *sketch* of each: its vector rounded to 16 bits per component. The sketches of a key are
stored as one value, its *sheet*, so that one short read returns them all, and they are compared without unpacking. By
Cauchy–Schwarz a cosine with a rounded vector is off by at most ‖v - v'‖, which is below 1e-4 (2e-6 is usual); equal
texts have equal sketches and therefore still tie.

A matrix product is no faster here and waits for a second thread wherever other processes are busy: of 5 000 vectors
its slowest hundredth took 9 ms and more, one dot product after the other 0.4 ms.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.skillbook import tables
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import spoken
from memo_core.skillbook.term_lists import nth_largest
from memo_core.skillbook.text_vectors import PLACE_NAMES, PLACES, TextVectors, batched, places

Nearest = tuple[np.ndarray, np.ndarray]  # ids, int64, and cosines, float32, each of shape (n,)

_FEW = 40  # entries under a key that need no sheet, or that may be missing on it
_SHARE = 50  # of a large key one in so many may be missing
_TIE = 1e-6  # float32 cosines of equal texts differ by rounding
_IN_MEMORY = 64 << 20  # bytes of groups
_CHUNK = 5000  # vectors made at once
_BLOCK = 512  # sketches compared at once: as numbers they stay in the processor's cache

_E, _S = tables.entries.c, tables.sheets.c
_ONE_OF: list[sa.BindParameter[int]] = [sa.bindparam(name) for name in PLACE_NAMES]
_KIND, _VALID = _E.kind == sa.bindparam("kind"), _E.superseded_by.is_(None)
_MEMBERS = sa.select(_E.key, _E.id).where(_KIND, _VALID, _E.key.in_(_ONE_OF)).order_by(_E.key, _E.id)
_SHEETS = sa.select(_S.key, _S.entries, _S.sketches).where(_S.kind == sa.bindparam("kind"), _S.key.in_(_ONE_OF))
_TEXTS = sa.select(_E.id, _E.kind, _E.text).where(_E.id.in_(_ONE_OF))
_TEXTS_UNDER = sa.select(_E.id, _E.text).where(_KIND, _VALID, _E.key.in_(_ONE_OF))


@attrs.frozen(eq=False)
class Group:
    """Entries of one key, ids int64 (n,), and their texts' vectors: float32 (n, d), or sketches, uint8 (n, 4 + 2 d)."""

    ids: np.ndarray
    vectors: np.ndarray

    @property
    def nbytes(self) -> int:
        return int(self.ids.nbytes + self.vectors.nbytes)

    def exact(self) -> np.ndarray:
        """The vectors, float32 (n, d)."""
        return read_sketches(self.vectors) if self.vectors.dtype == np.uint8 else self.vectors

    def similar(self, meant: np.ndarray) -> np.ndarray:
        """Cosines with a unit vector of shape (d,), float32 (n,)."""
        if self.vectors.dtype != np.uint8:
            return np.asarray(np.vecdot(self.vectors, meant))
        scales, numbers = _taken_apart(self.vectors)
        found = np.empty(len(self.ids), dtype=np.float32)
        block = np.empty((min(_BLOCK, len(self.ids)), len(meant)), dtype=np.float32)
        for start in range(0, len(found), _BLOCK):
            some = block[: len(found) - start]
            np.copyto(some, numbers[start : start + _BLOCK])
            np.vecdot(some, meant, out=found[start : start + _BLOCK])  # one thread, whatever else is running
        found *= scales
        return found

    def nearest(self, meant: np.ndarray, count: int) -> Nearest:
        """The ``count`` nearest and all that tie with the last of them, in no order."""
        if not len(self.ids):
            return self.ids, np.zeros(0, dtype=np.float32)
        similar = self.similar(meant)
        if len(self.ids) <= count:
            return self.ids, similar
        chosen = np.flatnonzero(similar >= nth_largest(similar, count) - _TIE)
        return self.ids[chosen], similar[chosen]


class Likeness:
    """The most similar entries by text, per kind and key. Caches one generation in memory: call ``forget`` for keys
    that changed."""

    def __init__(self, database: Database, vectors: TextVectors) -> None:
        self._database = database
        self._vectors = vectors
        self._groups: dict[tuple[str, int], Group] = {}
        self._bytes = 0
        self._whole: dict[tuple[str, int], Group] = {}  # exact vectors, kept over generations
        self._whole_is_current: set[tuple[str, int]] = set()
        self._sheets: bool | None = None  # whether the book has the table

    def forget(self, keys: Iterable[int] | None) -> None:
        """Discard the cached groups of these keys; None: of all."""
        changed = {key for _, key in [*self._groups, *self._whole]} if keys is None else set(keys)
        for where in [where for where in self._groups if where[1] in changed]:
            self._bytes -= self._groups.pop(where).nbytes
        self._whole_is_current = {where for where in self._whole_is_current if where[1] not in changed}

    def nearest(self, kind: str, keys: Sequence[int], meant: np.ndarray, count: int) -> list[Nearest]:
        """Of each key the ``count`` valid entries most like ``meant``, a unit vector of shape (d,), and all that tie
        with the last of them, in no order."""
        read: dict[int, Group] = {}
        for part in batched((key for key in keys if (kind, key) not in self._groups), PLACES):
            read.update(self._read(kind, part))
        found = [read[key] if key in read else self._groups[kind, key] for key in keys]
        for key, group in read.items():
            self._keep((kind, key), group)
        return [group.nearest(meant, count) for group in found]

    def nearest_of_all(self, kind: str, key: int, meant: np.ndarray, count: int) -> Nearest:
        """As ``nearest``, for a key that every subtask needs: its exact vectors stay in memory."""
        return self._entire(kind, key).nearest(meant, count)

    def groups(self, kind: str, keys: Sequence[int]) -> Iterator[list[tuple[int, np.ndarray, np.ndarray]]]:
        """Key, ids and vectors, float32 (n, d), of the valid entries under these keys, some keys at a time; nothing
        stays in memory."""
        for part in batched(keys, PLACES):
            read = self._read(kind, part)
            yield [(key, read[key].ids, read[key].exact()) for key in part]

    def members(self, kind: str, keys: Sequence[int]) -> Iterator[tuple[int, np.ndarray]]:
        """Of each key the ids of its valid entries, int64."""
        for part in batched(keys, PLACES):
            members: dict[int, list[int]] = {key: [] for key in part}
            for key, entry in self._database.fetch(_MEMBERS, {"kind": kind} | places(part)):
                members[key].append(entry)
            yield from ((key, np.array(ids, np.int64)) for key, ids in members.items())

    def exact(self, ids: list[int]) -> tuple[list[str], np.ndarray]:
        """Texts of entries, as they are compared, and their vectors, float32 (n, d)."""
        texts = self.texts(ids)
        return texts, np.concatenate([self._vectors.get(part) for part in batched(texts, _CHUNK)])

    def prepare(self, kind: str, key: int) -> None:
        """Compute what is missing of a group in advance, also for a small one."""
        self._read(kind, [key], least=0)

    # -- inside --------------------------------------------------------------------------------------------------------
    def _keep(self, where: tuple[str, int], group: Group) -> None:
        self._groups[where] = group
        self._bytes += group.nbytes
        if self._bytes <= _IN_MEMORY:
            return
        for other in [group for group in self._groups if group != where]:
            self._bytes -= self._groups.pop(other).nbytes
            if self._bytes <= _IN_MEMORY // 2:
                return

    def _read(self, kind: str, keys: list[int], least: int = _FEW) -> dict[int, Group]:
        """Groups from the book. A sheet that lacks more than ``least`` entries, and more than a fiftieth, is rewritten
        if the book is writable."""
        asked = {"kind": kind} | places(keys)
        members: dict[int, list[int]] = {key: [] for key in keys}
        for key, entry in self._database.fetch(_MEMBERS, asked):
            members[key].append(entry)
        sheets = {}
        if kind == "template":  # one a key is valid
            least = max(map(len, members.values()))
        elif self._has_sheets():
            sheets = {key: _sheet(ids, blob) for key, ids, blob in self._database.fetch(_SHEETS, asked)}
        small = [key for key in keys if key not in sheets and len(members[key]) <= least]
        groups = self._exact({key: members[key] for key in small})
        for key in keys:
            if key not in groups:
                groups[key] = self._sketched(kind, key, np.array(members[key], np.int64), sheets.get(key), least)
        return groups

    def _exact(self, members: dict[int, list[int]]) -> dict[int, Group]:
        texts = self.texts([entry for ids in members.values() for entry in ids])
        vectors = self._vectors.get(texts) if texts else np.zeros((0, 0), np.float32)
        groups, start = {}, 0
        for key, ids in members.items():
            groups[key] = Group(np.array(ids, dtype=np.int64), vectors[start : start + len(ids)])
            start += len(ids)
        return groups

    def _sketched(self, kind: str, key: int, ids: np.ndarray, sheet: Group | None, least: int) -> Group:
        if sheet is not None and np.array_equal(sheet.ids, ids):
            return sheet
        known = sheet or Group(np.zeros(0, np.int64), np.zeros((0, 0), np.uint8))
        row_of = {entry: row for row, entry in enumerate(known.ids.tolist())}
        new = [entry for entry in ids.tolist() if entry not in row_of]
        may_write = self._has_sheets() and not self._database.read_only
        if sheet is None and not may_write:
            return self._exact({key: ids.tolist()})[key]
        parts = [known.vectors[[row_of[entry] for entry in ids.tolist() if entry in row_of]]] if len(known.ids) else []
        for part in batched(new, _CHUNK):
            parts.append(write_sketches(self._vectors.get(self.texts(part))))
        both = np.concatenate([np.array([e for e in ids.tolist() if e in row_of], np.int64), np.array(new, np.int64)])
        order = np.argsort(both)
        group = Group(both[order], np.concatenate(parts)[order])
        gone = np.count_nonzero(~np.isin(known.ids, ids))
        lacking = least and max(least, len(ids) // _SHARE)
        if may_write and (len(new) > lacking or gone > max(lacking, len(ids))):
            self._write(kind, key, group)
        return group

    def _write(self, kind: str, key: int, group: Group) -> None:
        """Write only entries that exist now, so that words withdrawn in the meantime leave no trace."""
        with self._database.write() as connection:
            query = sa.select(_E.id).where(_E.key == key, _E.kind == kind)
            there = np.isin(group.ids, [entry for (entry,) in connection.execute(query)])
            connection.execute(sa.delete(tables.sheets).where(_S.key == key, _S.kind == kind))
            if there.any():
                ids, sketches = group.ids[there].astype("<i8").tobytes(), group.vectors[there].tobytes()
                values = {"key": key, "kind": kind, "entries": ids, "sketches": sketches}
                connection.execute(sa.insert(tables.sheets), values)

    def _entire(self, kind: str, key: int) -> Group:
        """All vectors of a group; those of the previous generation that are still valid are reused."""
        where = (kind, key)
        if where in self._whole_is_current:
            return self._whole[where]
        before = self._whole.get(where, Group(np.zeros(0, np.int64), np.zeros((0, 0), np.float32)))
        if len(before.ids):
            members = self._database.fetch(_MEMBERS, {"kind": kind} | places([key]))
            ids = np.array([entry for _, entry in members], np.int64)
            new = ids[~np.isin(ids, before.ids)].tolist()
            added = self._exact({key: new})[key]
        else:
            added = self._read(kind, [key])[key]
            ids = added.ids
        vectors = added.exact()
        vectors = np.concatenate([part for part in (before.vectors, vectors) if len(part)] or [vectors])
        row_of = {entry: row for row, entry in enumerate([*before.ids.tolist(), *added.ids.tolist()])}
        self._whole[where] = Group(ids, vectors[[row_of[entry] for entry in ids.tolist()]])
        self._whole_is_current.add(where)
        return self._whole[where]

    def _has_sheets(self) -> bool:
        """False for an older book that is open read-only."""
        if self._sheets is None:
            with self._database.read() as connection:
                self._sheets = self._database.has(connection, tables.sheets)
        return self._sheets

    def texts_under(self, kind: str, keys: Sequence[int]) -> dict[int, str]:
        """Of the valid entries under some keys, as they are compared, by id."""
        return {
            entry: spoken(kind, text)
            for part in batched(keys, PLACES)
            for entry, text in self._database.fetch(_TEXTS_UNDER, {"kind": kind} | places(part))
        }

    def texts(self, ids: list[int]) -> list[str]:
        """Of entries, as they are compared; "" for one that does not exist."""
        found: dict[int, str] = {}
        for part in batched(ids, PLACES):
            found.update((row[0], spoken(row[1], row[2])) for row in self._database.fetch(_TEXTS, places(part)))
        return [found.get(entry, "") for entry in ids]  # one that was deleted just now: the generation tells retrieval


def _sheet(ids: bytes, sketches: bytes) -> Group:
    entries = np.frombuffer(ids, dtype="<i8")
    return Group(entries, np.frombuffer(sketches, dtype=np.uint8).reshape(len(entries), -1))


def write_sketches(vectors: np.ndarray) -> np.ndarray:
    """Each row as a scale (float32) and its components as multiples of that (int16), little endian: uint8, shape
    (n, 4 + 2 d)."""
    scale = np.maximum(np.abs(vectors).max(axis=1, keepdims=True), 1e-12) / 32767.0
    heads, bodies = scale.astype("<f4"), np.rint(vectors / scale).astype("<i2")
    return np.concatenate([heads.view(np.uint8), bodies.view(np.uint8)], axis=1)


def read_sketches(sketches: np.ndarray) -> np.ndarray:
    """Rounded vectors, float32, shape (n, d)."""
    scales, numbers = _taken_apart(sketches)
    return numbers.astype(np.float32) * scales[:, None]


def _taken_apart(sketches: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return sketches[:, :4].view("<f4")[:, 0], sketches[:, 4:].view("<i2")
