"""The latest feedback of each person: of contradicting notes of one person the newer counts.

The similarity of texts does not tell whether two notes contradict each other ("pull it straight" is close to "pull it
along an arc", and so is a note that agrees with it). So contradictions are not detected; instead, the last words of
each person under the subtask's own key are always retrieved, before what the same person said earlier under that key.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, TypeVar

import sqlalchemy as sa

from memo_core.skillbook.model.entries import Entry
from memo_core.skillbook.model.keys import Key
from memo_core.skillbook.retrieval.provenance import Provenance, said_at
from memo_core.skillbook.store import tables
from memo_core.skillbook.store.database import Database

LATEST = 300  # corrections that are looked through; under a larger key, earlier speakers are ranked as usual


class _HasEntry(Protocol):
    @property
    def entry(self) -> Entry: ...

    @property
    def about(self) -> Key: ...


_WithEntry = TypeVar("_WithEntry", bound=_HasEntry)
_E, _F, _S = tables.entries.c, tables.feedback.c, tables.sources.c


def newest_of_people(
    database: Database, connection: sa.Connection, keys: Sequence[int], most: int, several: bool = False
) -> list[int]:
    """Corrections made of each person's last words under some keys, the latest speaker's first.

    Args:
        database: the book.
        connection: a connection to it.
        keys: ids of the keys that mean the subtask itself.
        most: if there are more, only one correction per remark, so that every person is represented.
        several: whether a key may be a further one of a note.

    Returns:
        Ids of entries.
    """
    corrections = sa.select(_E.id).where(_E.kind == "correction", _E.superseded_by.is_(None))
    under = corrections.where(_E.key.in_(keys))
    if several:
        further = corrections.where(
            _E.id.in_(sa.select(tables.entry_keys.c.entry).where(tables.entry_keys.c.key.in_(keys)))
        )
        under = sa.select(sa.union(under, further).subquery().c.id)
    latest = under.order_by(under.selected_columns.id.desc()).limit(LATEST).subquery()
    query = (
        sa.select(latest.c.id, _F.who, _F.id, _F.time)
        .join(tables.sources, _S.entry == latest.c.id)
        .join(tables.feedback, _S.feedback == _F.id)
    )
    rows = connection.execute(query).all()
    at = said_at(database, connection, {feedback: when for _, _, feedback, when in rows})
    last: dict[str, int] = {}  # a person's last feedback, the latest speaker's last
    made: dict[int, list[int]] = {}
    for entry, who, feedback, _ in sorted(rows, key=lambda row: (at[row[2]], row[2])):
        last.pop(who, None)
        last[who] = feedback
        made.setdefault(feedback, []).append(entry)
    found: dict[int, None] = {}
    for feedback in reversed(last.values()):
        new = sorted(set(made[feedback]) - found.keys(), reverse=True)
        found |= dict.fromkeys(new if len(found) + len(new) <= most else new[:1])
    return list(found)


def newest_before_older(retrieved: Sequence[_WithEntry], known: Mapping[int, Provenance]) -> list[_WithEntry]:
    """Put what each person said last under a key before their earlier words, which keep their order, within the
    positions that these entries have. Entries merged from several people's words keep their positions. ``known``:
    provenance by entry."""
    places_of: dict[tuple[Key, str], list[int]] = {}
    for place, one in enumerate(retrieved):
        who = known[one.entry.id].who if one.entry.id in known else ()
        if len(who) == 1:
            places_of.setdefault((one.about, who[0]), []).append(place)
    ordered = list(retrieved)
    for held in places_of.values():
        if len(held) == 1:
            continue
        last = max(known[retrieved[place].entry.id].when for place in held)
        mine = sorted((retrieved[place] for place in held), key=lambda one: known[one.entry.id].when < last)
        for place, one in zip(held, mine, strict=True):
            ordered[place] = one
    return ordered
