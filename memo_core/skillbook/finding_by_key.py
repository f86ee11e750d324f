"""Which entries may be served where keys alone decide (``retrieval.ranking: key``): those under the keys with the
largest r, of one key those whose texts are most like the subtask's words, and what people said last under the subtask's
own key."""

from __future__ import annotations

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.skillbook import tables
from memo_core.skillbook.database import Database
from memo_core.skillbook.newest import newest_of_people
from memo_core.skillbook.question import Question
from memo_core.skillbook.retrieval_cache import Contents
from memo_core.skillbook.retrieval_score import TIE, Candidates, best
from memo_core.skillbook.retrieval_settings import RetrievalSettings
from memo_core.skillbook.term_lists import nth_largest
from memo_core.skillbook.text_index import Likeness, Nearest
from memo_core.skillbook.text_vectors import PLACE_NAMES, PLACES, TextVectors, batched, places

_E = tables.entries.c
_FOUND = sa.select(_E.id, _E.key, _E.text).where(
    _E.id.in_([sa.bindparam(name) for name in PLACE_NAMES]), _E.superseded_by.is_(None)
)


class FinderByKey:
    """Finds candidates in one book by their keys."""

    def __init__(
        self, database: Database, vectors: TextVectors, settings: RetrievalSettings, likeness: Likeness
    ) -> None:
        self._database = database
        self._vectors = vectors
        self._settings = settings
        self._likeness = likeness

    def candidates(self, kind: str, question: Question, state: Contents) -> Candidates:
        """Entries of a kind that may be among those served."""
        limit = self._settings.limit(kind)
        if not limit:
            return Candidates.none()
        found = self._by_key(kind, question, state, limit)
        if kind == "correction" and self._settings.newest:
            found = self._with_newest(found, question, state)
        return found.only(best(found.key_scores, found.similar, limit, found.must))

    def _by_key(self, kind: str, question: Question, state: Contents, count: int) -> Candidates:
        """The ``count`` best, and all that tie with the last."""
        scores, sizes = question.scores.scores, state.sizes[kind]
        rows = np.flatnonzero(question.passing & (sizes > 0))
        rows = _until(rows, scores[rows], sizes, count)
        if not len(rows):
            return Candidates.none()
        each: list[Nearest] = self._likeness.nearest(
            kind, [state.ids[row] for row in rows.tolist()], question.meant, count
        )
        ids, similar = (np.concatenate(column) for column in zip(*each, strict=True))
        return _scored(question, ids, np.repeat(rows, [len(some) for some, _ in each]), similar)

    def _with_newest(self, found: Candidates, question: Question, state: Contents) -> Candidates:
        """With what each person said last under the subtask's own key, to be served whatever its score."""
        keys = [state.ids[row] for row in question.own_rows(state).tolist()]
        newest = newest_of_people(self._database, keys, self._settings.corrections) if keys else []
        missing = [entry for entry in newest if entry not in set(found.ids.tolist())]
        rows = [row for part in batched(missing, PLACES) for row in self._database.fetch(_FOUND, places(part))]
        rows = [row for row in rows if row[1] in state.row_of]
        if rows:
            ids, of_key = np.array([(row[0], state.row_of[row[1]]) for row in rows], np.int64).T
            similar = np.vecdot(self._vectors.get([row[2] for row in rows]), question.meant)
            found = Candidates.appended([found, _scored(question, ids, of_key, similar)])
        return attrs.evolve(found, must=np.isin(found.ids, newest)) if newest else found


def _scored(question: Question, ids: np.ndarray, rows: np.ndarray, similar: np.ndarray) -> Candidates:
    scores, nothing = question.scores, np.zeros(len(ids))
    terms = (scores.scores[rows], scores.action_cosines[rows], scores.objects_cosines[rows])
    numbers = (*terms, similar.astype(np.float64), nothing, nothing)
    return Candidates(np.asarray(ids, np.int64), *numbers, np.zeros(len(ids), bool), scores.exchanged[rows])


def _until(rows: np.ndarray, scores: np.ndarray, sizes: np.ndarray, count: int) -> np.ndarray:
    """Keys' rows by their scores, best first, until ``count`` entries are under them, and those that tie with the
    last."""
    if len(rows) > count:  # every key has an entry
        near = scores >= nth_largest(scores, count) - TIE
        rows, scores = rows[near], scores[near]
    order = np.lexsort((rows, -scores))
    rows, scores = rows[order], scores[order]
    taken = np.cumsum(sizes[rows])
    if len(rows) and taken[-1] > count:
        rows = rows[scores >= scores[int(np.searchsorted(taken, count))] - TIE]
    return rows
