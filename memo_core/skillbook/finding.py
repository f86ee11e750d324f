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
from memo_core.skillbook.best_entries import KeyWeights, Scored, Weighed, best_entries
from memo_core.skillbook.database import Database
from memo_core.skillbook.entry_index import EntryIndex
from memo_core.skillbook.question import Question, as_text
from memo_core.skillbook.retrieval_cache import KINDS, Contents
from memo_core.skillbook.retrieval_score import Candidates, best
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
_COMPARED = 5_000  # templates that are all compared where no corrections are looked for; else the store is asked
_NONE = np.zeros(0, np.int64)


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
        self._speakers.follow(anew=changed is None)
        if (before is None or before.book != state.book or before.ids != state.ids) and state.keys:
            self._key_words = self._vectors.get([as_text(key) for key in state.keys])
        self._followed = state

    def candidates(self, question: Question, state: Contents) -> dict[str, Candidates]:
        """By kind, entries that may be served; more than are served where more than their scores orders them."""
        found = {kind: Candidates.none() for kind in KINDS}
        wanted = [kind for kind in KINDS if self._settings.limit(kind) and len(self._indexes[kind])]
        if not wanted or not state.keys:
            return found
        keys, newest = self._key_weights(question), self._newest(question, state)
        if len(newest) and len(newest) >= self._settings.corrections:  # no room for others
            wanted.remove("correction")
            index = self._indexes["correction"]
            last = Scored.of(index, newest, question.meant, question.terms)
            keys.compare(last.rows)
            found["correction"] = self._scored(question, index, keys, last, np.ones(len(newest), bool))
        for kind, asked in self._weighed(question, state, keys, wanted).items():
            must = newest if kind == "correction" else _NONE
            found[kind] = self._of_kind(kind, question, state, asked, must)
        return found

    # -- comparing -----------------------------------------------------------------------------------------------------
    def _key_weights(self, question: Question) -> KeyWeights:
        settings, scores = self._settings, question.scores
        counts = 1 - scores.exchanged
        by_text, by_terms = counts * settings.text_weight / 2, counts * settings.overlap_weight
        base = (1 - settings.text_weight - settings.overlap_weight) * scores.scores
        return KeyWeights.of(question.meant, self._key_words, base, by_text, by_terms)

    def _weighed(self, question: Question, state: Contents, keys: KeyWeights, wanted: list[str]) -> dict[str, Weighed]:
        """The question for each of some kinds."""
        templates = self._indexes["template"]
        if self._search.is_current(state):  # else it is asked all the same, so that what was forgotten leaves it
            if not wanted:
                return {}
            if wanted == ["template"] and len(templates) <= _COMPARED:
                every = templates.compared(question.meant)
                return {"template": Weighed(templates, keys, question.terms, Scored.none(), 1.0, every)}
        near, nearest = self._near(question, state)
        return {kind: Weighed(self._indexes[kind], keys, question.terms, near[kind], nearest) for kind in wanted}

    def _near(self, question: Question, state: Contents) -> tuple[dict[str, Scored], float]:
        """What the vector store finds by the subtask's words, by kind, and the largest cosine that any other text may
        have."""
        found = self._positions(self._search.nearest(question.meant, _BY_TEXT, state))
        if not any(map(len, found.values())):
            found = self._positions(self._search.nearest(question.meant, _BY_TEXT, state, distrust=True))
        near = {
            kind: Scored.of(index, found[kind], question.meant, question.terms) for kind, index in self._indexes.items()
        }
        return near, self._nearest([one.similar for one in near.values()])

    def _positions(self, ids: np.ndarray) -> dict[str, np.ndarray]:
        return {kind: index.positions(ids) for kind, index in self._indexes.items()}

    def _nearest(self, found: list[np.ndarray]) -> float:
        """The largest cosine that a text which the store did not find may have, by the cosines of those found."""
        cosines = np.sort(np.concatenate(found))
        if len(cosines) == sum(map(len, self._indexes.values())):
            return -1.0
        # not the last one's: an approximate store misses some that are nearer
        return float(cosines[len(cosines) // 2]) if len(cosines) else 1.0

    # -- choosing ------------------------------------------------------------------------------------------------------
    def _of_kind(self, kind: str, question: Question, state: Contents, asked: Weighed, must: np.ndarray) -> Candidates:
        """``must``: positions of those that are served whatever their scores."""
        settings, limit = self._settings, self._settings.limit(kind)
        found = self._best(kind, question, state, asked)
        if len(must):
            found = Scored.appended([found, asked.scored(must[~within(must, np.sort(found.positions))])])
        several = [self._scored(question, asked.index, asked.keys, found, within(found.positions, must))]
        if kind == "correction" and self._terms.grips(question.key.action, question.context):
            several.insert(0, self._about_gripping(question, state, asked))
        joined = Candidates.appended(several)
        scores = joined.scores(settings)
        if len(scores) > _MORE * limit:
            chosen = best(scores, joined.similar, _MORE * limit, joined.must)
            joined, scores = joined.only(chosen), scores[chosen]
        if not (chosen := joined.served(settings, settings.room(kind), scores)).all():
            joined, scores = joined.only(chosen), scores[chosen]
        left = (limit - len(must)) * self._more(kind, question, state)
        return joined.only(best(scores, joined.similar, left, joined.must))

    def _more(self, kind: str, question: Question, state: Contents) -> int:
        """Times as many entries are looked at as are served: more where not their scores alone decide which."""
        built = self._settings.built_weight and any(question.context.structures)
        return _MORE if built or (kind == "template" and state.failing) else 1

    def _best(self, kind: str, question: Question, state: Contents, asked: Weighed) -> Scored:
        """Where enough entries pass the cut, the best of them; else all of them, and the best of the others."""
        settings, more, sizes = self._settings, self._more(kind, question, state), state.sizes[kind]
        passing = question.passing & (sizes > 0)
        if int(sizes[passing].sum()) >= settings.room(kind):
            return best_entries(asked, passing, more * settings.limit(kind))
        there = ~question.opposite & (sizes > 0)
        several = [
            best_entries(asked, keys, count, floor)
            for keys, count, floor in (
                (passing, settings.room(kind), -np.inf),
                (there, 1, -np.inf),
                (there & ~passing, more * settings.room(kind), settings.text_floor),
            )
        ]
        return Scored.joined(several)

    def _newest(self, question: Question, state: Contents) -> np.ndarray:
        """Positions of what people said last under the subtask's own key, ascending."""
        own = question.own_rows(state) if self._settings.newest and self._settings.corrections else _NONE
        if not len(own):
            return _NONE
        index = self._indexes["correction"]
        newest = self._speakers.newest(index.ids(index.under(own)), self._settings.corrections)
        return index.positions(np.array(newest, np.int64))

    def _scored(
        self, question: Question, index: EntryIndex, keys: KeyWeights, found: Scored, must: np.ndarray
    ) -> Candidates:
        scores, rows = question.scores, found.rows
        return Candidates(
            index.ids(found.positions),
            scores.scores[rows],
            scores.action_cosines[rows],
            scores.objects_cosines[rows],
            found.similar,
            keys.similar[rows],
            found.overlap,
            must,
            scores.exchanged[rows],
        )

    def _about_gripping(self, question: Question, state: Contents, asked: Weighed) -> Candidates:
        """Remarks about how to hold a thing that were made at an action which undoes this one: how hard to grip is
        often noticed only when a thing is put down. They count as made at gripping what was moved."""
        index, sizes, moved = asked.index, state.sizes["correction"], question.scores.moved_cosines
        rows = np.flatnonzero(question.opposite & (sizes > 0))
        rows = rows[np.argsort(-moved[rows], kind="stable")[:_OPPOSITE_KEYS]]
        rows = rows[: 1 + int(np.searchsorted(np.cumsum(sizes[rows]), _OPPOSITE_ENTRIES))]
        positions = index.under(rows)
        found = asked.scored(positions[index.terms.have(positions, GRIP)])
        near_moved, nothing = moved[found.rows], np.zeros(len(found.rows), bool)
        likeliest = best(near_moved, found.similar, _MORE * self._settings.corrections, nothing)
        likeliest = likeliest[~index.terms.have(found.positions[likeliest], RELEASE)]
        one = self._scored(question, index, asked.keys, found.only(likeliest), nothing[likeliest])
        near_moved, action = near_moved[likeliest], np.ones(len(likeliest))
        by_action, by_moved = self._settings.weights
        scores = (by_action * action + by_moved * near_moved) / (by_action + by_moved)
        return attrs.evolve(one, key_scores=scores, action_cosines=action, objects_cosines=near_moved)
