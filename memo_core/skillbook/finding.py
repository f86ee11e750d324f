"""Which entries may be served where keys and texts decide together (``retrieval.ranking: key-and-text``), with all that
their scores are made of.

Candidates are the best entries of the book by score (``memo_core.skillbook.best_entries``), remarks about gripping that
were made at the opposite action (for actions that take hold of something), and what people said last under the
subtask's own key. An entry whose action undoes the subtask's is found in no other way.
"""

from __future__ import annotations

import attrs
import numpy as np

from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook.best_entries import Scored, Weighed, best_entries, scored
from memo_core.skillbook.database import Database
from memo_core.skillbook.entry_index import EntryIndex
from memo_core.skillbook.newest import newest_of_people
from memo_core.skillbook.question import Question, as_text
from memo_core.skillbook.retrieval_cache import KINDS, Contents
from memo_core.skillbook.retrieval_score import TIE, Candidates, best
from memo_core.skillbook.retrieval_settings import RetrievalSettings
from memo_core.skillbook.shared_terms import GRIP, Terms
from memo_core.skillbook.text_index import Likeness
from memo_core.skillbook.text_search import TextSearch
from memo_core.skillbook.text_vectors import TextVectors

_MORE = 3  # times as many entries are candidates as are served, where more than their scores orders them
_BY_TEXT = 64  # entries asked of the vector store
_OPPOSITE_KEYS = 12  # of the opposite action, that remarks about gripping are looked for under,
_OPPOSITE_ENTRIES = 400  # as long as there are not so many entries under them


@attrs.frozen(eq=False)
class Nearby:
    """What the vector store found for a question, and how alike the words of all keys are."""

    positions: dict[str, np.ndarray]  # kind -> positions in its index
    nearest: float  # the largest cosine that a text which was not found may have
    key_similar: np.ndarray  # by row, cosines of the keys' words and the subtask's, float64


