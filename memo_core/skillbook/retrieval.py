"""Retrieval: which entries a subtask is served, in which order, and what was cut by which rule.

Keys are compared by r(q, v), all of them and exactly. What was found (``memo_core.skillbook.finding``) is scored here
(``memo_core.skillbook.retrieval_score``). An entry whose action undoes the subtask's is not served, however it was
found, but for a remark about gripping.
"""

from __future__ import annotations

import threading
from math import isnan, nan
from typing import NamedTuple

import attrs
import numpy as np

from memo_core.interfaces.vectorstore import VectorStore
from memo_core.skillbook.built_alike import BuiltAlike
from memo_core.skillbook.database import Database
from memo_core.skillbook.entries import Entry
from memo_core.skillbook.finding import Finder
from memo_core.skillbook.finding_by_key import FinderByKey
from memo_core.skillbook.key_embedding import KeyVectors
from memo_core.skillbook.key_index import KeyIndex
from memo_core.skillbook.keys import Key
from memo_core.skillbook.newest import newest_before_older
from memo_core.skillbook.provenance import Provenance, provenance_of
from memo_core.skillbook.queries import generation_of, served_rows
from memo_core.skillbook.question import Question, as_text
from memo_core.skillbook.retrieval_cache import KINDS, Contents, read_contents
from memo_core.skillbook.retrieval_result import ALIKE, Cut, Retrieval, Served, alike
from memo_core.skillbook.retrieval_score import TIE, Candidates
from memo_core.skillbook.retrieval_settings import RetrievalSettings
from memo_core.skillbook.scene_context import SubtaskContext
from memo_core.skillbook.shared_terms import Terms
from memo_core.skillbook.speakers import Speakers
from memo_core.skillbook.text_index import Likeness
from memo_core.skillbook.text_vectors import TextVectors

__all__ = ["ALIKE", "Cut", "Retrieval", "RetrievalSettings", "Retriever", "Served", "as_text"]

_SHOWN = 5  # near misses that are reported, of each rule
_FIRST = 32  # nearest keys that near misses are looked for among


class _Ranked(NamedTuple):
    """An entry that is served unless others come first, and the terms of its score."""

    entry: Entry
    score: float
    action_cosine: float
    objects_cosine: float
    similar: float
    key_score: float = 0.0
    overlap: float = 0.0
    passes: bool = True
    built: float = nan
    exchanged: float = 0.0
    must: bool = False


