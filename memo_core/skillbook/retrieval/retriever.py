"""Retrieval: the entries for a subtask, in two stages.

1. *Candidates.* All keys are scored, exactly, by r(q, v). Candidates are the entries under the nearest keys, the
   entries whose texts the vector store proposes, what each person said last under the subtask's own key, and remarks
   about gripping made at the opposite action (for actions that take hold of something). Their scores s(q, e) come from
   one formula (``memo_core.skillbook.retrieval.score``); an entry whose action undoes the subtask's is in no other way
   a candidate.
2. *Ranking.* For the best few dozen of each kind the score also counts how the things are built that they were taught
   on; then the limit of the kind applies. Equal scores: by the text's cosine, then confirmed uses, then recency.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence

import attrs
import numpy as np
import sqlalchemy as sa

from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook.model.entries import Entry, spoken
from memo_core.skillbook.model.keys import Key, as_text
from memo_core.skillbook.model.scene_context import SubtaskContext
from memo_core.skillbook.retrieval import shared_terms
from memo_core.skillbook.retrieval.key_index import BookKeys, KeyScores, Row, entries_among, entries_under, read_keys
from memo_core.skillbook.retrieval.newest import newest_before_older, newest_of_people
from memo_core.skillbook.retrieval.provenance import Provenance, provenance_of
from memo_core.skillbook.retrieval.result import ALIKE, Cut, Retrieval, RetrievedEntry, alike
from memo_core.skillbook.retrieval.score import TIE, ScoreTerms, entry_score, key_score, may_be_retrieved
from memo_core.skillbook.retrieval.settings import RetrievalSettings
from memo_core.skillbook.retrieval.structural_similarity import BuiltAlike
from memo_core.skillbook.retrieval.text_search import TextSearch
from memo_core.skillbook.store import queries
from memo_core.skillbook.store.database import Database
from memo_core.skillbook.vectors.key_vectors import KeyVectors
from memo_core.skillbook.vectors.text_vectors import TextVectors

__all__ = ["ALIKE", "Cut", "Retrieval", "RetrievalSettings", "RetrievedEntry", "Retriever", "as_text"]

KINDS = ("correction", "template")  # kinds of entries under keys of their own
UNDER_KEYS = 200  # candidates of each kind under the nearest keys
BY_TEXT = 200  # candidates that the vector store proposes
_OPPOSITE_KEYS = 12  # keys of the opposite action whose remarks about gripping are candidates
_RANKED = 3  # times as many entries are ranked in the second stage as are retrieved
_NEAR_MISSES = 5  # keys that are reported as cut, of each rule,
_AMONG_NEAREST = 32  # among so many of the nearest


@attrs.frozen(eq=False)
class _Query:
    """A subtask, ready to be compared."""

    key: Key
    context: SubtaskContext
    vector: np.ndarray  # unit vector of its words, float32 (d,)
    terms: shared_terms.Wanted
    scores: KeyScores
    opposite: np.ndarray  # whether each key's action undoes the subtask's, bool (n,)


@attrs.frozen(eq=False)
class _Found:
    """The candidates of one generation of the book."""

    rows: list[Row]
    last_words: frozenset[int]  # entries made of what each person said last: always retrieved
    about_gripping: frozenset[int]  # entries under keys of the opposite action


class Retriever:
    """Retrieves entries from one book."""

    def __init__(
        self,
        database: Database,
        vectors: TextVectors,
        key_vectors: KeyVectors,
        settings: RetrievalSettings,
        store: VectorStore | None,
    ) -> None:
        """Prepare retrieval; nothing is read.

        Args:
            database: the book's database, open when ``retrieve`` is called.
            vectors: embeddings of texts.
            key_vectors: embeddings of keys' actions and objects.
            settings: retrieval settings.
            store: vector store of the book's texts; None: all are compared.
        """
        self._database = database
        self._vectors = vectors
        self._key_vectors = key_vectors
        self._settings = settings
        self._actions = settings.actions
        self._terms = shared_terms.Terms(self._actions)
        self._texts = TextSearch(database, vectors, store)
        self._built = BuiltAlike(database)
        self._keys: BookKeys | None = None
        self._lock = threading.Lock()  # an abandoned retrieval may still be at work

    def retrieve(self, subtask: Key, context: SubtaskContext | None = None) -> Retrieval:
        """Retrieve entries for a subtask.

        Args:
            subtask: action and objects, as planned.
            context: what the scene shows of the objects; None: not known.

        Returns:
            The entries with their scores, best first within each kind.

        Raises:
            SkillbookError: if the book cannot be read.
            BackendUnavailable: if embedder or vector store cannot be used.
        """
        with self._lock:
            while True:
                keys = self._keys or read_keys(self._database, self._vectors, self._key_vectors)
                query = self._query(subtask, context or SubtaskContext(), keys)
                proposed = self._proposed(query, keys)
                with self._database.read() as connection:
                    current = int(self._database.meta(connection)["generation"]) == keys.generation
                    found = self._candidates(connection, query, keys, proposed) if current else None
                if found is None:
                    self._keys = None  # the book has changed meanwhile
                    continue
                self._keys = keys
                return self._result(subtask, query, keys, found)

    def _query(self, subtask: Key, context: SubtaskContext, keys: BookKeys) -> _Query:
        key = keys.aliases.get(str(subtask), subtask)
        actions, objects = self._key_vectors.get([key])
        words = self._vectors.get([as_text(key)])[0]
        terms = self._terms.of_subtask(key, context)
        if not keys.keys:
            nothing = np.zeros(0)
            empty = KeyScores(nothing, nothing, nothing, nothing, nothing)
            return _Query(key, context, words, terms, empty, nothing.astype(bool))
        scores = keys.score(actions[0], objects[0], self._settings.weights)
        return _Query(key, context, words, terms, scores, keys.opposite(key.action, self._actions))

    def _proposed(self, query: _Query, keys: BookKeys) -> np.ndarray:
        """Ids of the entries whose texts are most similar to the subtask's words; none where r(q, v) decides alone."""
        if self._settings.ranking == "key":
            return np.zeros(0, np.int64)
        return self._texts.nearest(query.vector, BY_TEXT, keys)

    # -- stage 1: candidates -------------------------------------------------------------------------------------------
    def _candidates(self, connection: sa.Connection, query: _Query, keys: BookKeys, proposed: np.ndarray) -> _Found:
        """Active entries that may be retrieved, each once."""
        settings, by_key = self._settings, query.scores.best_first
        near = by_key[~query.opposite[by_key]]
        listed = [row for kind in KINDS if settings.limit(kind) for row in _under(connection, kind, keys, near)]
        if keys.global_id is not None and settings.general:
            listed += entries_under(connection, "general", np.array([keys.global_id]), UNDER_KEYS)
        undoing = set(keys.ids[query.opposite].tolist())
        listed += [row for row in entries_among(connection, proposed, keys.several) if row.key not in undoing]
        gripping = self._about_gripping(connection, query, keys)
        last: list[int] = []
        if settings.newest and settings.corrections:
            own = keys.ids[(query.scores.scores >= 1 - TIE) & ~query.opposite]
            last = newest_of_people(self._database, connection, own.tolist(), settings.corrections, keys.several)
            listed += entries_among(connection, np.array(last, np.int64), keys.several)
        rows = {row.id: row for row in self._nearest_last(query, keys, [*gripping, *listed])}
        return _Found([*rows.values()], frozenset(last), frozenset(row.id for row in gripping))

    def _nearest_last(self, query: _Query, keys: BookKeys, rows: list[Row]) -> list[Row]:
        """Rows in their order, of a note with several keys the nearest last."""
        if not keys.several:
            return rows
        score = {key: float(query.scores.scores[row]) for key, row in keys.row_of.items()}
        return sorted(rows, key=lambda row: score.get(row.key, 0.0))

    def _about_gripping(self, connection: sa.Connection, query: _Query, keys: BookKeys) -> list[Row]:
        """Remarks about how to hold a thing, made at an action that undoes this one: how hard to grip is often noticed
        only when a thing is put down."""
        settings = self._settings
        if settings.ranking == "key" or not settings.corrections:
            return []
        if not self._terms.grips(query.key.action, query.context):
            return []
        by_moved = np.argsort(-query.scores.moved_cosines, kind="stable")
        undoing = by_moved[query.opposite[by_moved]][:_OPPOSITE_KEYS]
        rows = _under(connection, "correction", keys, undoing)
        return [row for row in rows if self._terms.about_gripping(row.text)]

    def _best(self, kind: str, query: _Query, keys: BookKeys, found: _Found) -> list[RetrievedEntry]:
        """The best few dozen candidates of a kind by score, and all that must be retrieved; not in order."""
        rows = [row for row in found.rows if row.as_kind == kind]
        limit = self._settings.limit(kind)
        if not rows or not limit:
            return []
        action, objects, terms = self._compared(rows, query, keys, found)
        scores = entry_score(terms, self._settings)
        must = np.array([row.id in found.last_words for row in rows])
        allowed = must | may_be_retrieved(terms, scores, self._settings, self._settings.room(kind))
        order = np.lexsort((-terms.text, -np.round(scores, 6)))
        order = order[allowed[order]]
        best = [n for place, n in enumerate(order.tolist()) if place < _RANKED * limit or must[n]]
        entries = self._entries([rows[n].id for n in best])
        return [
            RetrievedEntry(
                entries[rows[n].id],
                0,
                float(scores[n]),
                float(action[n]),
                float(objects[n]),
                float(terms.text[n]),
                float(terms.key[n]),
                float(terms.overlap[n]),
                passes=bool(terms.key[n] >= self._settings.cut - TIE),
                exchanged=float(terms.exchanged[n]),
                under="" if entries[rows[n].id].key == keys.of(rows[n].key) else str(keys.of(rows[n].key)),
            )
            for n in best
            if rows[n].id in entries
        ]

    def _compared(
        self, rows: Sequence[Row], query: _Query, keys: BookKeys, found: _Found
    ) -> tuple[np.ndarray, np.ndarray, ScoreTerms]:
        """Action cosines, object cosines and the terms of s(q, e) of some candidates. A remark about gripping counts as
        made at gripping what was moved."""
        scores, at = query.scores, np.array([keys.row_of[row.key] for row in rows])
        gripping = np.array([row.id in found.about_gripping for row in rows])
        action = np.where(gripping, 1.0, scores.action_cosines[at])
        objects = np.where(gripping, scores.moved_cosines[at], scores.objects_cosines[at])
        texts = [spoken(row.kind, row.text) for row in rows]
        overlap = np.zeros(len(rows))
        if self._settings.ranking == "key-and-text":
            overlap = np.array([self._terms.overlap(query.terms, text) for text in texts])
        terms = ScoreTerms(
            key_score(action, objects, *self._settings.weights),
            np.vecdot(self._vectors.get(texts), query.vector).astype(np.float64),
            np.vecdot(keys.vectors[at], query.vector).astype(np.float64),
            overlap,
            scores.exchanged[at],
        )
        return action, objects, terms

    def _best_general(self, query: _Query, found: _Found) -> list[RetrievedEntry]:
        """General statements like enough to the subtask, best first; half as like is enough for one that shares a term
        with it, and one that names no action or part ("be slow near people") holds everywhere."""
        rows = [row for row in found.rows if row.kind == "general" and row.text]
        if not rows:
            return []
        similar = np.vecdot(self._vectors.get([row.text for row in rows]), query.vector).astype(np.float64)
        nearest = np.lexsort(([row.id for row in rows], -similar))[: self._settings.general].tolist()
        floor, terms = self._settings.general_floor - TIE, self._terms

        def relevant(text: str, likeness: float) -> bool:
            shares_a_term = likeness >= min(floor, floor / 2) and terms.overlap(query.terms, text) > 0
            return likeness >= floor or shares_a_term or not terms.particular(text)

        entries = self._entries([rows[n].id for n in nearest])
        chosen = [(rows[n], float(similar[n])) for n in nearest if relevant(rows[n].text, float(similar[n]))]
        found_entries = [
            RetrievedEntry(entries[row.id], 0, likeness, 0.0, 0.0, likeness)
            for row, likeness in chosen
            if row.id in entries
        ]
        return _ties_by_use(found_entries)

    def _entries(self, ids: Sequence[int]) -> dict[int, Entry]:
        with self._database.read() as connection:
            return queries.entries_by_id(connection, ids)

    # -- stage 2: ranking ----------------------------------------------------------------------------------------------
    def _ranked(
        self, kind: str, best: list[RetrievedEntry], query: _Query, keys: BookKeys, last: frozenset[int]
    ) -> list[RetrievedEntry]:
        """The entries of a kind that are retrieved, in order. Templates that fail when they are run again in a
        simulator come after those that do not."""
        ranked = _ties_by_use(sorted(self._by_structure(best, query), key=_by_score))
        if kind == "template":
            ranked.sort(key=lambda one: one.entry.id in keys.failing)
        return _first(ranked, self._settings.limit(kind), last)

    def _by_structure(self, best: list[RetrievedEntry], query: _Query) -> list[RetrievedEntry]:
        """Entries with w_b (b(q, e) - 0.5) added to their scores, where b in [0, 1] says how alike the things are
        built; where the scene of one entry is not known, b is the mean of the others'."""
        weight = self._settings.built_weight
        if self._settings.ranking == "key" or not weight:
            return best
        known = self._built.of(query.context, [one.entry for one in best])
        if not known:
            return best
        mean = sum(known.values()) / len(known)
        return [
            attrs.evolve(
                one,
                built=known.get(one.entry.id),
                score=one.score + weight * (known.get(one.entry.id, mean) - 0.5),
            )
            for one in best
        ]

    def _result(self, subtask: Key, query: _Query, keys: BookKeys, found: _Found) -> Retrieval:
        ranked = {
            kind: self._ranked(kind, self._best(kind, query, keys, found), query, keys, found.last_words)
            for kind in KINDS
        }
        ranked["general"] = self._best_general(query, found)
        known = provenance_of(self._database, [one.entry.id for some in ranked.values() for one in some])
        if self._settings.newest:
            ranked["correction"] = newest_before_older(ranked["correction"], known)
        corrections, templates, general = (
            tuple(
                attrs.evolve(
                    one,
                    rank=rank,
                    provenance=known.get(one.entry.id, Provenance()),
                    alike=alike(query.key, one.about, self._actions) if one.entry.key.objects else "",
                )
                for rank, one in enumerate(some, start=1)
            )
            for some in ranked.values()
        )
        cut = self._cut(query, keys, {"correction": corrections, "template": templates})
        return Retrieval(subtask, corrections, general, templates, cut, keys.generation)

    # -- what was cut --------------------------------------------------------------------------------------------------
    def _cut(self, query: _Query, keys: BookKeys, retrieved: dict[str, tuple[RetrievedEntry, ...]]) -> tuple[Cut, ...]:
        """The nearest keys of which nothing, or not everything, was retrieved."""
        nothing: list[Cut] = []
        beyond: dict[str, list[Cut]] = {kind: [] for kind in KINDS}
        taken = {kind: self._taken(keys, some) for kind, some in retrieved.items()}
        for row in query.scores.best_first[:_AMONG_NEAREST].tolist():
            key, passes, undoes = (
                keys.keys[row],
                query.scores.scores[row] >= self._settings.cut - TIE,
                query.opposite[row],
            )
            left = {kind: int(keys.sizes[kind][row]) - taken[kind][key] for kind in KINDS}
            if (undoes or not passes) and not any(taken[kind][key] for kind in KINDS):
                rule = "opposite action" if undoes else f"below the cut {self._settings.cut:g}"
                nothing.append(_cut_key(keys, query.scores, row, sum(left.values()), rule))
            for kind in KINDS:
                limit = self._settings.limit(kind)
                if left[kind] and passes and not undoes and len(retrieved[kind]) >= limit:
                    beyond[kind].append(
                        _cut_key(keys, query.scores, row, left[kind], f"beyond the first {limit} {kind}s")
                    )
        return tuple(cut for some in (nothing, *beyond.values()) for cut in some[:_NEAR_MISSES])

    def _taken(self, keys: BookKeys, retrieved: Sequence[RetrievedEntry]) -> Counter[Key]:
        """Count the retrieved entries of each key, a note of several keys under each of them."""
        if not keys.several:
            return Counter(one.entry.key for one in retrieved)
        with self._database.read() as connection:
            rows = entries_among(connection, np.array([one.entry.id for one in retrieved], np.int64), True)
        return Counter(keys.of(row.key) for row in rows if row.key in keys.row_of)


