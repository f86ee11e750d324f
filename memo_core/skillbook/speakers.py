"""Who gave the feedback that entries were made of, and when, in memory: every question asks that of the entries under
its own key, and in the book those are hundreds of rows that lie apart.
"""

from __future__ import annotations

import numpy as np
import sqlalchemy as sa

from memo_core.skillbook import tables
from memo_core.skillbook.database import Database
from memo_core.skillbook.newest import LATEST, newest_of
from memo_core.skillbook.term_lists import Growing, ranges

_F, _S = tables.feedback.c, tables.sources.c
_LINKS = sa.select(_S.entry, _S.feedback).where(_S.entry > sa.bindparam("after")).order_by(_S.entry, _S.feedback)
_SAID = sa.select(_F.id, _F.who, _F.time).where(_F.id > sa.bindparam("after")).order_by(_F.id)


class Speakers:
    """Of one book. What is read stays as it is until something is forgotten: feedback is only added, and what
    corrections were made of is stored with them. (Of templates and general statements it may be more by now.)"""

    def __init__(self, database: Database) -> None:
        self._database = database
        self._clear()

    def _clear(self) -> None:
        self._entries, self._made_of = Growing(np.int64), Growing(np.int64)  # an entry and a feedback, ascending
        self._feedback, self._who, self._when = Growing(np.int64), Growing(np.int32), Growing(np.float64)  # ascending
        self._numbers: dict[str, int] = {}  # of people

    def follow(self, anew: bool) -> None:
        """Read what came since the last time; ``anew``: everything, since some of it may be gone."""
        if anew:
            self._clear()
        entries = self._database.fetch(_LINKS, {"after": _last(self._entries)})
        feedback = self._database.fetch(_SAID, {"after": _last(self._feedback)})
        both = np.array([tuple(row) for row in entries], np.int64).reshape(-1, 2)
        self._entries.add(both[:, 0])
        self._made_of.add(both[:, 1])
        who = [self._numbers.setdefault(row[1], len(self._numbers)) for row in feedback]
        self._feedback.add(np.fromiter((row[0] for row in feedback), np.int64, len(feedback)))
        self._who.add(np.array(who, np.int32))
        self._when.add(np.fromiter((row[2] for row in feedback), np.float64, len(feedback)))

    def newest(self, corrections: np.ndarray, most: int) -> list[int]:
        """``newest_of`` the latest of these corrections, by their ids, int64 (n,)."""
        known, said = self._entries.values, self._feedback.values
        if not len(known) or not len(said):
            return []
        latest = np.sort(corrections)[-LATEST:]
        starts = np.searchsorted(known, latest)
        links = ranges(starts, np.searchsorted(known, latest + 1) - starts)
        of = np.minimum(np.searchsorted(said, self._made_of.values[links]), len(said) - 1)
        there = said[of] == self._made_of.values[links]  # all, unless somebody wrote between two readings
        links, of = links[there], of[there]
        return newest_of(known[links], self._who.values[of], self._when.values[of], said[of], most)


def _last(ascending: Growing) -> int:
    return int(ascending.values[-1]) if len(ascending.values) else 0