class Finder:
    """Finds candidates in one book. Keeps its entries in memory."""

    def __init__(
        self,
        database: Database,
        vectors: TextVectors,
        settings: RetrievalSettings,
        terms: Terms,
        store: VectorStore | None,
        likeness: Likeness,
    ) -> None:
        self._database = database
        self._vectors = vectors
        self._settings = settings
        self._terms = terms
        self._likeness = likeness
        self._indexes = {kind: EntryIndex(likeness, kind, terms) for kind in KINDS}
        self._search = TextSearch(database, vectors, self._indexes, store)
        self._slots: dict[str, np.ndarray] = {}  # kind -> of each row the slot in its index, or -1
        self._rows: dict[str, np.ndarray] = {}  # kind -> of each slot the row, or -1
        self._key_words = np.zeros((0, 0), np.float32)  # by row
        self._followed: Contents | None = None

    def follow(self, state: Contents, changed: frozenset[int] | None) -> None:
        """Bring what is in memory up to the book's state. ``changed``: the keys whose entries may be others than in the
        state that was followed before; None: of any key."""
        before = self._followed
        self._followed = None
        if before is None or before.book != state.book:
            for index in self._indexes.values():
                index.clear()
        for kind, index in self._indexes.items():
            index.follow(state.ids, changed, int(state.sizes[kind].sum()))
            slots = self._slots[kind] = index.slots_of(state.ids)
            rows = self._rows[kind] = np.full(index.slots, -1, np.int64)
            rows[slots[slots >= 0]] = np.flatnonzero(slots >= 0)
        if (before is None or before.book != state.book or before.ids != state.ids) and state.keys:
            self._key_words = self._vectors.get([as_text(key) for key in state.keys])
        self._followed = state

    def near(self, question: Question, state: Contents) -> Nearby:
        """What the vector store finds by the subtask's words."""
        similar = np.vecdot(self._key_words, question.meant).astype(np.float64) if state.keys else np.zeros(0)
        wanted = [kind for kind in KINDS if self._settings.limit(kind) and state.sizes[kind].any()]
        nothing = {kind: np.zeros(0, np.int64) for kind in KINDS}
        if not wanted:
            return Nearby(nothing, -1.0, similar)
        found = self._positions(self._search.nearest(question.meant, _BY_TEXT, state))
        if not any(len(found[kind]) for kind in wanted):
            found = self._positions(self._search.nearest(question.meant, _BY_TEXT, state, distrust=True))
        cosines = np.concatenate([self._indexes[kind].similar(found[kind], question.meant) for kind in KINDS])
        nearest = 1.0
        if len(cosines) == sum(map(len, self._indexes.values())):
            nearest = -1.0
        elif len(cosines):  # not the last one's: an approximate store misses some that are nearer
            nearest = float(np.median(cosines))
        return Nearby(found, nearest, similar)

    def candidates(self, kind: str, question: Question, state: Contents, near: Nearby) -> Candidates:
        """Entries of a kind that may be among those served."""
        limit, index = self._settings.limit(kind), self._indexes[kind]
        if not limit or not len(index) or not state.keys:
            return Candidates.none()
        found = self._scored(kind, question, near, self._best(kind, question, state, near))
        gripping = Candidates.none()
        if kind == "correction" and self._terms.grips(question.key.action, question.context):
            gripping = self._about_gripping(question, state, near)
        several = [gripping, found]
        newest: list[int] = []
        if kind == "correction" and self._settings.newest and (keys := question.own_keys(state)):
            newest = newest_of_people(self._database, keys, self._settings.corrections)
            positions = index.positions(np.array(newest, np.int64))
            positions = positions[self._rows[kind][index.slot(positions)] >= 0]
            several.append(self._scored(kind, question, near, scored(self._weighed(kind, question, near), positions)))
        joined = Candidates.joined(several)
        joined = attrs.evolve(joined, must=np.isin(joined.ids, newest)) if newest else joined
        return joined.only(best(joined.scores(self._settings), joined.similar, _MORE * limit, joined.must))

    # -- inside --------------------------------------------------------------------------------------------------------
    def _positions(self, ids: np.ndarray) -> dict[str, np.ndarray]:
        return {kind: index.positions(ids) for kind, index in self._indexes.items()}

    def _best(self, kind: str, question: Question, state: Contents, near: Nearby) -> Scored:
        """Where enough entries pass the cut, the best of them; else all of them, and the best of the others."""
        settings, scores = self._settings, question.scores.scores
        reordered = kind == "template" or (settings.built_weight and any(question.context.structures))
        more = _MORE if reordered else 1
        served, there = state.sizes[kind] > 0, ~question.opposite
        passing = there & served & (scores >= settings.cut - TIE)
        found, nearest = near.positions[kind], near.nearest
        if np.isfinite(question.floor(kind, state, settings)):
            return best_entries(
                self._weighed(kind, question, near, passing), more * settings.limit(kind), found, nearest
            )
        several = [
            best_entries(self._weighed(kind, question, near, rows), count, found, nearest, floor)
            for rows, count, floor in (
                (passing, settings.room(kind), -np.inf),
                (there & served, 1, -np.inf),
                (there & served & ~passing, more * settings.room(kind), settings.text_floor),
            )
        ]
        return Scored.joined(several)

    def _weighed(self, kind: str, question: Question, near: Nearby, rows: np.ndarray | None = None) -> Weighed:
        """The question for an index, with the entries of some keys' rows (bool) or of all."""
        settings, index, of = self._settings, self._indexes[kind], self._rows[kind]
        known = of >= 0
        counts = (1 - question.scores.exchanged[of]) * known
        by_text, by_terms = counts * settings.text_weight / 2, counts * settings.overlap_weight
        key_similar = near.key_similar[of]
        base = (1 - settings.text_weight - settings.overlap_weight) * question.scores.scores[of] + by_text * key_similar
        base[~known if rows is None else ~(known & rows[of])] = -np.inf
        return Weighed(index, question.meant, question.terms, base, by_text, by_terms, key_similar)

    def _scored(self, kind: str, question: Question, near: Nearby, found: Scored) -> Candidates:
        index, scores = self._indexes[kind], question.scores
        rows = self._rows[kind][index.slot(found.positions)]
        return Candidates(
            index.ids(found.positions),
            scores.scores[rows],
            scores.action_cosines[rows],
            scores.objects_cosines[rows],
            found.similar,
            near.key_similar[rows],
            found.overlap,
            np.zeros(len(rows), bool),
            scores.exchanged[rows],
        )

    def _about_gripping(self, question: Question, state: Contents, near: Nearby) -> Candidates:
        """Remarks about how to hold a thing that were made at an action which undoes this one: how hard to grip is
        often noticed only when a thing is put down. They count as made at gripping what was moved."""
        index, sizes, moved = self._indexes["correction"], state.sizes["correction"], question.scores.moved_cosines
        rows = np.flatnonzero(question.opposite & (sizes > 0))
        rows = rows[np.argsort(-moved[rows], kind="stable")[:_OPPOSITE_KEYS]]
        rows = rows[: 1 + int(np.searchsorted(np.cumsum(sizes[rows]), _OPPOSITE_ENTRIES))]
        slots = self._slots["correction"][rows]
        positions, gripping = index.of_slots_with_overlap(slots[slots >= 0], ({GRIP: 1.0}, 1.0))
        found = scored(self._weighed("correction", question, near), positions[gripping > 0])
        near_moved = moved[self._rows["correction"][index.slot(found.positions)]]
        limit = _MORE * self._settings.corrections
        likeliest = best(near_moved, found.similar, limit, np.zeros(len(near_moved), bool))
        found, near_moved = found.only(likeliest), near_moved[likeliest]
        texts = self._likeness.texts(index.ids(found.positions).tolist())
        chosen = np.array([self._terms.about_gripping(text) for text in texts], dtype=bool)
        one = self._scored("correction", question, near, found.only(chosen))
        by_action, by_moved = self._settings.weights
        action, objects = np.ones(len(one.ids)), near_moved[chosen]
        scores = (by_action * action + by_moved * objects) / (by_action + by_moved)
        return attrs.evolve(one, key_scores=scores, action_cosines=action, objects_cosines=objects)
