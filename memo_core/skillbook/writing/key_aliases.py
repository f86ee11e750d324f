"""Finding near-identical keys, such as ``PLACE(mug, cupboard)`` and ``PUT(mugs, cupboard)``, and merging them by
aliases. Two keys are treated as one if their actions are in one synonym group (so never opposites) and state the same
way of placing (in, on, out, ...), if they have the same roles, and if in each role the names have near-identical
vectors and do not contrast ("left drawer" and "right drawer" have a cosine of 0.98 and are different objects).
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.skillbook.model.action_relations import Actions
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.vectors.key_vectors import KeyVectors
from memo_core.skillbook.writing import templates

NEAR = 0.93  # least cosine of each role's names; calibrated, docs/consolidation.md

_PLACING = {"in": "in", "into": "in", "inside": "in", "on": "on", "onto": "on", "out": "out", "off": "off"}
_PLACING |= {
    word: word for word in ("under", "below", "over", "behind", "beside", "against", "up", "down", "to", "from")
}
_EMPTY = frozenset({"up"})  # "pick up" is "pick"
_CONTRASTS = [
    frozenset(words.split())
    for words in (
        "left right middle centre center",
        "top bottom upper lower middle upside underside",
        "front back rear",
        "inner outer inside outside",
        "first second third fourth fifth last next",
        "one two three four five six seven eight nine ten",
        "big large small little tiny huge medium long short tall",
        "full empty",
        "open closed shut",
        "hot cold",
        "clean dirty",
        "old new",
        "red green blue yellow black white grey gray orange purple pink brown silver golden gold",
        "wooden metal plastic glass steel paper ceramic",
    )
]
_SAME = {"gray": "grey", "center": "centre", "gold": "golden", "big": "large", "little": "small"}


@attrs.frozen
class NearKeys:
    """``spelling`` would be kept under ``key`` from now on; ``cosine`` is the least of their roles'."""

    spelling: Key
    key: Key
    cosine: float


def near_keys(keys: Sequence[Key], key_vectors: KeyVectors, actions: Actions, least: float = NEAR) -> list[NearKeys]:
    """Those of ``keys`` that have the meaning of an earlier one (the most important key comes first, and its name is
    kept)."""
    found: list[NearKeys] = []
    kept: dict[tuple[object, ...], _Alike] = {}
    for key, roles in zip(keys, _role_vectors(keys, key_vectors), strict=True):
        where = (actions.canonical(key.action), placing(key.action), len(key.objects), len(roles))
        alike = kept.setdefault(where, _Alike())
        near = alike.nearest(key, roles, least)
        if near is None:
            alike.add(key, roles)
        else:
            found.append(NearKeys(key, *near))
    return found


class _Alike:
    """Keys with the same action and roles that are not aliases of an earlier one."""

    def __init__(self) -> None:
        self._keys: list[Key] = []
        self._roles = np.zeros((0, 0, 0), dtype=np.float32)  # keys x roles x dimension; has room for more keys

    def nearest(self, key: Key, roles: np.ndarray, least: float) -> tuple[Key, float] | None:
        """The key that has the meaning of ``key``, with the smallest cosine of its roles."""
        if not self._keys:
            return None
        cosines = np.einsum("krd,rd->kr", self._roles[: len(self._keys)], roles).min(axis=1)
        for i in np.argsort(-cosines, kind="stable"):
            if cosines[i] < least:
                return None
            if not contrasting(key, self._keys[i]):
                return self._keys[i], float(cosines[i])
        return None

    def add(self, key: Key, roles: np.ndarray) -> None:
        if len(self._keys) == len(self._roles):
            more = np.zeros((2 * len(self._keys) + 4, *roles.shape), dtype=np.float32)
            more[: len(self._keys)] = self._roles[: len(self._keys)].reshape(-1, *roles.shape)
            self._roles = more
        self._roles[len(self._keys)] = roles
        self._keys.append(key)


