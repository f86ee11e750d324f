"""Which entries may be among those that a subtask is served, with what their scores are made of.

Entries are found by their key, by their text through the vector store, among remarks about gripping that were made at
the opposite action (for actions that take hold of something), and as what a person said last under the subtask's own
key. An entry whose action undoes the subtask's is found in no other way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.skillbook import tables
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import spoken
from memo_core.skillbook.key_index import KeyScores
from memo_core.skillbook.keys import Key
from memo_core.skillbook.newest import newest_of_people
from memo_core.skillbook.retrieval_cache import KINDS, Contents
from memo_core.skillbook.retrieval_score import TIE, Candidates, best
from memo_core.skillbook.retrieval_settings import RetrievalSettings
from memo_core.skillbook.scene_context import SubtaskContext
from memo_core.skillbook.shared_terms import Terms, Wanted
from memo_core.skillbook.text_index import Likeness, Nearest
from memo_core.skillbook.text_search import TextSearch
from memo_core.skillbook.text_vectors import PLACE_NAMES, PLACES, TextVectors, batched, places

_MORE = 3  # times as many entries are looked at as are served,
_WIDER = 4  # and so many times those by r alone, before what else their keys tell
_EACH_KEY = 4  # entries of one key that count as found: where words decide too, one large key must not hide the next
_BY_TEXT = 64  # entries asked of the vector store
_OPPOSITE_KEYS = 12  # of the opposite action, that remarks about gripping are looked for under,
_OPPOSITE_ENTRIES = 400  # as long as there are not so many entries under them

_E = tables.entries.c
_FOUND = sa.select(_E.id, _E.kind, _E.key, _E.text).where(
    _E.id.in_([sa.bindparam(name) for name in PLACE_NAMES]), _E.superseded_by.is_(None)
)
_NO_ROWS = np.zeros(0, np.int64)


def as_text(subtask: Key) -> str:
    """The words that entries' texts are compared with."""
    return " ".join((subtask.action, *subtask.objects))


@attrs.frozen(eq=False)
class Question:
    """A subtask, ready to be compared."""

    key: Key
    context: SubtaskContext
    meant: np.ndarray  # unit vector of its words
    scores: KeyScores
    opposite: np.ndarray  # bool, of each key whether it undoes the action
    terms: Wanted


