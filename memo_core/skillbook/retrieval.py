"""Retrieval: which entries a subtask is served, in which order, and what was cut by which rule.

Keys are compared by r(q, v), all of them and exactly. Entries are found by their key, by their text through the vector
store, and, for actions that take hold of something, among remarks about gripping that were made at the opposite action.
Whatever was found is scored (``memo_core.skillbook.retrieval_score``). An entry whose action undoes the subtask's is
never served otherwise, however it was found.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.skillbook import tables
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import Entry, headline
from memo_core.skillbook.key_embedding import KeyVectors
from memo_core.skillbook.key_index import KeyIndex, KeyScores
from memo_core.skillbook.keys import Key
from memo_core.skillbook.provenance import Provenance, provenance_of
from memo_core.skillbook.queries import generation_of, served_rows
from memo_core.skillbook.retrieval_cache import KINDS, Contents, read_contents
from memo_core.skillbook.retrieval_result import ALIKE, Cut, Retrieval, Served, alike
from memo_core.skillbook.retrieval_score import TIE, Candidates, best
from memo_core.skillbook.retrieval_settings import RetrievalSettings
from memo_core.skillbook.scene_context import SubtaskContext
from memo_core.skillbook.shared_terms import Terms
from memo_core.skillbook.text_index import Likeness
from memo_core.skillbook.text_search import TextSearch
from memo_core.skillbook.text_vectors import PLACE_NAMES, PLACES, TextVectors, batched, places
from memo_core.skillbook.trials import failing

__all__ = ["ALIKE", "Cut", "Retrieval", "RetrievalSettings", "Retriever", "Served", "as_text"]

_SHOWN = 5  # near misses that are reported, of each rule
_FIRST = 32  # nearest keys that near misses are looked for among
_MORE = 3  # times as many entries are looked at as are served
_FOUND_BY_TEXT = 64  # entries asked of the vector store
_OPPOSITE_KEYS = 12  # of the opposite action, that remarks about gripping are looked for under

_E, _K = tables.entries.c, tables.keys.c
_FOUND = sa.select(_E.id, _E.kind, _E.key, _E.text).where(
    _E.id.in_([sa.bindparam(name) for name in PLACE_NAMES]), _E.superseded_by.is_(None)
)

_Ranked = list[tuple[Entry, int]]  # entries and their places among the candidates


def as_text(subtask: Key) -> str:
    """The words that entries' texts are compared with."""
    return " ".join((subtask.action, *subtask.objects))


@attrs.frozen(eq=False)
class _Question:
    """A subtask, ready to be compared."""

    key: Key
    context: SubtaskContext
    meant: np.ndarray  # unit vector of its words
    scores: KeyScores
    opposite: np.ndarray  # bool, of each key whether it undoes the action
    terms: tuple[dict[str, float], float]