def _cut_key(keys: BookKeys, scores: KeyScores, row: int, entries: int, rule: str) -> Cut:
    key, action, objects = (
        float(column[row]) for column in (scores.scores, scores.action_cosines, scores.objects_cosines)
    )
    return Cut(str(keys.keys[row]), key, rule, action, objects, entries)


def _under(connection: sa.Connection, kind: str, keys: BookKeys, rows: np.ndarray) -> list[Row]:
    """``UNDER_KEYS`` entries of a kind under the first of some keys (rows of ``keys``, nearest first); of the last key
    that fits in part, the newest."""
    sizes = keys.sizes[kind][rows]
    rows, sizes = rows[sizes > 0], sizes[sizes > 0]
    before = np.cumsum(sizes) - sizes
    whole = rows[before + sizes <= UNDER_KEYS]
    partly = rows[(before < UNDER_KEYS) & (before + sizes > UNDER_KEYS)]
    several = keys.several and kind == "correction"
    found = entries_under(connection, kind, keys.ids[whole], UNDER_KEYS, several) if len(whole) else []
    if len(partly):
        found += entries_under(connection, kind, keys.ids[partly], max(0, UNDER_KEYS - len(found)), several)
    return found


def _by_score(one: RetrievedEntry) -> tuple[float, float]:
    return (-round(one.score, 6), -one.text_similarity)


def _first(ranked: list[RetrievedEntry], limit: int, must: frozenset[int]) -> list[RetrievedEntry]:
    """The first ``limit`` entries; those that must be retrieved take the places of the last others."""
    left = max(0, limit - sum(one.entry.id in must for one in ranked))
    first: list[RetrievedEntry] = []
    for one in ranked:
        left -= one.entry.id not in must
        if one.entry.id in must or left >= 0:
            first.append(one)
    return first


def _ties_by_use(ranked: list[RetrievedEntry]) -> list[RetrievedEntry]:
    """Entries in order of score and likeness; ties in both by confirmed uses, then the newest."""
    found: list[RetrievedEntry] = []
    tied: list[RetrievedEntry] = []
    for one in ranked:
        if tied and (
            abs(tied[0].score - one.score) >= TIE or abs(tied[0].text_similarity - one.text_similarity) >= TIE
        ):
            found += sorted(tied, key=_by_use)
            tied = []
        tied.append(one)
    return found + sorted(tied, key=_by_use)


def _by_use(one: RetrievedEntry) -> tuple[float, ...]:
    return (-one.entry.confirmed_uses, -one.entry.created, -one.entry.id)