class Finder:
    """Finds candidates in one book."""

    def __init__(
        self,
        database: Database,
        vectors: TextVectors,
        settings: RetrievalSettings,
        terms: Terms,
        search: TextSearch,
        likeness: Likeness,
    ) -> None:
        self._database = database
        self._vectors = vectors
        self._settings = settings
        self._terms = terms
        self._search = search
        self._likeness = likeness

    def candidates(self, kind: str, question: Question, state: Contents, by_text: Candidates | None) -> Candidates:
        """Entries of a kind that may be among those served, best first as far as is known without their words.
        ``by_text``: what ``by_text`` found of that kind; None: keys alone decide."""
        limit = self._settings.limit(kind)
        if not limit:
            return Candidates.none()
        newest = self._newest(question, state) if kind == "correction" and self._settings.newest else []
        if by_text is None:
            found = self._by_key(kind, question, state, self._settings.cut, limit)
            joined = self._with(newest, found, question, state)
            return joined.only(best(joined.key_scores, joined.similar, limit, joined.must))
        floor = self._floor(kind, question, state)
        several = [self._by_key(kind, question, state, floor, _MORE * limit), by_text]
        if kind == "correction" and self._terms.grips(question.key.action, question.context):
            several.insert(0, self._about_gripping(question, state))
        joined = self._with(newest, Candidates.joined(several), question, state)
        return joined.only(best(joined.scores(self._settings), joined.similar, _MORE * limit, joined.must))

    def by_text(self, question: Question, state: Contents) -> dict[str, Candidates]:
        """Those whose texts are most like the subtask's words, by kind; not under a key whose action undoes it."""
        wanted = [kind for kind in KINDS if self._settings.limit(kind) and state.sizes[kind].any()]
        if not wanted:
            return {kind: Candidates.none() for kind in KINDS}
        valid = self._rows(self._search.nearest(question.meant, _BY_TEXT, state).tolist())
        if not any(kind in wanted for _, kind, *_ in valid):
            valid = self._rows(self._search.nearest(question.meant, _BY_TEXT, state, distrust=True).tolist())
        kept = [
            (entry, kind, state.row_of[key], text)
            for entry, kind, key, text in {row[0]: tuple(row) for row in valid}.values()
            if key in state.row_of and not question.opposite[state.row_of[key]]
        ]
        found = {}
        for kind in KINDS:
            floor = self._floor(kind, question, state)
            mine = [one for one in kept if one[1] == kind and question.scores.scores[one[2]] >= floor - TIE]
            if not mine or kind not in wanted:
                found[kind] = Candidates.none()
                continue
            similar = np.vecdot(self._vectors.get([spoken(kind, text) for *_, text in mine]), question.meant)
            entries, rows = (np.array([one[place] for one in mine], np.int64) for place in (0, 2))
            found[kind] = self._scored(question, state, entries, rows, similar)
        return found

    # -- inside --------------------------------------------------------------------------------------------------------
    def _floor(self, kind: str, question: Question, state: Contents) -> float:
        """The least r of a key whose entries may be served."""
        passing = ~question.opposite & (question.scores.scores >= self._settings.cut - TIE)
        enough = state.sizes[kind][passing].sum() >= self._settings.room(kind)
        return self._settings.cut if enough else -np.inf

    def _by_key(self, kind: str, question: Question, state: Contents, floor: float, count: int) -> Candidates:
        """The ``count`` best entries by their keys, those of one key by their text, and all that tie with the last."""
        scores, sizes = question.scores.scores, state.sizes[kind]
        by_text = self._settings.ranking == "key-and-text"
        rows = np.flatnonzero(~question.opposite & (sizes > 0) & (scores >= floor - TIE))
        if by_text:
            sizes = np.minimum(sizes, _EACH_KEY)
        rows = _until(rows, scores[rows], sizes, _WIDER * count if by_text else count)
        if by_text and len(rows):  # the rest of what their keys add to the scores, of the few that are near
            weight, share = self._settings.text_weight, self._settings.text_weight + self._settings.overlap_weight
            words = self._key_similar(question, state, rows)
            rows = _until(rows, (1 - share) * scores[rows] + weight / 2 * words, sizes, count)
        if not len(rows):
            return Candidates.none()
        found = self._scored(question, state, *self._nearest(kind, rows, question, state, count))
        return found if by_text else found.only(best(found.key_scores, found.similar, count, found.must))

    def _about_gripping(self, question: Question, state: Contents) -> Candidates:
        """Remarks about how to hold a thing that were made at an action which undoes this one: how hard to grip is
        often noticed only when a thing is put down. They count as made at gripping what was moved."""
        sizes = state.sizes["correction"]
        rows = np.flatnonzero(question.opposite & (sizes > 0))
        if not len(rows):
            return Candidates.none()
        moved = question.scores.moved_cosines
        rows = rows[np.argsort(-moved[rows], kind="stable")[:_OPPOSITE_KEYS]]
        rows = rows[: 1 + int(np.searchsorted(np.cumsum(sizes[rows]), _OPPOSITE_ENTRIES))]
        limit = _MORE * self._settings.corrections
        ids, entry_rows, similar = self._nearest("correction", rows, question, state, limit)
        likeliest = best(moved[entry_rows], similar, limit, np.zeros(len(ids), bool))
        ids, entry_rows, similar = ids[likeliest], entry_rows[likeliest], similar[likeliest]
        texts = {row[0]: row[3] for row in self._rows(ids.tolist())}
        chosen = np.array([self._terms.about_gripping(texts.get(entry, "")) for entry in ids.tolist()], dtype=bool)
        one = self._scored(question, state, ids[chosen], entry_rows[chosen], similar[chosen])
        by_action, by_moved = self._settings.weights
        action, objects = np.ones(len(one.ids)), moved[entry_rows[chosen]]
        scores = (by_action * action + by_moved * objects) / (by_action + by_moved)
        return attrs.evolve(one, key_scores=scores, action_cosines=action, objects_cosines=objects)

    def _newest(self, question: Question, state: Contents) -> list[int]:
        """What each person said last under the subtask's own key, in whatever words that is kept."""
        own = question.scores.scores >= 1 - TIE
        rows = np.flatnonzero(own & (state.sizes["correction"] > 0) & ~question.opposite)[:PLACES]
        keys = [state.ids[row] for row in rows.tolist()]
        return newest_of_people(self._database, keys, self._settings.corrections) if keys else []

    def _with(self, newest: list[int], found: Candidates, question: Question, state: Contents) -> Candidates:
        """With these corrections among the others, to be served whatever their score."""
        missing = [entry for entry in newest if entry not in set(found.ids.tolist())]
        rows = [row for row in self._rows(missing) if row[2] in state.row_of] if missing else []
        if rows:
            ids, of_key = np.array([(row[0], state.row_of[row[2]]) for row in rows], np.int64).T
            similar = np.vecdot(self._vectors.get([row[3] for row in rows]), question.meant)
            found = Candidates.joined([found, self._scored(question, state, ids, of_key, similar)])
        return attrs.evolve(found, must=np.isin(found.ids, newest)) if newest else found

    def _nearest(
        self, kind: str, rows: np.ndarray, question: Question, state: Contents, count: int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Of each key the entries most like the subtask's words: ids, rows of their keys, cosines."""
        each: list[Nearest] = self._likeness.nearest(
            kind, [state.ids[row] for row in rows.tolist()], question.meant, count
        )
        ids, similar = (np.concatenate(column) for column in zip(*each, strict=True))
        return ids, np.repeat(rows, [len(some) for some, _ in each]), similar

    def _scored(
        self, question: Question, state: Contents, ids: np.ndarray, rows: np.ndarray, similar: np.ndarray
    ) -> Candidates:
        """With all terms of their scores but the overlap, which needs their texts."""
        scores, nothing = question.scores, np.zeros(len(ids))
        by_key = nothing
        if self._settings.ranking == "key-and-text" and len(ids):
            different, place = np.unique(rows, return_inverse=True)
            by_key = self._key_similar(question, state, different)[place]
        terms = (scores.scores[rows], scores.action_cosines[rows], scores.objects_cosines[rows])
        numbers = (*terms, similar.astype(np.float64), by_key, nothing)
        return Candidates(np.asarray(ids, np.int64), *numbers, np.zeros(len(ids), bool), scores.exchanged[rows])

    def _key_similar(self, question: Question, state: Contents, rows: np.ndarray) -> np.ndarray:
        """Cosines of keys' words with the subtask's, float64."""
        vectors = self._vectors.get([as_text(state.keys[row]) for row in rows.tolist()])
        return np.vecdot(vectors, question.meant).astype(np.float64)

    def _rows(self, ids: Sequence[int]) -> list[Sequence[Any]]:
        """Id, kind, key and text of those that are valid."""
        return [row for part in batched(ids, PLACES) for row in self._database.fetch(_FOUND, places(part))]


def _until(rows: np.ndarray, scores: np.ndarray, sizes: np.ndarray, count: int) -> np.ndarray:
    """Keys' rows by their scores, best first, until ``count`` entries are under them, and those that tie with the
    last."""
    if len(rows) > count:  # every key has an entry
        near = scores >= np.partition(scores, len(rows) - count)[len(rows) - count] - TIE
        rows, scores = rows[near], scores[near]
    order = np.lexsort((rows, -scores))
    rows, scores = rows[order], scores[order]
    taken = np.cumsum(sizes[rows])
    if len(rows) and taken[-1] > count:
        rows = rows[scores >= scores[int(np.searchsorted(taken, count))] - TIE]
    return rows
