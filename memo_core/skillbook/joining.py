"""Near-identical keys, ``PLACE(mug, cupboard)`` and ``PUT(mugs, cupboard)``: found here, joined by aliases.

Two keys are taken for one when their actions are of one synonym group (so never opposites) and name the same way of
placing (in, on, out, ...), when they have the same roles, and when each role's names are near-identical vectors and do
not contrast ("left drawer" and "right drawer" are 0.98 apart in no sentence model's eyes, and two things).
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterable, Sequence

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.skillbook import rows, tables, templates
from memo_core.skillbook.actions import Actions
from memo_core.skillbook.database import Database
from memo_core.skillbook.keys import Key
from memo_core.skillbook.wording import KeyVectors

NEAR = 0.94  # least cosine of each role's names; calibrated, docs/clustering.md

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
    """Which of ``keys`` (the most important first: it gives the name) mean one that stands before them."""
    found: list[NearKeys] = []
    kept: dict[tuple[object, ...], list[Key]] = {}
    vectors = dict(zip(keys, _role_vectors(keys, key_vectors), strict=True))
    for key in keys:
        alike = kept.setdefault((actions.canonical(key.action), placing(key.action), len(key.objects)), [])
        near = [(cosine, other) for other in alike if (cosine := _least_cosine(vectors[key], vectors[other])) >= least]
        near = [(cosine, other) for cosine, other in near if not contrasting(key, other)]
        if near:
            cosine, other = max(near, key=lambda pair: pair[0])
            found.append(NearKeys(key, other, cosine))
        else:
            alike.append(key)
    return found


def placing(action: str) -> frozenset[str]:
    """The particles of an action that say where to: "put in" is another one than "put on"."""
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


def _role_vectors(keys: Sequence[Key], key_vectors: KeyVectors) -> Iterable[list[np.ndarray]]:
    """Unit vectors of what is moved and, where there is one, of where to."""
    if not keys:
        return []
    _, objects = key_vectors.get(keys)
    halves = np.split(objects, 2, axis=1)
    return [[_unit(half[i]) for half in halves if np.linalg.norm(half[i]) > 1e-6] for i in range(len(keys))]


def _unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def _least_cosine(one: Sequence[np.ndarray], other: Sequence[np.ndarray]) -> float:
    return min(float(a @ b) for a, b in zip(one, other, strict=True)) if len(one) == len(other) else -1.0


def join(database: Database, connection: sa.Connection, spelling: Key, key: Key) -> None:
    """Keep entries for ``spelling`` under ``key`` from now on, inside a write transaction. Entries that are there move:
    a revision that can be rolled back. Of two templates the better one is served."""
    target = rows.key_id(connection, database.upsert(tables.keys), key)
    connection.execute(sa.delete(tables.aliases).where(tables.aliases.c.spelling == str(spelling)))
    old = rows.known_key_id(connection, spelling)
    if old is not None and old != target:
        _move(connection, old, target, str(spelling))
        templates.elect(database, connection, target, f"joined {spelling}")
    rows.insert_plain(connection, tables.aliases, spelling=str(spelling), key=target)


def _move(connection: sa.Connection, old: int, target: int, spelling: str) -> None:
    entries, records, clusterings = tables.entries.c, tables.records.c, tables.clusterings.c
    moving = rows.ids_of(connection.execute(sa.select(entries.id).where(entries.key == old)))
    if moving:
        reason = f"joined {spelling}"
        revision = rows.insert(connection, tables.revisions, key=target, time=time.time(), reason=reason)
        for entry in moving:
            rows.insert_plain(
                connection, tables.changes, revision=revision, entry=entry, change="joined", why=spelling, because=None
            )
    connection.execute(sa.update(tables.entries).where(entries.key == old).values(key=target))
    both = sa.select(records.entry).where(records.key == target)
    connection.execute(sa.delete(tables.records).where(records.key == old, records.entry.in_(both)))
    connection.execute(sa.update(tables.records).where(records.key == old).values(key=target))
    connection.execute(sa.delete(tables.clusterings).where(clusterings.key == old))
    connection.execute(sa.update(tables.revisions).where(tables.revisions.c.key == old).values(key=target))
    connection.execute(sa.update(tables.aliases).where(tables.aliases.c.key == old).values(key=target))
    connection.execute(sa.delete(tables.keys).where(tables.keys.c.id == old))
