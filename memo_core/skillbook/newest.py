"""The latest feedback of each person: of contradicting notes of one person the newer counts. The similarity of texts
does not tell whether two notes contradict each other ("pull it straight" is close to "pull it along an arc", and so is
a note that agrees with it). So contradictions are not detected; instead, what each person said last under the subtask's
own key is always served, before what the same person said earlier under that key.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol, TypeVar

import numpy as np
import sqlalchemy as sa

from memo_core.skillbook import tables
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import Entry
from memo_core.skillbook.keys import Key
from memo_core.skillbook.provenance import Provenance
from memo_core.skillbook.term_lists import within
from memo_core.skillbook.text_vectors import PLACE_NAMES, places

LATEST = 300  # corrections that are looked through: under a larger key, who spoke before these is ranked as usual


class _HasEntry(Protocol):
    @property
    def entry(self) -> Entry: ...


_WithEntry = TypeVar("_WithEntry", bound=_HasEntry)
_E, _F, _S = tables.entries.c, tables.feedback.c, tables.sources.c
_MINE = (
    sa.select(_E.id)
    .where(
        _E.key.in_([sa.bindparam(name) for name in PLACE_NAMES]),
        _E.kind == sa.bindparam("kind"),
        _E.superseded_by.is_(None),
    )
    .order_by(_E.id.desc())
    .limit(sa.literal_column(str(LATEST)))
    .offset(sa.literal_column("0"))
    .subquery()
)
_SAID = (
    sa.select(_MINE.c.id, _F.who, _F.time, _F.id.label("feedback"))
    .join(tables.sources, _S.entry == _MINE.c.id)
    .join(tables.feedback, _S.feedback == _F.id)
)


def newest_of_people(database: Database, keys: Sequence[int], most: int) -> list[int]:
    """``newest_of`` the corrections under some keys, at most ``PLACES``, from the book."""
    rows = database.fetch(_SAID, {"kind": "correction"} | places(list(keys)))
    if not rows:
        return []
    entries, who, when, feedback = (np.array(column) for column in zip(*rows, strict=True))
    return newest_of(entries, np.unique(who, return_inverse=True)[1], when, feedback, most)


def newest_of(entries: np.ndarray, who: np.ndarray, when: np.ndarray, feedback: np.ndarray, most: int) -> list[int]:
    """The corrections that were made of what each person said last, the latest speakers' first. If they would exceed
    ``most``, one correction per remark, so that every person is represented.

    Of shape (n,), for each correction and each feedback that it was made of: ids of both, the number of the person who
    gave the feedback, and when.
    """
    if not len(entries):
        return []
    order = np.lexsort((feedback, when, who))
    last = order[np.append(np.diff(who[order]) != 0, True)]
    last = feedback[last[np.lexsort((feedback[last], when[last]))[::-1]]]
    made: dict[int, list[int]] = {number: [] for number in last.tolist()}
    mine = within(feedback, np.sort(last))
    for entry, number in zip(entries[mine].tolist(), feedback[mine].tolist(), strict=True):
        made[number].append(entry)
    found: dict[int, None] = {}
    for several in made.values():
        new = sorted(set(several) - found.keys(), reverse=True)
        found |= dict.fromkeys(new if len(found) + len(new) <= most else new[:1])
    return list(found)


def newest_before_older(served: Sequence[_WithEntry], known: Mapping[int, Provenance]) -> list[_WithEntry]:
    """Sort the entries of one person under one key newest first, within the positions that these entries have. Entries
    merged from several people's words keep their positions. ``known``: provenance by entry."""
    places_of: dict[tuple[Key, str], list[int]] = {}
    for place, one in enumerate(served):
        who = known[one.entry.id].who if one.entry.id in known else ()
        if len(who) == 1:
            places_of.setdefault((one.entry.key, who[0]), []).append(place)
    ordered = list(served)
    for held in places_of.values():
        if len(held) == 1:
            continue
        last = max(known[served[place].entry.id].when for place in held)
        mine = sorted((served[place] for place in held), key=lambda one: known[one.entry.id].when < last)
        for place, one in zip(held, mine, strict=True):
            ordered[place] = one
    return ordered
