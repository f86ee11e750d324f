"""Who gave the feedback that entries were made of, when, and about which subtask, in memory: every question asks that
of the entries that it serves and of those under its own key, and in the book those are hundreds of rows that lie apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from operator import itemgetter
from typing import Any

import numpy as np
import sqlalchemy as sa

from memo_core.skillbook import tables
from memo_core.skillbook.database import Database
from memo_core.skillbook.id_table import IdTable
from memo_core.skillbook.newest import LATEST, newest_of
from memo_core.skillbook.provenance import Provenance, provenance_from
from memo_core.skillbook.term_lists import Growing, Numbered, ranges

_F, _S = tables.feedback.c, tables.sources.c
_LINKS = sa.select(_S.entry, _S.feedback).where(_S.entry > sa.bindparam("after")).order_by(_S.entry, _S.feedback)
_SAID = sa.select(_F.id, _F.who, _F.time, _F.subtask).where(_F.id > sa.bindparam("after")).order_by(_F.id)


class Speakers:
    """Of one book. What is read stays as it is until something is forgotten: feedback is only added, and what
    corrections and general statements were made of is stored with them. (Of templates it may be more by now: an
    approval of code that is the template already is added to its sources.)

    Entries and feedback are numbered in the order of their ids.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._clear()

    def _clear(self) -> None:
        self._last_entry = self._last_feedback = 0  # ids
        self._entries, self._feedback = IdTable(), IdTable()  # their numbers
        self._first = Growing(np.int64)  # by entry, where its feedback begins in ``_made_of``, and the end
        self._first.add(np.zeros(1, np.int64))
        self._made_of = Growing(np.int32)
        self._who, self._when, self._about = Growing(np.int32), Growing(np.float64), Growing(np.int32)  # by feedback
        self._people, self._subtasks = Numbered(), Numbered()
        self._names: list[str] = []  # of people by number
        self._said_of: list[str] = []  # subtasks by number

    def follow(self, anew: bool) -> None:
        """Read what came since the last time; ``anew``: everything, since some of it may be gone."""
        if anew:
            self._clear()
        links = self._database.fetch(_LINKS, {"after": self._last_entry})
        self._hear(self._database.fetch(_SAID, {"after": self._last_feedback}))
        if not links:
            return
        entries, feedback = np.fromiter(chain.from_iterable(links), np.int64, 2 * len(links)).reshape(-1, 2).T
        made_of = self._feedback.get(feedback)
        there = made_of >= 0  # all, unless somebody forgot some between the two readings
        ids, counts = np.unique(entries[there], return_counts=True)
        self._entries.put(ids, len(self._first.values) - 1 + np.arange(len(ids)))
        self._first.add(len(self._made_of.values) + counts.cumsum())
        self._made_of.add(made_of[there])
        self._last_entry = int(entries[-1])

    def _hear(self, said: Sequence[Sequence[Any]]) -> None:
        if not said:
            return
        ids = np.array([row[0] for row in said], np.int64)
        self._feedback.put(ids, len(self._who.values) + np.arange(len(ids)))
        self._who.add(np.array([self._people[row[1]] for row in said]))
        self._when.add(np.array([row[2] for row in said]))
        self._about.add(np.array([self._subtasks[row[3]] for row in said]))
        self._last_feedback = int(ids[-1])
        self._names, self._said_of = list(self._people), list(self._subtasks)

    def newest(self, corrections: np.ndarray, most: int) -> list[int]:
        """``newest_of`` the latest of these corrections, by their ids, int64 (n,)."""
        latest, starts, counts = self._links(np.sort(corrections)[-LATEST:])
        of = self._made_of.values[ranges(starts, counts)]
        return newest_of(np.repeat(latest, counts), self._who.values[of], self._when.values[of], of, most)

    def provenance(self, entries: Sequence[int]) -> dict[int, Provenance]:
        """``provenance_of`` corrections and general statements."""
        ids, starts, counts = self._links(np.array(entries, np.int64))
        of = self._made_of.values[ranges(starts, counts)]
        columns = (np.repeat(ids, counts), self._who.values[of], self._when.values[of], self._about.values[of])
        said: dict[int, list[tuple[str, float, str]]] = {}
        for entry, who, when, about in zip(*(column.tolist() for column in columns), strict=True):
            said.setdefault(entry, []).append((self._names[who], when, self._said_of[about]))
        return {
            entry: provenance_from(remarks if len(remarks) == 1 else sorted(remarks, key=itemgetter(1)))
            for entry, remarks in said.items()
        }

    def _links(self, entries: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Those of the entries that are known, and where what they were made of begins and how many that are."""
        numbers = self._entries.get(entries)
        there = numbers >= 0
        numbers, firsts = numbers[there], self._first.values
        return entries[there], firsts[numbers], firsts[numbers + 1] - firsts[numbers]