class Retriever:
    """Serves subtasks from one book. Keeps a derived index that follows the database's generation."""

    def __init__(
        self,
        database: Database,
        vectors: TextVectors,
        index: KeyIndex,
        key_vectors: KeyVectors,
        settings: RetrievalSettings,
        store: VectorStore | None,
        likeness: Likeness,
    ) -> None:
        self._database = database
        self._vectors = vectors
        self._likeness = likeness
        self._index = index
        self._key_vectors = key_vectors
        self._settings = settings
        self._actions = settings.actions
        self._terms = Terms(self._actions)
        self._by_key = FinderByKey(database, vectors, settings, likeness)
        self._speakers = Speakers(database)  # followed by the finder
        self._finder: Finder | None = None  # where texts count
        if settings.ranking == "key-and-text":
            self._finder = Finder(database, vectors, settings, self._terms, store, likeness, self._speakers)
        self._built = BuiltAlike(database)
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
        ranked = {kind: self._ranked(kind, found[kind], rows, question, state) for kind in KINDS}
        ranked["general"] = self._general(general, rows, question)
        served = self._served(question.key, ranked)
        return Retrieval(
            subtask,
            served["correction"],
            served["general"],
            served["template"],
            self._cut(question, served, state),
            state.generation,
        )

    def _candidates(self, question: Question, state: Contents) -> dict[str, Candidates]:
        """By kind, the entries that may be served."""
        if self._finder is None:
            return {kind: self._by_key.candidates(kind, question, state) for kind in KINDS}
        return self._finder.candidates(question, state)

    def _load(self) -> Contents:
        contents, changed = read_contents(self._database, self._actions, self._last)
        self._likeness.forget(changed)
        if self._last is None or contents.ids is not self._last.ids or contents.book != self._last.book:
            self._index.load(dict(zip(contents.ids, contents.keys, strict=True)), contents.book)
        if self._finder is not None:
            self._finder.follow(contents, changed)
        self._state = self._last = contents
        return contents

    def _question(self, subtask: Key, context: SubtaskContext, state: Contents) -> Question:
        query = state.aliases.get(str(subtask), subtask)
        actions, objects = self._key_vectors.get([query])
        scores = self._index.score(actions[0], objects[0], self._settings.weights)
        opposite = state.opposite_rows(query.action, self._actions)
        return Question(
            query,
            context,
            self._vectors.get([as_text(query)])[0],
            scores,
            opposite,
            ~opposite & (scores.scores >= self._settings.cut - TIE),
            self._terms.of_subtask(query, context),
        )

    def _best_general(self, meant: np.ndarray, state: Contents) -> dict[int, float]:
        if state.everywhere is None or not self._settings.general:
            return {}
        ids, similar = self._likeness.nearest_of_all("general", state.everywhere, meant, self._settings.general)
        order = np.lexsort((ids, -similar))
        return {int(ids[i]): float(similar[i]) for i in order}

    # -- ranking -------------------------------------------------------------------------------------------------------
    def _ranked(
        self, kind: str, found: Candidates, rows: dict[int, Entry], question: Question, state: Contents
    ) -> list[_Ranked]:
        """The best of the candidates, by score, likeness of the text, confirmed uses and recency. Templates that fail
        when they are run again in a simulator come after those that do not."""
        ids = found.ids.tolist()
        if not rows.keys() >= set(ids):  # of a damaged book
            found = found.only(np.array([entry in rows for entry in ids]))
            ids = found.ids.tolist()
        if not ids:
            return []
        if self._settings.ranking == "key-and-text" and self._settings.built_weight:
            known = self._built.of(question.context, [rows[entry] for entry in ids])
            if known:
                found = attrs.evolve(found, built=np.array([known.get(entry, np.nan) for entry in ids]))
        ordered = _ties_by_use(_in_order(found, rows, self._settings))
        if kind == "template" and state.failing:
            ordered.sort(key=lambda one: one.entry.id in state.failing)
        return _first(ordered, self._settings.limit(kind))

    def _general(self, found: dict[int, float], rows: dict[int, Entry], question: Question) -> list[_Ranked]:
        """Those like enough to the subtask; half as like is enough for one that shares a term with it, and one that
        names no action or part ("be slow near people") holds everywhere."""
        floor, terms = self._settings.general_floor - TIE, self._terms
        half = min(floor, floor / 2)

        def relevant(text: str, similar: float) -> bool:
            near = similar >= floor or (similar >= half and terms.overlap(question.terms, text) > 0)
            return near or not terms.particular(text)

        there = [(rows[entry], similar) for entry, similar in found.items() if entry in rows and rows[entry].text]
        chosen = [_Ranked(one, similar, 0.0, 0.0, similar) for one, similar in there if relevant(one.text, similar)]
        return _ties_by_use(chosen)[: self._settings.general]

    def _served(self, query: Key, ranked: dict[str, list[_Ranked]]) -> dict[str, tuple[Served, ...]]:
        """With who said each, when, how alike its key is, and its place."""
        known = self._provenance({kind: [one.entry.id for one in some] for kind, some in ranked.items()})
        if self._settings.newest:
            ranked["correction"] = newest_before_older(ranked["correction"], known)
        keys = {one.entry.key for some in ranked.values() for one in some}
        likeness = {key: alike(query, key, self._actions) if key.objects else "" for key in keys}
        unknown = Provenance()
        return {
            kind: tuple(
                Served(
                    one.entry,
                    rank,
                    one.score,
                    one.action_cosine,
                    one.objects_cosine,
                    one.similar,
                    one.key_score,
                    one.overlap,
                    known.get(one.entry.id, unknown),
                    one.passes,
                    None if isnan(one.built) else one.built,
                    one.exchanged,
                    likeness[one.entry.key],
                )
                for rank, one in enumerate(some, start=1)
            )
            for kind, some in ranked.items()
        }

    def _provenance(self, entries: dict[str, list[int]]) -> dict[int, Provenance]:
        """Of entries by kind."""
        if self._finder is None:
            return provenance_of(self._database, [entry for some in entries.values() for entry in some])
        known = self._speakers.provenance([*entries["correction"], *entries["general"]])
        return known | provenance_of(self._database, entries["template"])

    # -- what was not served -------------------------------------------------------------------------------------------
    def _cut(self, question: Question, served: dict[str, tuple[Served, ...]], state: Contents) -> tuple[Cut, ...]:
        """Of the nearest keys those that nothing, or not everything, was served of."""
        rows = question.scores.best_first(_FIRST)
        place_of = {state.keys[row]: place for place, row in enumerate(rows.tolist())}
        left = {kind: state.sizes[kind][rows].tolist() for kind in KINDS}
        nothing = [True] * len(rows)
        for kind in KINDS:
            for key in [one.entry.key for one in served[kind]]:
                if (place := place_of.get(key)) is not None:
                    left[kind][place] -= 1
                    nothing[place] = False
        passing = (question.scores.scores[rows] >= self._settings.cut - TIE).tolist()
        opposite = question.opposite[rows].tolist()
        rules: list[tuple[int, int, str]] = []  # place among the rows, entries, rule
        for n in [n for n in range(len(rows)) if nothing[n] and (opposite[n] or not passing[n])][:_SHOWN]:
            rule = "opposite action" if opposite[n] else f"below the cut {self._settings.cut:g}"
            rules.append((n, sum(left[kind][n] for kind in KINDS), rule))
        for kind in KINDS:
            limit = self._settings.limit(kind)
            if len(served[kind]) >= limit:
                beyond = [n for n in range(len(rows)) if left[kind][n] and passing[n] and not opposite[n]]
                rules += [(n, left[kind][n], f"beyond the first {limit} {kind}s") for n in beyond[:_SHOWN]]
        scores = question.scores
        return tuple(
            Cut(
                state.labels[row],
                float(scores.scores[row]),
                float(scores.action_cosines[row]),
                float(scores.objects_cosines[row]),
                entries,
                rule,
            )
            for row, entries, rule in ((int(rows[n]), entries, rule) for n, entries, rule in rules)
        )