class Retriever:
    """Serves subtasks from one book. Keeps a derived index that follows the database's generation."""

    def __init__(
        self,
        database: Database,
        vectors: TextVectors,
        index: KeyIndex,
        key_vectors: KeyVectors,
        settings: RetrievalSettings,
        search: TextSearch,
        likeness: Likeness,
    ) -> None:
        self._database = database
        self._vectors = vectors
        self._likeness = likeness
        self._index = index
        self._search = search
        self._key_vectors = key_vectors
        self._settings = settings
        self._actions = settings.actions
        self._terms = Terms(self._actions)
        self._limits = {"correction": settings.corrections, "template": settings.templates}
        self._state: Contents | None = None  # what the book is taken to be
        self._last: Contents | None = None  # what it was when it was last read
        self._lock = threading.Lock()  # one that was given up may still be at work on the index

    def retrieve(self, subtask: Key, context: SubtaskContext | None = None) -> Retrieval:
        """Entries for a subtask; ``context`` is what a look at the scene adds to its name.

        Raises ``SkillbookError``, ``BackendUnavailable``.
        """
        with self._lock:
            while True:
                state = self._state or self._load()
                found = self._retrieve(subtask, context or SubtaskContext(), state)
                if found is not None:
                    return found
                self._state = None  # the book has changed meanwhile

    def _retrieve(self, subtask: Key, context: SubtaskContext, state: Contents) -> Retrieval | None:
        """None when ``state`` is not the database's state any more."""
        if generation_of(self._database) != state.generation:
            return None  # before anything is done in vain, and a store that others bring up to date is asked
        question = self._question(subtask, context, state)
        found = self._candidates(question, state)
        general = self._best_general(question.meant, state)
        wanted = [*(int(i) for one in found.values() for i in one.ids), *general]
        generation, rows = served_rows(self._database, wanted, state.by_id)
        if generation != state.generation:
            return None
        served = {kind: self._ranked(kind, found[kind], rows, question) for kind in KINDS}
        served["general"] = self._general(general, rows, question)
        served = self._told(question.key, served)
        return Retrieval(
            subtask,
            served["correction"],
            served["general"],
            served["template"],
            self._cut(question, served, state),
            state.generation,
        )

    def _load(self) -> Contents:
        contents, changed = read_contents(self._database, self._actions, self._last)
        self._likeness.forget(changed)
        if self._last is None or contents.ids is not self._last.ids or contents.book != self._last.book:
            self._index.load(dict(zip(contents.ids, contents.keys, strict=True)), contents.book)
        self._state = self._last = contents
        return contents

    def _question(self, subtask: Key, context: SubtaskContext, state: Contents) -> _Question:
        query = state.aliases.get(str(subtask), subtask)
        actions, objects = self._key_vectors.get([query])
        return _Question(
            query,
            context,
            self._vectors.get([as_text(query)])[0],
            self._index.score(actions[0], objects[0], self._settings.weights),
            state.opposite_rows(query.action, self._actions),
            self._terms.of_subtask(query, context),
        )

    # -- candidates ----------------------------------------------------------------------------------------------------
    def _candidates(self, question: _Question, state: Contents) -> dict[str, Candidates]:
        """By kind: all that may be among those served."""
        if self._settings.ranking == "key":
            return {kind: self._by_key(kind, question, state, self._settings.cut) for kind in KINDS}
        by_text = self._by_text(question, state)
        found = {}
        for kind, limit in self._limits.items():
            if not limit:
                found[kind] = Candidates.none()
                continue
            floor = -np.inf if kind == "correction" else self._settings.cut
            several = [self._by_key(kind, question, state, floor), by_text[kind]]
            if kind == "correction" and self._terms.grips(question.key.action, question.context):
                several.insert(0, self._about_gripping(question, state))
            joined = Candidates.joined(several)
            found[kind] = joined.only(best(joined.scores(self._settings), joined.similar, _MORE * limit))
        return found

    def _by_key(self, kind: str, question: _Question, state: Contents, floor: float) -> Candidates:
        """The best entries by r, those of one key by their text, and all that tie with the last of them."""
        scores, limit = question.scores.scores, self._limits[kind]
        count = limit if self._settings.ranking == "key" else _MORE * limit
        sizes = state.sizes[kind]
        rows = np.flatnonzero(~question.opposite & (sizes > 0) & (scores >= floor - TIE)) if limit else _NO_ROWS
        if len(rows) > count:  # every key has an entry
            least = np.partition(scores[rows], len(rows) - count)[len(rows) - count]
            rows = rows[scores[rows] >= least - TIE]
        rows = rows[np.lexsort((rows, -scores[rows]))]
        taken = np.cumsum(sizes[rows])
        if len(rows) and taken[-1] > count:
            last = int(np.searchsorted(taken, count))
            rows = rows[scores[rows] >= scores[rows[last]] - TIE]
        if not len(rows):
            return Candidates.none()
        nearest = self._likeness.nearest(kind, [state.ids[row] for row in rows.tolist()], question.meant, count)
        entry_rows = np.repeat(rows, [len(ids) for ids, _ in nearest])
        ids, similar = (np.concatenate(column) for column in zip(*nearest, strict=True))
        found = self._scored(question, state, ids, entry_rows, similar)
        if self._settings.ranking == "key":
            return found.only(best(found.key_scores, found.similar, count))
        return found

    def _by_text(self, question: _Question, state: Contents) -> dict[str, Candidates]:
        """Those whose texts are most like the subtask's words, by kind. Not under a key whose action undoes it."""
        if sum(int(state.sizes[kind].sum()) for kind in KINDS) > self._settings.text_entries:
            return {kind: Candidates.none() for kind in KINDS}
        valid = self._rows(self._search.nearest(question.meant, _FOUND_BY_TEXT, state).tolist())
        if not valid and any(self._limits[kind] and state.sizes[kind].any() for kind in KINDS):
            valid = self._rows(self._search.nearest(question.meant, _FOUND_BY_TEXT, state, distrust=True).tolist())
        kept = [
            (entry, kind, state.row_of[key], text)
            for entry, kind, key, text in {row[0]: tuple(row) for row in valid}.values()
            if key in state.row_of and not question.opposite[state.row_of[key]]
        ]
        found = {}
        for kind in KINDS:
            of_kind = [one for one in kept if one[1] == kind]
            if not of_kind:
                found[kind] = Candidates.none()
                continue
            similar = np.vecdot(self._vectors.get([text for *_, text in of_kind]), question.meant)
            entries, rows = (np.array([one[place] for one in of_kind], np.int64) for place in (0, 2))
            one = self._scored(question, state, entries, rows, similar)
            found[kind] = one if kind == "correction" else one.only(one.key_scores >= self._settings.cut - TIE)
        return found

    def _about_gripping(self, question: _Question, state: Contents) -> Candidates:
        """Remarks about how to hold a thing that were made at an action which undoes this one: how hard to grip is
        often noticed only when a thing is put down. They count as made at gripping what was moved."""
        rows = np.flatnonzero(question.opposite & (state.sizes["correction"] > 0))
        if not len(rows):
            return Candidates.none()
        moved = question.scores.moved_cosines
        rows = rows[np.argsort(-moved[rows], kind="stable")[:_OPPOSITE_KEYS]]
        limit = _MORE * self._limits["correction"]
        nearest = self._likeness.nearest("correction", [state.ids[row] for row in rows.tolist()], question.meant, limit)
        entry_rows = np.repeat(rows, [len(ids) for ids, _ in nearest])
        ids, similar = (np.concatenate(column) for column in zip(*nearest, strict=True))
        texts = self._texts(ids.tolist())
        chosen = np.array([self._terms.about_gripping(texts.get(entry, "")) for entry in ids.tolist()], dtype=bool)
        one = self._scored(question, state, ids[chosen], entry_rows[chosen], similar[chosen])
        by_action, by_moved = self._settings.weights
        action = np.ones(len(one.ids))
        scores = (by_action * action + by_moved * moved[entry_rows[chosen]]) / (by_action + by_moved)
        return attrs.evolve(one, key_scores=scores, action_cosines=action, objects_cosines=moved[entry_rows[chosen]])

    def _scored(
        self, question: _Question, state: Contents, ids: np.ndarray, rows: np.ndarray, similar: np.ndarray
    ) -> Candidates:
        """With all terms of their scores but the overlap, which needs their texts."""
        scores, nothing = question.scores, np.zeros(len(ids))
        by_key = nothing
        if self._settings.ranking == "key-and-text" and len(ids):
            different, place = np.unique(rows, return_inverse=True)
            vectors = self._vectors.get([as_text(state.keys[row]) for row in different.tolist()])
            by_key = np.vecdot(vectors, question.meant).astype(np.float64)[place]
        terms = (scores.scores[rows], scores.action_cosines[rows], scores.objects_cosines[rows])
        return Candidates(np.asarray(ids, np.int64), *terms, similar.astype(np.float64), by_key, nothing)

    def _texts(self, ids: Sequence[int]) -> dict[int, str]:
        return {row[0]: row[3] for row in self._rows(ids)}

    def _rows(self, ids: Sequence[int]) -> list[Sequence[Any]]:
        """Id, kind, key and text of those that are valid."""
        return [row for part in batched(ids, PLACES) for row in self._database.fetch(_FOUND, places(part))]

    def _best_general(self, meant: np.ndarray, state: Contents) -> dict[int, float]:
        if state.everywhere is None or not self._settings.general:
            return {}
        ids, similar = self._likeness.nearest_of_all("general", state.everywhere, meant, self._settings.general)
        order = np.lexsort((ids, -similar))
        return {int(ids[i]): float(similar[i]) for i in order}

    # -- ranking -------------------------------------------------------------------------------------------------------
    def _ranked(self, kind: str, found: Candidates, rows: dict[int, Entry], question: _Question) -> tuple[Served, ...]:
        """The best of the candidates, by score, likeness of the text, confirmed uses and recency."""
        there = np.array([entry in rows for entry in found.ids.tolist()], dtype=bool)
        found = found.only(there) if len(there) else found
        if self._settings.ranking == "key-and-text" and len(found.ids):
            texts = [headline(kind, rows[entry].text) for entry in found.ids.tolist()]
            overlap = np.array([self._terms.overlap(question.terms, text) for text in texts])
            found = attrs.evolve(found, overlap=overlap)
        found = found.only(found.served(self._settings)) if len(found.ids) else found
        scores = found.scores(self._settings)
        order = np.lexsort((-found.similar, -np.round(scores, 6)))
        entries = [rows[entry] for entry in found.ids[order].tolist()]
        ranked = _ties_by_use(
            [
                (entry, float(scores[i]), float(found.similar[i]), int(i))
                for entry, i in zip(entries, order, strict=True)
            ]
        )
        if kind == "template" and len(ranked) > 1:
            ranked = self._failing_last(ranked)
        return tuple(
            Served(
                entry,
                rank,
                float(scores[i]),
                float(found.action_cosines[i]),
                float(found.objects_cosines[i]),
                float(found.similar[i]),
                float(found.key_scores[i]),
                float(found.overlap[i]),
            )
            for rank, (entry, i) in enumerate(ranked[: self._limits[kind]], start=1)
        )

    def _failing_last(self, ranked: list[tuple[Entry, int]]) -> list[tuple[Entry, int]]:
        """Templates that fail when they are run again in a simulator come after those that do not."""
        with self._database.read() as connection:
            failed = failing(self._database, connection, [entry.id for entry, _ in ranked])
        return sorted(ranked, key=lambda one: one[0].id in failed)

    def _general(self, found: dict[int, float], rows: dict[int, Entry], question: _Question) -> tuple[Served, ...]:
        """Those like enough to the subtask; half as like is enough for one that shares a term with it, and one that
        names no action or part ("be slow near people") holds everywhere."""
        floor = self._settings.general_floor - TIE
        relevant = {}
        for i, similar in found.items():
            text = rows[i].text if i in rows else ""
            near = min(floor, floor / 2) if self._terms.overlap(question.terms, text) else floor
            if text and (similar >= near or not self._terms.particular(text)):
                relevant[i] = similar
        ranked = _ties_by_use([(rows[i], similar, similar, i) for i, similar in relevant.items()])
        return tuple(
            Served(entry, rank, found[i], 0.0, 0.0, found[i])
            for rank, (entry, i) in enumerate(ranked[: self._settings.general], start=1)
        )

    def _told(self, query: Key, served: dict[str, tuple[Served, ...]]) -> dict[str, tuple[Served, ...]]:
        """With who said each, when, and how alike its key is."""
        known = provenance_of(self._database, [one.entry.id for some in served.values() for one in some])
        return {
            kind: tuple(
                attrs.evolve(
                    one,
                    provenance=known.get(one.entry.id, Provenance()),
                    alike=alike(query, one.entry.key, self._actions) if one.entry.key.objects else "",
                )
                for one in some
            )
            for kind, some in served.items()
        }

    # -- what was not served -------------------------------------------------------------------------------------------
    def _cut(self, question: _Question, served: dict[str, tuple[Served, ...]], state: Contents) -> tuple[Cut, ...]:
        """Of the nearest keys those that nothing, or not everything, was served of."""
        rows = question.scores.best_first(_FIRST)
        from_key = Counter((one.entry.kind, one.entry.key) for some in served.values() for one in some)
        left = {
            kind: [int(state.sizes[kind][row]) - from_key[kind, state.keys[row]] for row in rows.tolist()]
            for kind in KINDS
        }
        passing = question.scores.scores[rows] >= self._settings.cut - TIE
        nothing = [not any(from_key[kind, state.keys[row]] for kind in KINDS) for row in rows.tolist()]
        below = f"below the cut {self._settings.cut:g}"
        refused = [
            self._cut_of(question, state, row, sum(left[kind][n] for kind in KINDS), rule)
            for n, row in enumerate(rows.tolist())
            for rule in ["opposite action" if question.opposite[row] else below]
            if nothing[n] and (question.opposite[row] or not passing[n])
        ]
        beyond = []
        for kind, limit in self._limits.items():
            if len(served[kind]) >= limit:
                some = [
                    self._cut_of(question, state, row, left[kind][n], f"beyond the first {limit} {kind}s")
                    for n, row in enumerate(rows.tolist())
                    if left[kind][n] and passing[n] and not question.opposite[row]
                ]
                beyond += some[:_SHOWN]
        return (*refused[:_SHOWN], *beyond)

    def _cut_of(self, question: _Question, state: Contents, row: int, entries: int, rule: str) -> Cut:
        scores = question.scores
        r, action, objects = scores.scores[row], scores.action_cosines[row], scores.objects_cosines[row]
        return Cut(state.labels[row], float(r), float(action), float(objects), entries, rule)


_NO_ROWS = np.zeros(0, np.int64)


def _ties_by_use(ranked: list[tuple[Entry, float, float, int]]) -> list[tuple[Entry, int]]:
    """Entries in order of score and likeness; those that tie in both by confirmed uses, then the newest."""
    found: list[tuple[Entry, int]] = []
    tied: list[tuple[Entry, float, float, int]] = []
    for one in ranked:
        if tied and (abs(tied[0][1] - one[1]) >= TIE or abs(tied[0][2] - one[2]) >= TIE):
            found += [(entry, place) for entry, _, _, place in sorted(tied, key=_by_use)]
            tied = []
        tied.append(one)
    return found + [(entry, place) for entry, _, _, place in sorted(tied, key=_by_use)]


def _by_use(item: tuple[Entry, float, float, int]) -> tuple[float, ...]:
    return (-item[0].confirmed_uses, -item[0].created, -item[0].id)