def placing(action: str) -> frozenset[str]:
    """The particles of an action that state how something is placed: "put in" differs from "put on"."""
    return frozenset(_PLACING[word] for word in action.split() if word in _PLACING) - _EMPTY


def contrasting(one: Key, other: Key) -> bool:
    """Whether a role's names differ in a number, a letter, or words of one group of contrasts."""
    return any(_contrast(_words(a), _words(b)) for a, b in zip(one.objects, other.objects, strict=True))


def _contrast(one: set[str], other: set[str]) -> bool:
    only, too = one - other, other - one
    if any(_is_mark(word) for word in only | too):
        return True
    return any(group & one != group & other and (group & only or group & too) for group in _CONTRASTS)


def _is_mark(word: str) -> bool:
    return len(word) == 1 or any(character.isdigit() for character in word)


def _words(name: str) -> set[str]:
    return {_SAME.get(word, word) for word in re.findall(r"[^\W_]+", name)}


def _role_vectors(keys: Sequence[Key], key_vectors: KeyVectors) -> list[np.ndarray]:
    """For each key, unit vectors of the moved object and of the destination, if there is one: shape (roles,
    dimension)."""
    if not keys:
        return []
    _, objects = key_vectors.get(keys)
    found = []
    for vector in objects:
        halves = vector.reshape(2, -1)
        lengths = np.linalg.norm(halves, axis=1)
        found.append(halves[lengths > 1e-6] / lengths[lengths > 1e-6, None])
    return found


def join(database: Database, connection: sa.Connection, spelling: Key, key: Key) -> None:
    """Store entries for ``spelling`` under ``key`` from now on, inside a write transaction. Existing entries move by a
    revision, which can be rolled back. Of two templates the better one is served."""
    target = queries.key_id(connection, database.upsert(tables.keys), key)
    connection.execute(sa.delete(tables.aliases).where(tables.aliases.c.spelling == str(spelling)))
    old = queries.known_key_id(connection, spelling)
    if old is not None and old != target:
        _move(database, connection, old, target, str(spelling))
        templates.elect(database, connection, target, f"joined {spelling}")
    queries.insert_plain(connection, tables.aliases, spelling=str(spelling), key=target)


def _move(database: Database, connection: sa.Connection, old: int, target: int, spelling: str) -> None:
    entries, records, clusterings = tables.entries.c, tables.records.c, tables.clusterings.c
    moving = queries.ids_of(connection.execute(sa.select(entries.id).where(entries.key == old)))
    if moving:
        reason = f"joined {spelling}"
        revision = queries.insert(connection, tables.revisions, key=target, time=database.now(), reason=reason)
        for entry in moving:
            queries.insert_plain(
                connection, tables.changes, revision=revision, entry=entry, change="joined", why=spelling, because=None
            )
    connection.execute(sa.update(tables.entries).where(entries.key == old).values(key=target))
    both = sa.select(records.entry).where(records.key == target)
    connection.execute(sa.delete(tables.records).where(records.key == old, records.entry.in_(both)))
    connection.execute(sa.update(tables.records).where(records.key == old).values(key=target))
    connection.execute(sa.delete(tables.clusterings).where(clusterings.key == old))
    further = tables.entry_keys.c
    for note in queries.ids_of(connection.execute(sa.select(further.entry).where(further.key == old))):
        connection.execute(database.upsert(tables.entry_keys).values(entry=note, key=target))
    home = sa.select(entries.id).where(entries.key == target)
    connection.execute(sa.delete(tables.entry_keys).where(further.key == target, further.entry.in_(home)))
    connection.execute(sa.update(tables.revisions).where(tables.revisions.c.key == old).values(key=target))
    connection.execute(sa.update(tables.aliases).where(tables.aliases.c.key == old).values(key=target))
    connection.execute(sa.delete(tables.keys).where(tables.keys.c.id == old))