def _in_order(found: Candidates, rows: dict[int, Entry], settings: RetrievalSettings) -> list[_Ranked]:
    """Candidates by score, those that are level by the likeness of their texts."""
    scores = found.scores(settings)
    order = np.lexsort((-found.similar, -np.round(scores, 6)))
    columns = (
        scores,
        found.action_cosines,
        found.objects_cosines,
        found.similar,
        found.key_scores,
        found.overlap,
        found.passing(settings),
        found.built,
        found.exchanged,
        found.must,
    )
    entries = [rows[entry] for entry in found.ids[order].tolist()]
    return [_Ranked(*one) for one in zip(entries, *(column[order].tolist() for column in columns), strict=True)]


def _first(ranked: list[_Ranked], limit: int) -> list[_Ranked]:
    """The first so many; those that must be served take the places of the last others."""
    left = max(0, limit - sum(one.must for one in ranked))
    first: list[_Ranked] = []
    for one in ranked:
        left -= not one.must
        if one.must or left >= 0:
            first.append(one)
    return first


def _ties_by_use(ranked: list[_Ranked]) -> list[_Ranked]:
    """Entries in order of score and likeness; those that tie in both by confirmed uses, then the newest."""
    found: list[_Ranked] = []
    tied: list[_Ranked] = []
    for one in ranked:
        if tied and (abs(tied[0].score - one.score) >= TIE or abs(tied[0].similar - one.similar) >= TIE):
            found += sorted(tied, key=_by_use)
            tied = []
        tied.append(one)
    return found + sorted(tied, key=_by_use)


def _by_use(one: _Ranked) -> tuple[float, ...]:
    return (-one.entry.confirmed_uses, -one.entry.created, -one.entry.id)
