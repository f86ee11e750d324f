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
from memo_core.skillbook.question import Question, as_text
from memo_core.skillbook.retrieval_cache import KINDS, Contents
from memo_core.skillbook.retrieval_score import TIE, Candidates, best
from memo_core.skillbook.retrieval_settings import RetrievalSettings
from memo_core.skillbook.shared_terms import GRIP, RELEASE, Terms
from memo_core.skillbook.speakers import Speakers
from memo_core.skillbook.term_lists import within
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
        speakers: Speakers,
    ) -> None:
        self._database = database
        self._vectors = vectors
        self._settings = settings
        self._terms = terms
        self._indexes = {kind: EntryIndex(likeness, kind, terms) for kind in KINDS}
        self._search = TextSearch(database, vectors, self._indexes, store)
        self._speakers = speakers
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
        self._speakers.follow(anew=changed is None)
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
        """Entries of a kind that may be served; more than are served where more than their scores orders them."""
        settings, index = self._settings, self._indexes[kind]
        limit = settings.limit(kind)
        if not limit or not len(index) or not state.keys:
            return Candidates.none()
        asked = self._weighed(kind, question, near)
        several = [self._scored(kind, question, near, self._best(kind, question, state, near, asked))]
        if kind == "correction" and self._terms.grips(question.key.action, question.context):
            several.insert(0, self._about_gripping(question, state, near, asked))
        newest: list[int] = []
        if kind == "correction" and settings.newest and (keys := question.own_keys(state)):
            own = index.of_slots(self._slots[kind][[state.row_of[key] for key in keys]])
            newest = self._speakers.newest(index.ids(own), settings.corrections)
            several.append(self._scored(kind, question, near, scored(asked, index.positions(np.array(newest)))))
        joined = Candidates.joined(several)
        joined = attrs.evolve(joined, must=within(joined.ids, np.sort(newest))) if newest else joined
        scores = joined.scores(settings)
        if len(scores) > _MORE * limit:
            chosen = best(scores, joined.similar, _MORE * limit, joined.must)
            joined, scores = joined.only(chosen), scores[chosen]
        chosen = np.flatnonzero(joined.served(settings, settings.room(kind), scores))
        count = limit * self._more(kind, question, state)
        return joined.only(chosen[best(scores[chosen], joined.similar[chosen], count, joined.must[chosen])])

    # -- inside --------------------------------------------------------------------------------------------------------
    def _positions(self, ids: np.ndarray) -> dict[str, np.ndarray]:
        return {kind: index.positions(ids) for kind, index in self._indexes.items()}

    def _more(self, kind: str, question: Question, state: Contents) -> int:
        """Times as many entries are looked at as are served: more where not their scores alone decide which."""
        built = self._settings.built_weight and any(question.context.structures)
        return _MORE if built or (kind == "template" and state.failing) else 1

    def _best(self, kind: str, question: Question, state: Contents, near: Nearby, asked: Weighed) -> Scored:
        """Where enough entries pass the cut, the best of them; else all of them, and the best of the others."""
        settings, of, more = self._settings, self._rows[kind], self._more(kind, question, state)
        there = (~question.opposite & (state.sizes[kind] > 0))[of]
        passing = there & (question.scores.scores[of] >= settings.cut - TIE)
        found, nearest = near.positions[kind], near.nearest
        if np.isfinite(question.floor(kind, state, settings)):
            return best_entries(asked.only(passing), more * settings.limit(kind), found, nearest)
        several = [
            best_entries(asked.only(slots), count, found, nearest, floor)
            for slots, count, floor in (
                (passing, settings.room(kind), -np.inf),
                (there, 1, -np.inf),
                (there & ~passing, more * settings.room(kind), settings.text_floor),
            )
        ]
        return Scored.joined(several)

    def _weighed(self, kind: str, question: Question, near: Nearby) -> Weighed:
        """The question for an index."""
        settings, index, of = self._settings, self._indexes[kind], self._rows[kind]
        counts = (1 - question.scores.exchanged[of]) * (of >= 0)
        by_text, by_terms = counts * settings.text_weight / 2, counts * settings.overlap_weight
        key_similar = near.key_similar[of]
        base = (1 - settings.text_weight - settings.overlap_weight) * question.scores.scores[of] + by_text * key_similar
        base[of < 0] = -np.inf
        most = index.most_overlap(question.terms)
        return Weighed(index, question.meant, question.terms, base, by_text, by_terms, key_similar, most)

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

    def _about_gripping(self, question: Question, state: Contents, near: Nearby, asked: Weighed) -> Candidates:
        """Remarks about how to hold a thing that were made at an action which undoes this one: how hard to grip is
        often noticed only when a thing is put down. They count as made at gripping what was moved."""
        index, sizes, moved = self._indexes["correction"], state.sizes["correction"], question.scores.moved_cosines
        rows = np.flatnonzero(question.opposite & (sizes > 0))
        rows = rows[np.argsort(-moved[rows], kind="stable")[:_OPPOSITE_KEYS]]
        rows = rows[: 1 + int(np.searchsorted(np.cumsum(sizes[rows]), _OPPOSITE_ENTRIES))]
        slots = self._slots["correction"][rows]
        positions = index.of_slots(slots[slots >= 0])
        found = scored(asked, positions[index.terms.have(positions, GRIP)])
        near_moved = moved[self._rows["correction"][index.slot(found.positions)]]
        likeliest = best(near_moved, found.similar, _MORE * self._settings.corrections, np.zeros(len(near_moved), bool))
        likeliest = likeliest[~index.terms.have(found.positions[likeliest], RELEASE)]
        one, near_moved = self._scored("correction", question, near, found.only(likeliest)), near_moved[likeliest]
        by_action, by_moved = self._settings.weights
        action = np.ones(len(one.ids))
        scores = (by_action * action + by_moved * near_moved) / (by_action + by_moved)
        return attrs.evolve(one, key_scores=scores, action_cosines=action, objects_cosines=near_moved)
