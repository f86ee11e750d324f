"""Withholding lessons that were retrieved for a key other than their own and corrected there. Each use is counted with
the key of the code's subtask (table ``records``). An entry that is served for another key is the less likely to apply
the less similar the two keys are, and each correction there is evidence against it. With n corrections more than
approvals, it is served there only if

    r(query, own key) >= LEAST + STEP n.

"There" means the key where it happened and practically identical keys (r > SAME), unless they are more similar to the
entry's own key: what failed on the drawer is not served for other drawers, but is still served for doors. An entry is
never withheld from its own key, and general statements, which have none, are never withheld. Nothing is deleted:
approvals there bring an entry back.
"""

from __future__ import annotations

from collections.abc import Sequence

import attrs
import sqlalchemy as sa

from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.retriever import Cut, Retrieval, RetrievedEntry
from memo_core.skillbook.retrieval.score import key_score
from memo_core.skillbook.store import queries, tables
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.vectors.key_vectors import KeyVectors
from memo_core.skillbook.vectors.text_vectors import PLACE_NAMES, PLACES, batched, places

# All-MiniLM-L6-v2: OPEN(microwave) has r = 0.91 to 0.94 with fridge and oven, 0.86 to 0.87 with drawers of all kinds;
# OPEN(drawer) has 0.96 to 0.99 with other drawers, at most 0.94 with cabinets and 0.92 with their doors.
LEAST = 0.85
STEP = 0.05
SAME = 0.95

_R, _K = tables.records.c, tables.keys.c
_COUNTED = sa.select(_R.entry).where(_R.entry.in_([sa.bindparam(name) for name in PLACE_NAMES]))


@attrs.frozen
class Evidence:
    """How often an entry was served and approved for one key."""

    entry: int
    key: Key
    served: int
    approved: int

    @property
    def corrected(self) -> int:
        return self.served - self.approved


def evidence_of(database: Database, connection: sa.Connection, entries: Sequence[int]) -> list[Evidence]:
    """The counts of entries, by key."""
    if not entries or not database.has(connection, tables.records):
        return []
    query = sa.select(_R.entry, _K.action, _K.objects, _R.uses, _R.confirmed_uses).join(tables.keys, _R.key == _K.id)
    rows = connection.execute(query.where(_R.entry.in_(list(entries))).order_by(_R.entry, _R.key))
    return [
        Evidence(entry, queries.key_of(action, objects), uses, confirmed)
        for entry, action, objects, uses, confirmed in rows
    ]


def is_evidence(database: Database, entries: Sequence[int]) -> bool:
    """Whether there are any counts for the entries; much faster than reading them."""
    with_table = database.has_table(tables.records)
    return with_table and any(database.fetch(_COUNTED, places(part)) for part in batched(entries, PLACES))


def withhold(
    found: Retrieval, query: Key, evidence: Sequence[Evidence], key_vectors: KeyVectors, weights: tuple[float, float]
) -> Retrieval:
    """``found`` without the entries that did harm there. ``query`` is the subtask's key as the book spells it."""
    bad = [one for one in evidence if one.corrected > one.approved]
    if not bad:
        return found
    alike = _alikeness(query, [one.key for one in bad], key_vectors, weights)
    harm: dict[int, list[Evidence]] = {}
    for one in bad:
        harm.setdefault(one.entry, []).append(one)
    cut: list[Cut] = []

    def stays(served: RetrievedEntry) -> bool:
        own = served.about
        if own == query or served.entry.id not in harm:
            return True
        mine = _alikeness(query, [own], key_vectors, weights)[own]
        there = sum(one.corrected - one.approved for one in harm[served.entry.id] if alike[one.key] > max(mine, SAME))
        if not there or mine >= LEAST + STEP * there:
            return True
        rule = f"corrected {there} times more than approved when served for this or a like subtask"
        cut.append(Cut(served.key, served.key_score, rule, served.action_cosine, served.objects_cosine, 1))
        return False

    corrections = tuple(filter(stays, found.corrections))
    templates = tuple(filter(stays, found.templates))
    return attrs.evolve(found, corrections=_ranked(corrections), templates=_ranked(templates), cut=(*cut, *found.cut))


def _ranked(served: Sequence[RetrievedEntry]) -> tuple[RetrievedEntry, ...]:
    return tuple(attrs.evolve(one, rank=rank) for rank, one in enumerate(served, start=1))


def _alikeness(
    query: Key, keys: Sequence[Key], key_vectors: KeyVectors, weights: tuple[float, float]
) -> dict[Key, float]:
    """r of the query and each key."""
    actions, objects = key_vectors.get([query, *keys])
    return {
        key: key_score(float(actions[0] @ action), float(objects[0] @ thing), *weights)
        for key, action, thing in zip(keys, actions[1:], objects[1:], strict=True)
    }
